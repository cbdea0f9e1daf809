#!/usr/bin/env python3
"""Skins, morph targets and animations a second time, with numpy, beside the product's.

In: the program of `zig build bench:poses` (zig-out/bin/poses), and glTF files, each as SCENE or
SCENE:ANIMATION:TIME,TIME,... (without times: the rest, and at three times of animation 0). Out: for
each the number of triangles and the largest distance of a corner over the size of the scene. The
exit code is 4 where that is over 1e-4, or where the triangles are not as many.

By the text of glTF 2.0 alone: sections 3.5 to 3.7, 3.11 and appendix C. It knows plain accessors,
sparse ones and normalised integers, lists of triangles, strips and fans, and buffer views of
EXT_meshopt_compression (meshopt.py); no instancing.
"""

import base64
import json
import pathlib
import struct
import subprocess
import sys
import urllib.parse

import meshopt
import numpy as np

TYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
TOLERANCE = 1e-4


class File:
    """A document and its buffers."""

    def __init__(self, path):
        self.path = pathlib.Path(path)
        self.unpacked = {}
        data = self.path.read_bytes()
        binary = None
        if data[:4] == b"glTF":
            length = struct.unpack_from("<I", data, 12)[0]
            self.json = json.loads(data[20 : 20 + length])
            if len(data) > 20 + length:
                size = struct.unpack_from("<I", data, 20 + length)[0]
                binary = data[28 + length : 28 + length + size]
        else:
            self.json = json.loads(data)
        self.buffers = [self.load(buffer, binary) for buffer in self.json.get("buffers", [])]

    def load(self, buffer, binary):
        uri = buffer.get("uri")
        if uri is None:
            return binary
        if uri.startswith("data:"):
            return base64.b64decode(uri.split(",", 1)[1])
        return (self.path.parent / urllib.parse.unquote(uri)).read_bytes()

    def list(self, name):
        return self.json.get(name, [])

    def view(self, index):
        """Bytes of a view, and their stride or 0."""
        view = self.json["bufferViews"][index]
        if index in self.unpacked:
            return self.unpacked[index], view.get("byteStride", 0)
        packed = view.get("extensions", {})
        for name in ("EXT_meshopt_compression", "KHR_meshopt_compression"):
            if name in packed:
                packed = packed[name]
                start = packed.get("byteOffset", 0)
                data = self.buffers[packed["buffer"]][start : start + packed["byteLength"]]
                self.unpacked[index] = meshopt.unpack(data, packed)
                return self.unpacked[index], packed["byteStride"]
        start = view.get("byteOffset", 0)
        data = self.buffers[view["buffer"]][start : start + view["byteLength"]]
        return data, view.get("byteStride", 0)

    def read(self, index, raw=False):
        """An accessor as floats, one row an element; `raw`: as whole numbers."""
        accessor = self.json["accessors"][index]
        kind = np.dtype(TYPES[accessor["componentType"]])
        width = WIDTHS[accessor["type"]]
        count = accessor["count"]
        rows = np.zeros((count, width), kind)
        if "bufferView" in accessor:
            data, stride = self.view(accessor["bufferView"])
            rows = table(data, accessor.get("byteOffset", 0), stride, kind, width, count)
        if "sparse" in accessor:
            sparse = accessor["sparse"]
            size = sparse["count"]
            part = sparse["indices"]
            data, _ = self.view(part["bufferView"])
            of = np.dtype(TYPES[part["componentType"]])
            places = table(data, part.get("byteOffset", 0), 0, of, 1, size)[:, 0]
            part = sparse["values"]
            data, _ = self.view(part["bufferView"])
            rows = rows.copy()
            rows[places] = table(data, part.get("byteOffset", 0), 0, kind, width, size)
        if raw:
            return rows
        numbers = rows.astype(np.float64)
        if not accessor.get("normalized"):
            return numbers
        return np.maximum(numbers / np.iinfo(kind).max, -1)


def table(data, offset, stride, kind, width, count):
    strides = (stride or kind.itemsize * width, kind.itemsize)
    return np.ndarray((count, width), kind, data, offset, strides)


