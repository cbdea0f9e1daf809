#!/usr/bin/env python3
"""GLB files at the far end of what files may ask for: what do they cost, and what is said of them?

    bench/extremes.py layers 1000000 --alpha 1e-6 -o layers.glb    blended layers before a card
    bench/extremes.py lights 1000000 -o lights.glb                 point lights above a floor
    bench/extremes.py shells 10000 -o shells.glb                   glass spheres in one another
    bench/extremes.py far 10000 -o far.glb                         a ball, and a corner so far away
    bench/extremes.py bits 20000 -o bits.glb                       triangles of random bits
    bench/extremes.py table PROGRAM [--scale 1]                    all of them in small pictures

The table has milliseconds of tracing a pixel at 16x16, one sample, by each integrator, and the
warnings. Standard library only.
"""

import argparse
import json
import math
import pathlib
import random
import struct
import subprocess
import tempfile


class Glb:
    """Collects accessors of positions and indices."""

    def __init__(self):
        self.data = bytearray()
        self.root = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": []}],
                     "nodes": [], "meshes": [], "materials": [], "accessors": [],
                     "bufferViews": []}

    def accessor(self, packed, count, kind, component, bounds=None):
        self.root["bufferViews"].append({"buffer": 0, "byteOffset": len(self.data),
                                         "byteLength": len(packed)})
        self.data += packed
        accessor = {"bufferView": len(self.root["bufferViews"]) - 1, "componentType": component,
                    "count": count, "type": kind}
        if bounds:
            accessor["min"], accessor["max"] = bounds
        self.root["accessors"].append(accessor)
        return len(self.root["accessors"]) - 1

    def mesh(self, positions, triangles, material):
        packed = struct.pack("<%df" % (3 * len(positions)), *(x for p in positions for x in p))
        bounds = [[float(f(p[axis] for p in positions)) for axis in range(3)] for f in (min, max)]
        place = self.accessor(packed, len(positions), "VEC3", 5126, bounds)
        packed = struct.pack("<%dI" % (3 * len(triangles)), *(i for t in triangles for i in t))
        indices = self.accessor(packed, 3 * len(triangles), "SCALAR", 5125)
        self.root["materials"].append(material)
        self.root["meshes"].append({"primitives": [{
            "attributes": {"POSITION": place}, "indices": indices,
            "material": len(self.root["materials"]) - 1}]})
        self.node({"mesh": len(self.root["meshes"]) - 1})

    def node(self, node):
        self.root["nodes"].append(node)
        self.root["scenes"][0]["nodes"].append(len(self.root["nodes"]) - 1)

    def write(self, name):
        if self.data:
            self.root["buffers"] = [{"byteLength": len(self.data)}]
        root = {key: value for key, value in self.root.items() if value != []}
        text = json.dumps(root, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        chunks = struct.pack("<I4s", len(text), b"JSON") + text
        chunks += struct.pack("<I4s", len(self.data), b"BIN\0") + self.data
        pathlib.Path(name).write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)


def square(z, half=1.0):
    return [(-half, -half, z), (half, -half, z), (half, half, z), (-half, half, z)]


def matte(color):
    return {"doubleSided": True, "pbrMetallicRoughness": {
        "baseColorFactor": [*color, 1], "metallicFactor": 0, "roughnessFactor": 1}}


def ball(radius, rows, center=(0, 0, 0)):
    positions = []
    for row in range(rows + 1):
        polar = math.pi * row / rows
        for column in range(2 * rows):
            turn = math.pi * column / rows
            positions.append((center[0] + radius * math.sin(polar) * math.cos(turn),
                              center[1] + radius * math.cos(polar),
                              center[2] + radius * math.sin(polar) * math.sin(turn)))
    triangles = []
    for row in range(rows):
        for column in range(2 * rows):
            a, b = (2 * rows * row + c for c in (column, (column + 1) % (2 * rows)))
            c, d = a + 2 * rows, b + 2 * rows
            if row > 0:
                triangles.append((a, b, c))
            if row < rows - 1:
                triangles.append((b, d, c))
    return positions, triangles


def joined(parts):
    positions, triangles = [], []
    for more, faces in parts:
        first = len(positions)
        positions += more
        triangles += [tuple(first + i for i in face) for face in faces]
    return positions, triangles


def layers(glb, count, alpha):
    faces = [(0, 1, 2), (0, 2, 3)]
    stack = joined((square(index / count), faces) for index in range(count))
    pane = matte((1, 0.2, 0.1))
    pane["pbrMetallicRoughness"]["baseColorFactor"][3] = alpha
    pane["alphaMode"] = "BLEND"
    glb.mesh(*stack, pane)
    glb.mesh(square(-0.5), faces, matte((0.1, 0.8, 0.2)))
    camera(glb, (0, 0, 4))


