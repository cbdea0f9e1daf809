#!/usr/bin/env python3
"""A forest as a .glb: few trees, each of which stands in many places.

In: how many triangles are to be different, and how many are to be drawn. Out: the file, and another
one of the same forest whose places are accessors (EXT_mesh_gpu_instancing) instead of nodes. The
same numbers give the same bytes.

    bench/forest.py /tmp/forest.glb
    raylane --camera 0 --stats json -o forest.png /tmp/forest.glb
"""

import argparse
import json
import math
import struct

try:
    import numpy
except ImportError:
    raise SystemExit("forest.py: numpy is not installed")

BRANCH_SIDES = 5


def pieces(count, rng):
    """Positions, normals and indices of a tree of `count` triangles: a trunk, leaves about it."""
    trunk_rings = max(2, count // 400)
    angles = numpy.arange(BRANCH_SIDES) * (2 * math.pi / BRANCH_SIDES)
    heights = numpy.linspace(0, 3.2, trunk_rings + 1)
    radii = 0.22 * (1 - heights / 4)
    ring = numpy.stack([numpy.cos(angles), numpy.zeros_like(angles), numpy.sin(angles)], axis=1)
    trunk = (ring[None] * radii[:, None, None]).reshape(-1, 3)
    trunk[:, 1] = numpy.repeat(heights, BRANCH_SIDES)
    below = (numpy.arange(trunk_rings)[:, None] * BRANCH_SIDES + numpy.arange(BRANCH_SIDES)).ravel()
    beside = (numpy.arange(trunk_rings)[:, None] * BRANCH_SIDES
              + (numpy.arange(BRANCH_SIDES) + 1) % BRANCH_SIDES).ravel()
    bark = numpy.concatenate([
        numpy.stack([below, below + BRANCH_SIDES, beside], axis=1),
        numpy.stack([beside, below + BRANCH_SIDES, beside + BRANCH_SIDES], axis=1),
    ])
    leaf_count = max(1, (count - len(bark)) // 2)
    # In the shells of a few round crowns.
    crowns = rng.normal(size=(12, 3)) * [0.8, 0.7, 0.8] + [0, 3.4, 0]
    directions = rng.normal(size=(leaf_count, 3))
    directions /= numpy.linalg.norm(directions, axis=1, keepdims=True)
    reach = 0.9 * rng.random((leaf_count, 1)) ** (1 / 3)
    centers = crowns[rng.integers(0, len(crowns), leaf_count)] + directions * reach
    across = numpy.cross(directions, rng.normal(size=(leaf_count, 3)))
    across /= numpy.linalg.norm(across, axis=1, keepdims=True)
    along = numpy.cross(directions, across)
    size = 0.9 / math.sqrt(leaf_count) + 0.012
    corners = numpy.stack([
        centers - size * across, centers - size * along, centers + size * across,
        centers + 1.6 * size * along,
    ], axis=1).reshape(-1, 3)
    first = 4 * numpy.arange(leaf_count)[:, None]
    leaves = (first[:, :, None] + numpy.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3)
    return [
        (trunk, numpy.tile(ring, (trunk_rings + 1, 1)), bark),
        (corners, numpy.repeat(directions, 4, axis=0), leaves),
    ]


class Buffer:
    """The binary chunk, and the accessors that look into it."""

    def __init__(self):
        self.bytes = bytearray()
        self.views = []
        self.accessors = []

    def add(self, array, kind, bounds=False):
        flat = numpy.ascontiguousarray(array)
        component = {"float32": 5126, "uint32": 5125, "int16": 5122}[flat.dtype.name]
        self.views.append({"buffer": 0, "byteOffset": len(self.bytes), "byteLength": flat.nbytes})
        self.bytes += flat.tobytes()
        self.bytes += bytes(-len(self.bytes) % 4)
        width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}[kind]
        accessor = {"bufferView": len(self.views) - 1, "componentType": component, "type": kind,
                    "count": flat.size // width}
        if component == 5122:
            accessor["normalized"] = True
        if bounds:
            accessor["min"] = [float(x) for x in flat.reshape(-1, width).min(axis=0)]
            accessor["max"] = [float(x) for x in flat.reshape(-1, width).max(axis=0)]
        self.accessors.append(accessor)
        return len(self.accessors) - 1


def primitive(buffer, part, material):
    positions, normals, triangles = part
    return {
        "attributes": {
            "POSITION": buffer.add(positions.astype("float32"), "VEC3", bounds=True),
            "NORMAL": buffer.add(normals.astype("float32"), "VEC3"),
        },
        "indices": buffer.add(triangles.astype("uint32"), "SCALAR"),
        "material": material,
    }


def places(count, tree_count, rng):
    """By tree: translations, rotations and scales of those that stand on a jittered grid."""
    side = math.ceil(math.sqrt(count))
    cells = numpy.arange(side * side)[:count]
    spots = numpy.stack([cells % side, cells // side], axis=1) + 0.7 * rng.random((count, 2))
    spots = (spots - side / 2) * 3.0
    ground = 0.6 * numpy.sin(spots[:, 0] * 0.06) * numpy.cos(spots[:, 1] * 0.05)
    translations = numpy.stack([spots[:, 0], ground - 0.05, spots[:, 1]], axis=1)
    half = rng.random(count) * math.pi
    rotations = numpy.stack([0 * half, numpy.sin(half), 0 * half, numpy.cos(half)], axis=1)
    scales = (0.7 + 0.6 * rng.random((count, 1))) * numpy.ones((1, 3))
    # Some mirrored, so that they look like others still.
    scales[rng.random(count) < 0.3, 0] *= -1
    kinds = rng.integers(0, tree_count, count)
    return [(translations[kinds == k], rotations[kinds == k], scales[kinds == k])
            for k in range(tree_count)], side * 3.0


def ground_mesh(size):
    """A grid over the same waves that the trees stand on."""
    side = 64
    line = numpy.linspace(-0.6, 0.6, side + 1) * size
    x, z = numpy.meshgrid(line, line)
    y = 0.6 * numpy.sin(x * 0.06) * numpy.cos(z * 0.05)
    positions = numpy.stack([x, y, z], axis=2).reshape(-1, 3)
    at = (numpy.arange(side)[:, None] * (side + 1) + numpy.arange(side)).ravel()[:, None]
    triangles = (at[:, :, None] + numpy.array([
        [0, side + 1, 1], [1, side + 1, side + 2]])).reshape(-1, 3)
    return positions, numpy.tile([0.0, 1.0, 0.0], (len(positions), 1)), triangles


MATERIALS = [
    ("bark", [0.23, 0.15, 0.09], False),
    ("leaf", [0.16, 0.36, 0.08], True),
    ("ground", [0.22, 0.25, 0.12], False),
    ("yellow leaf", [0.46, 0.38, 0.07], True),
]


def forest(arguments, instanced):
    rng = numpy.random.default_rng(arguments.seed)
    tree_count = arguments.trees
    each = arguments.unique // tree_count
    count = max(tree_count, round(arguments.drawn / each))
    buffer = Buffer()
    meshes = []
    for tree in range(tree_count):
        bark, leaves = pieces(each, rng)
        leaf = 3 if tree % 5 == 4 else 1
        meshes.append({"name": f"tree {tree}", "primitives": [
            primitive(buffer, bark, 0), primitive(buffer, leaves, leaf)]})
    groups, size = places(count, tree_count, rng)
    meshes.append({"name": "ground", "primitives": [primitive(buffer, ground_mesh(size), 2)]})
    nodes = [{"mesh": tree_count}]
    for tree, (translations, rotations, scales) in enumerate(groups):
        if instanced:
            nodes.append({"mesh": tree, "extensions": {"EXT_mesh_gpu_instancing": {"attributes": {
                "TRANSLATION": buffer.add(translations.astype("float32"), "VEC3"),
                "ROTATION": buffer.add(rotations.astype("float32"), "VEC4"),
                "SCALE": buffer.add(scales.astype("float32"), "VEC3"),
            }}}})
            continue
        for t, r, s in zip(translations, rotations, scales):
            nodes.append({"mesh": tree, "translation": [float(numpy.float32(v)) for v in t],
                          "rotation": [float(numpy.float32(v)) for v in r],
                          "scale": [float(numpy.float32(v)) for v in s]})
    sun = [-0.42, 0.16, 0.08, 0.889]
    camera_height = 0.09 * size
    nodes += [
        {"camera": 0, "translation": [0, camera_height, 0.47 * size],
         "rotation": [-0.19, 0, 0, 0.982]},
        {"rotation": sun, "extensions": {"KHR_lights_punctual": {"light": 0}}},
    ]
    document = {
        "asset": {"version": "2.0", "generator": "bench/forest.py"},
        "scene": 0,
        "scenes": [{"nodes": list(range(len(nodes)))}],
        "nodes": nodes,
        "meshes": meshes,
        "materials": [{"name": name, "doubleSided": double, "pbrMetallicRoughness": {
            "baseColorFactor": [*color, 1], "metallicFactor": 0, "roughnessFactor": 0.8}}
            for name, color, double in MATERIALS],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 0.7, "znear": 0.1}}],
        "accessors": buffer.accessors,
        "bufferViews": buffer.views,
        "buffers": [{"byteLength": len(buffer.bytes)}],
        "extensions": {"KHR_lights_punctual": {"lights": [
            {"type": "directional", "intensity": 4, "color": [1, 0.95, 0.85]}]}},
        "extensionsUsed": ["KHR_lights_punctual"] + ["EXT_mesh_gpu_instancing"] * instanced,
    }
    triangles = sum(buffer.accessors[p["indices"]]["count"] // 3
                    for m in meshes for p in m["primitives"])
    return document, bytes(buffer.bytes), triangles, count


def write(path, document, binary):
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    with open(path, "wb") as file:
        file.write(struct.pack("<III", 0x46546C67, 2, 28 + len(text) + len(binary)))
        file.write(struct.pack("<II", len(text), 0x4E4F534A) + text)
        file.write(struct.pack("<II", len(binary), 0x004E4942) + binary)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("output", help="the .glb; the instanced one has '-instanced' in its name")
    parser.add_argument("--unique", type=int, default=1_000_000, help="different triangles")
    parser.add_argument("--drawn", type=int, default=9_000_000, help="triangles drawn")
    parser.add_argument("--trees", type=int, default=100, help="different trees")
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    for instanced in (False, True):
        path = arguments.output
        if instanced:
            stem, dot, suffix = path.rpartition(".")
            path = f"{stem}-instanced{dot}{suffix}"
        document, binary, unique, count = forest(arguments, instanced)
        write(path, document, binary)
        print(f"{path}: {unique} different triangles, {count} trees")


if __name__ == "__main__":
    main()