def matrix(node):
    if "matrix" in node:
        return np.array(node["matrix"], np.float64).reshape(4, 4).T
    x, y, z, w = unit(np.array(node.get("rotation", [0, 0, 0, 1]), np.float64))
    turn = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    whole = np.eye(4)
    whole[:3, :3] = turn * np.array(node.get("scale", [1, 1, 1]), np.float64)
    whole[:3, 3] = node.get("translation", [0, 0, 0])
    return whole


def unit(q):
    length = np.linalg.norm(q)
    return q / length if length > 0 else np.array([0.0, 0.0, 0.0, 1.0])


def sample(times, values, kind, time, is_rotation):
    """A sampler at a time; `values` has a row a key, or three of a spline."""
    last = len(times) - 1
    key = int(np.clip(np.searchsorted(times, time, "right") - 1, 0, last))
    spline = kind == "CUBICSPLINE"
    value = (lambda k: values[3 * k + 1]) if spline else (lambda k: values[k])
    if kind == "STEP" or time <= times[0] or key == last:
        return value(key)
    step = times[key + 1] - times[key]
    t = (time - times[key]) / step
    a, b = value(key), value(key + 1)
    if spline:
        out, into = values[3 * key + 2] * step, values[3 * key + 3] * step
        return (
            (2 * t**3 - 3 * t**2 + 1) * a
            + (t**3 - 2 * t**2 + t) * out
            + (3 * t**2 - 2 * t**3) * b
            + (t**3 - t**2) * into
        )
    if not is_rotation:
        return a + (b - a) * t
    a, b = unit(a), unit(b)
    cosine = a @ b
    angle = np.arccos(min(abs(cosine), 1))
    sign = -1 if cosine < 0 else 1
    if angle < 1e-6:
        return a + (sign * b - a) * t
    return (np.sin((1 - t) * angle) * a + sign * np.sin(t * angle) * b) / np.sin(angle)


def animate(file, which, time):
    """The nodes as an animation has them."""
    nodes = [dict(node) for node in file.list("nodes")]
    if which is None:
        return nodes
    animation = file.list("animations")[which]
    for channel in animation["channels"]:
        target = channel["target"]
        if "node" not in target:
            continue
        sampler = animation["samplers"][channel["sampler"]]
        times = file.read(sampler["input"])[:, 0]
        kind = sampler.get("interpolation", "LINEAR")
        values = file.read(sampler["output"])
        path = target["path"]
        if path == "weights":
            rows = len(times) * (3 if kind == "CUBICSPLINE" else 1)
            values = values.reshape(rows, -1)
        found = sample(times, values, kind, time, path == "rotation")
        nodes[target["node"]][path] = list(found)
    return nodes