def lights(glb, count, _):
    dice = random.Random(1)
    glb.mesh([(-10, 0, 10), (10, 0, 10), (10, 0, -10), (-10, 0, -10)], [(0, 1, 2), (0, 2, 3)],
             matte((0.8, 0.8, 0.8)))
    glb.mesh(*ball(1, 24, (0, 1.5, 0)), matte((0.8, 0.2, 0.1)))
    glb.root["extensionsUsed"] = ["KHR_lights_punctual"]
    glb.root["extensions"] = {"KHR_lights_punctual": {"lights": [
        {"type": "point", "intensity": 200 / count}]}}
    for _ in range(count):
        place = [dice.uniform(-9, 9), dice.uniform(1, 6), dice.uniform(-9, 9)]
        glb.node({"translation": [round(x, 3) for x in place],
                  "extensions": {"KHR_lights_punctual": {"light": 0}}})
    camera(glb, (0, 3, 12))


def shells(glb, count, _):
    parts = joined(ball(1 + index / count, 6) for index in range(count))
    glass = matte((1, 1, 1))
    glass["pbrMetallicRoughness"]["roughnessFactor"] = 0
    del glass["doubleSided"]
    glass["extensions"] = {"KHR_materials_transmission": {"transmissionFactor": 1},
                           "KHR_materials_volume": {"thicknessFactor": 1}}
    glb.root["extensionsUsed"] = list(glass["extensions"])
    glb.mesh(*parts, glass)
    camera(glb, (0, 0, 6))


def far(glb, distance, _):
    positions, triangles = ball(0.15, 128)
    first = len(positions)
    positions += [(distance, 0, 0), (distance, 0.1, 0), (0.2, 0, 0)]
    glb.mesh(positions, triangles + [(first, first + 1, first + 2)], matte((0.8, 0.8, 0.8)))
    camera(glb, (0, 0, 0.6))


def bits(glb, count, _):
    dice = random.Random(1)
    positions = []
    while len(positions) < 3 * count:
        place = struct.unpack("<3f", dice.randbytes(12))
        # What is farther away than 2^40 m is left out.
        if all(abs(x) < 2.0**40 for x in place):
            positions.append(place)
    glb.mesh(positions, [(3 * i, 3 * i + 1, 3 * i + 2) for i in range(count)],
             matte((0.8, 0.8, 0.8)))
    glb.mesh(*ball(1, 24), matte((0.8, 0.2, 0.1)))
    camera(glb, (0, 0, 4))


def camera(glb, place):
    glb.root["cameras"] = [{"type": "perspective", "perspective": {
        "yfov": 0.7, "aspectRatio": 1, "znear": 0.01}}]
    glb.node({"camera": 0, "translation": list(place)})


KINDS = {"layers": layers, "lights": lights, "shells": shells, "far": far, "bits": bits}

TABLE = [("layers", 16, 0.5), ("layers", 256, 1e-6), ("layers", 1_000_000, 1e-6),
         ("layers", 1_000_000, 0.1), ("lights", 16, 0), ("lights", 1024, 0),
         ("lights", 1_000_000, 0), ("shells", 4, 0), ("shells", 10_000, 0), ("far", 1, 0),
         ("far", 10_000, 0), ("bits", 20, 0), ("bits", 20_000, 0)]


def make(kind, count, alpha, name):
    glb = Glb()
    KINDS[kind](glb, count, alpha)
    glb.write(name)


def table(program, scale):
    print("| file | whitted, ms a pixel | lights | path | warnings |\n|---|---:|---:|---:|---|")
    with tempfile.TemporaryDirectory() as folder:
        for kind, count, alpha in TABLE:
            count = max(1, int(count * scale)) if count > 20_000 else count
            name = f"{folder}/{kind}.glb"
            make(kind, count, alpha, name)
            cells, warnings = [], []
            for integrator in ("whitted", "lights", "path"):
                done = subprocess.run(
                    [program, name, "-r", "16x16", "--spp", "1", "--integrator", integrator,
                     "--stats", "json", "-o", f"{folder}/out.png"], capture_output=True, text=True)
                if done.returncode != 0:
                    cells.append(done.stderr.strip().splitlines()[-1].split(": ", 2)[-1])
                    continue
                report = json.loads(done.stdout)
                cells.append("%.3f" % (report["time_ms"]["trace"] / 256))
                warnings += [w for w in report.get("warnings", []) if w not in warnings]
            label = f"{kind} {count}" + (f", alpha {alpha:g}" if alpha else "")
            print("| " + " | ".join([label, *cells, "; ".join(warnings)]) + " |", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("kind", choices=[*KINDS, "table"])
    parser.add_argument("count", help="how many; for the table, the program")
    parser.add_argument("--alpha", type=float, default=1e-6)
    parser.add_argument("--scale", type=float, default=1, help="of a million")
    parser.add_argument("-o", "--output", default="out.glb")
    options = parser.parse_args()
    if options.kind == "table":
        table(options.count, options.scale)
    else:
        make(options.kind, int(options.count), options.alpha, options.output)


if __name__ == "__main__":
    main()