def corners(file, primitive):
    """Vertices of the triangles of a primitive."""
    if "indices" in primitive:
        order = file.read(primitive["indices"], raw=True)[:, 0].astype(np.int64)
    else:
        order = np.arange(file.json["accessors"][primitive["attributes"]["POSITION"]]["count"])
    mode = primitive.get("mode", 4)
    if mode == 4:
        return order[: len(order) // 3 * 3].reshape(-1, 3)
    first = np.arange(max(len(order) - 2, 0))
    if mode == 5:
        odd = first % 2
        return np.stack([order[first], order[first + 1 + odd], order[first + 2 - odd]], 1)
    if mode == 6:
        return np.stack([order[first + 1], order[first + 2], order[first * 0]], 1)
    return np.zeros((0, 3), np.int64)


def posed(file, nodes, node, world, joints):
    """World positions of the corners of what a node draws."""
    mesh = file.json["meshes"][node["mesh"]]
    result = []
    for primitive in mesh["primitives"]:
        attributes = primitive["attributes"]
        if "POSITION" not in attributes:
            continue
        points = file.read(attributes["POSITION"]).copy()
        weights = node.get("weights", mesh.get("weights", []))
        for weight, target in zip(weights, primitive.get("targets", [])):
            if "POSITION" in target:
                points += weight * file.read(target["POSITION"])
        whole = np.concatenate([points, np.ones((len(points), 1))], 1)
        if joints is not None and "JOINTS_0" in attributes:
            total = np.zeros((len(points), 4, 4))
            sums = np.zeros(len(points))
            for number in range(2):
                if f"JOINTS_{number}" not in attributes:
                    break
                index = file.read(attributes[f"JOINTS_{number}"], raw=True)
                share = file.read(attributes[f"WEIGHTS_{number}"])
                for column in range(4):
                    part = share[:, column]
                    sums += part
                    used = np.where(part > 0, index[:, column], 0)
                    total += part[:, None, None] * joints[used]
            placed = np.einsum("nij,nj->ni", total, whole) / sums[:, None]
        else:
            placed = whole @ world.T
        result.append(placed[:, :3][corners(file, primitive)])
    return result


def evaluate(file, which, time):
    """Corners of all triangles in the order in which nodes are met."""
    nodes = animate(file, which, time)
    parents = {child: k for k, node in enumerate(nodes) for child in node.get("children", [])}
    worlds = {}

    def world(index):
        chain = []
        while index is not None and index not in worlds:
            chain.append(index)
            index = parents.get(index)
        for index in reversed(chain):
            above = worlds[parents[index]] if index in parents else np.eye(4)
            worlds[index] = above @ matrix(nodes[index])

    roots = file.list("scenes")[file.json.get("scene", 0)]["nodes"]
    stack = list(reversed(roots))
    result = []
    while stack:
        index = stack.pop()
        node = nodes[index]
        stack.extend(reversed(node.get("children", [])))
        if "mesh" not in node:
            continue
        world(index)
        joints = None
        if "skin" in node:
            skin = file.json["skins"][node["skin"]]
            bound = [np.eye(4)] * len(skin["joints"])
            if "inverseBindMatrices" in skin:
                rows = file.read(skin["inverseBindMatrices"])
                bound = [row.reshape(4, 4).T for row in rows]
            for joint in skin["joints"]:
                world(joint)
            joints = np.array([worlds[joint] @ m for joint, m in zip(skin["joints"], bound)])
        result += posed(file, nodes, node, worlds[index], joints)
    return np.concatenate(result) if result else np.zeros((0, 3, 3))


def compare(program, path, file, which, time):
    name = "-" if which is None else str(which)
    run = subprocess.run([program, str(path), name, repr(time)], capture_output=True)
    if run.returncode != 0:
        print(f"{path}: {run.stderr.decode().strip()}")
        return False
    ours = np.frombuffer(run.stdout, "<f4").reshape(-1, 3, 3).astype(np.float64)
    theirs = evaluate(file, which, time)
    title = f"{path.name}, animation {name} at {time:g} s"
    if len(ours) != len(theirs):
        print(f"{title}: {len(ours)} triangles, expected {len(theirs)}")
        return False
    there = ~np.isnan(ours[:, 0, 0])
    size = np.ptp(theirs.reshape(-1, 3), axis=0).max()
    # Mirroring maps swap two corners.
    apart = [
        np.linalg.norm(ours[there][:, order] - theirs[there], axis=2).max(1)
        for order in ([0, 1, 2], [0, 2, 1])
    ]
    worst = np.minimum(*apart).max() / size
    print(f"{title}: {there.sum()} of {len(ours)} triangles, {worst:.2e} of the size apart")
    return worst < TOLERANCE


def main():
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    good = True
    for argument in sys.argv[2:]:
        name, _, rest = argument.partition(":")
        path = pathlib.Path(name)
        file = File(path)
        if rest:
            which, _, times = rest.partition(":")
            moments = [(int(which), float(time)) for time in times.split(",")]
        else:
            moments = [(None, 0.0)]
            if file.list("animations"):
                samplers = file.json["animations"][0]["samplers"]
                end = max(file.read(sampler["input"]).max() for sampler in samplers)
                moments += [(0, round(float(share * end), 3)) for share in (0.15, 0.5, 0.83)]
        for which, time in moments:
            good = compare(sys.argv[1], path, file, which, time) and good
    sys.exit(0 if good else 4)


if __name__ == "__main__":
    main()
