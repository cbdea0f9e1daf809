#!/usr/bin/env python3
"""Draws the pictures of docs/materials.md: a row of spheres for each parameter of a material.

    bench/materials.py [NAME...] [--program zig-out/bin/raylane] [--to docs/materials]

Every row is a glTF file that is written to a temporary folder: spheres, their one material with
another value of one parameter each, and for what lets light through a wall of squares behind. The
program renders it in the light of its studio to NAME.jpg. Needs nothing but Python.
"""

import argparse
import base64
import json
import math
import pathlib
import struct
import subprocess
import sys
import tempfile
import zlib

WIDTH, HEIGHT = 480, 96
RADIUS = 0.46
QUARTERS = (0, 0.25, 0.5, 0.75, 1)
RED = {"baseColorFactor": [0.6, 0.03, 0.03, 1], "metallicFactor": 0, "roughnessFactor": 0.3}
BLACK = {"baseColorFactor": [0.01, 0.01, 0.01, 1], "metallicFactor": 0, "roughnessFactor": 0.2}
GOLD = {"baseColorFactor": [1, 0.77, 0.34, 1], "metallicFactor": 1, "roughnessFactor": 0.3}
CLEAR = {"metallicFactor": 0, "roughnessFactor": 0}
CLOTH = {"baseColorFactor": [0.05, 0.02, 0.1, 1], "metallicFactor": 0, "roughnessFactor": 1}


def place(column, row, columns, rows):
    """Of a vertex of the unit sphere, the same at seam and poles, so that it is closed."""
    down = math.pi * row / rows
    turn = 2 * math.pi * (column % columns / columns - 0.5)
    ring = math.sin(down) if 0 < row < rows else 0
    return (ring * math.sin(turn), math.cos(down), ring * math.cos(turn))


class File:
    """A glTF document under way."""

    def __init__(self):
        self.bytes = bytearray()
        self.extensions = set()
        self.document = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": []}]}
        for name in ("accessors", "bufferViews", "cameras", "images", "materials", "meshes",
                     "nodes", "samplers", "textures"):
            self.document[name] = []

    def add(self, kind, item):
        """The item's index."""
        self.document[kind].append(item)
        return len(self.document[kind]) - 1

    def accessor(self, rows, kind):
        """Of floats in rows, or of indices."""
        flat = [x for row in rows for x in row] if kind != "SCALAR" else rows
        code, component = ("I", 5125) if kind == "SCALAR" else ("f", 5126)
        view = {"buffer": 0, "byteOffset": len(self.bytes), "byteLength": 4 * len(flat)}
        self.bytes += struct.pack(f"<{len(flat)}{code}", *flat)
        accessor = {"bufferView": self.add("bufferViews", view), "componentType": component,
                    "type": kind, "count": len(rows)}
        if kind == "VEC3":
            accessor["min"] = [min(row[i] for row in rows) for i in range(3)]
            accessor["max"] = [max(row[i] for row in rows) for i in range(3)]
        return self.add("accessors", accessor)

    def material(self, base, extensions=None, **others):
        """A material's index."""
        self.extensions |= set(extensions or {})
        extensions = {f"KHR_materials_{name}": value for name, value in (extensions or {}).items()}
        core = {"pbrMetallicRoughness": base} if base else {}
        return self.add("materials", core | {"extensions": extensions} | others)

    def texture(self, width, height, pixel):
        """Of RGBA bytes by column and row, as a PNG inside the file."""
        rows = b"".join(b"\0" + bytes(c for x in range(width) for c in pixel(x, y))
                        for y in range(height))

        def chunk(name, data):
            return struct.pack(">I", len(data)) + name + data + \
                struct.pack(">I", zlib.crc32(name + data))

        png = b"\x89PNG\r\n\x1a\n" + \
            chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 6, 0, 0, 0)) + \
            chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")
        uri = "data:image/png;base64," + base64.b64encode(png).decode()
        image = self.add("images", {"uri": uri})
        sampler = self.add("samplers", {"magFilter": 9728})
        return self.add("textures", {"source": image, "sampler": sampler})

    def node(self, primitive, **others):
        """A mesh of one primitive, in the scene."""
        mesh = self.add("meshes", {"primitives": [primitive]})
        self.document["scenes"][0]["nodes"].append(self.add("nodes", {"mesh": mesh} | others))

    def quad(self, corners, material, repeat=(1, 1)):
        """Counter-clockwise from the lower left."""
        (right, up) = ([corners[i][k] - corners[0][k] for k in range(3)] for i in (1, 3))
        normal = [right[1] * up[2] - right[2] * up[1], right[2] * up[0] - right[0] * up[2],
                  right[0] * up[1] - right[1] * up[0]]
        length = math.hypot(*normal)
        places = [(0, repeat[1]), repeat, (repeat[0], 0), (0, 0)]
        self.node({"attributes": {
            "POSITION": self.accessor(corners, "VEC3"),
            "NORMAL": self.accessor([[x / length for x in normal]] * 4, "VEC3"),
            "TEXCOORD_0": self.accessor(places, "VEC2"),
        }, "indices": self.accessor([0, 1, 2, 0, 2, 3], "SCALAR"), "material": material})

    def sphere(self, columns=96, rows=48):
        """Attributes and indices of a unit sphere, its tangents to the right."""
        normals, tangents, places, indices = [], [], [], []
        for row in range(rows + 1):
            for column in range(columns + 1):
                turn = 2 * math.pi * (column / columns - 0.5)
                normals.append(place(column, row, columns, rows))
                tangents.append((math.cos(turn), 0, -math.sin(turn), 1))
                places.append((column / columns, row / rows))
        for row in range(rows):
            for column in range(columns):
                a = row * (columns + 1) + column
                b = a + columns + 1
                indices += [a, b, b + 1] if row < rows - 1 else []
                indices += [a, b + 1, a + 1] if row > 0 else []
        position = self.accessor(normals, "VEC3")
        return {"attributes": {
            "POSITION": position, "NORMAL": position, "TANGENT": self.accessor(tangents, "VEC4"),
            "TEXCOORD_0": self.accessor(places, "VEC2"),
        }, "indices": self.accessor(indices, "SCALAR")}

    def row(self, materials, scale=RADIUS):
        """Spheres side by side, 1 apart."""
        sphere = self.sphere()
        for column, material in enumerate(materials):
            at = [column - (len(materials) - 1) / 2, 0, 0]
            self.node(sphere | {"material": material}, translation=at, scale=[scale] * 3)

    def wall(self):
        """Coloured squares behind the row."""
        white = (230, 230, 220, 255)
        colors = (white, (20, 90, 160, 255), white, (220, 90, 20, 255))
        squares = self.texture(4, 2, lambda x, y: colors[(x + y) % 4])
        material = self.material({"baseColorTexture": {"index": squares}, "metallicFactor": 0})
        corners = [(-4, -2, -1.2), (4, -2, -1.2), (4, 2, -1.2), (-4, 2, -1.2)]
        self.quad(corners, material, (8, 8))

    def camera(self, tilt_deg=0):
        """Orthographic, 5 wide; from above by an angle."""
        half = 2.5
        turn = math.radians(-tilt_deg) / 2
        far = {"xmag": half, "ymag": half * HEIGHT / WIDTH, "znear": 0.1, "zfar": 20}
        camera = self.add("cameras", {"type": "orthographic", "orthographic": far})
        at = [0, 8 * math.sin(-2 * turn), 8 * math.cos(2 * turn)]
        self.document["scenes"][0]["nodes"].append(self.add("nodes", {
            "camera": camera, "translation": at, "rotation": [math.sin(turn), 0, 0, math.cos(turn)],
        }))

    def write(self, path):
        """The document, its buffer inside."""
        uri = "data:application/octet-stream;base64," + base64.b64encode(self.bytes).decode()
        used = {f"KHR_materials_{name}" for name in self.extensions}
        document = {name: item for name, item in self.document.items() if item}
        document["buffers"] = [{"byteLength": len(self.bytes), "uri": uri}]
        if used:
            document["extensionsUsed"] = sorted(used)
        path.write_text(json.dumps(document))


def waves(file):
    """A texture of normals: round bumps."""
    def pixel(x, y):
        slope = [0.8 * math.sin(2 * math.pi * place / 16) for place in (x, y)]
        length = math.sqrt(1 + slope[0] ** 2 + slope[1] ** 2)
        return [round(127.5 + 127.5 * n / length) for n in (-slope[0], slope[1], 1)] + [255]
    return file.texture(256, 128, pixel)


def stripes(file):
    """A texture of vertical stripes, dark and white."""
    return file.texture(32, 32, lambda x, y: [255 * (x % 2)] * 3 + [255])


def parameter(base, values, name=None, wall=False, **fixed):
    """A row of one parameter, the core's or "extension.parameter"; fixed ones of extensions."""
    def build(file):
        if wall:
            file.wall()
        materials = []
        for value in values:
            extensions = {key: dict(numbers) for key, numbers in fixed.items()}
            core = dict(base)
            if "." in name:
                extension, key = name.split(".")
                extensions.setdefault(extension, {})[key] = value
            else:
                core[name] = value
            materials.append(file.material(core, extensions))
        file.row(materials)
        file.camera()
    return build


def grey(values):
    """Colours."""
    return [[value] * 3 for value in values]


def alpha(file):
    """Blended by less and less."""
    file.wall()
    file.row([file.material(RED | {"baseColorFactor": [0.6, 0.03, 0.03, value]}, alphaMode="BLEND")
              for value in QUARTERS])
    file.camera()


def normal(file):
    """A normal texture, scaled."""
    texture = waves(file)
    file.row([file.material(RED, normalTexture={"index": texture, "scale": value})
              for value in QUARTERS])
    file.camera()


def occlusion(file):
    """Stripes that no light from all around reaches."""
    texture = stripes(file)
    file.row([file.material(RED, occlusionTexture={"index": texture, "strength": value})
              for value in QUARTERS])
    file.camera()


def emissive(file):
    """Strength from none to 4."""
    file.row([file.material(BLACK, {"emissive_strength": {"emissiveStrength": value}},
                            emissiveFactor=[1, 0.4, 0.1]) for value in (0, 0.25, 0.5, 1, 4)])
    file.camera()


def coat_normal(file):
    """A smooth base under a coat with bumps."""
    texture = waves(file)
    file.row([file.material(RED | {"roughnessFactor": 0.8}, {"clearcoat": {
        "clearcoatFactor": 1, "clearcoatNormalTexture": {"index": texture, "scale": value},
    }}) for value in QUARTERS])
    file.camera()


def glossiness(file):
    """Specular-glossiness, by glossiness."""
    file.row([file.material(None, {"pbrSpecularGlossiness": {
        "diffuseFactor": [0.05, 0.2, 0.4, 1], "specularFactor": [0.2, 0.2, 0.2],
        "glossinessFactor": value,
    }}) for value in QUARTERS])
    file.camera()


def unlit(file):
    """The same colours lit and unlit."""
    file.row([file.material({"baseColorFactor": [*color, 1], "metallicFactor": 0}, extensions)
              for color, extensions in (((0.6, 0.03, 0.03), {}), ((0.6, 0.03, 0.03), {"unlit": {}}),
                                        ((0.03, 0.2, 0.6), {}), ((0.03, 0.2, 0.6), {"unlit": {}}),
                                        ((0.8, 0.8, 0.8), {"unlit": {}}))])
    file.camera()


def floor(file, materials):
    """Plates of these side by side, for spheres of 0.25."""
    for column, material in enumerate(materials):
        left, right = column - 2.48, column - 1.52
        file.quad([(left, -0.25, 2), (right, -0.25, 2), (right, -0.25, -2), (left, -0.25, -2)],
                  material)


def reflections(file):
    """Spheres on plates that are rougher and rougher."""
    floor(file, [file.material({"baseColorFactor": [0.02, 0.02, 0.02, 1], "metallicFactor": 0,
                                "roughnessFactor": value}, {"ior": {"ior": 2.5}})
                 for value in (0, 0.125, 0.25, 0.375, 0.5)])
    red, white = (file.material({"baseColorFactor": color, "metallicFactor": 0})
                  for color in ([0.7, 0.1, 0.05, 1], [0.8, 0.8, 0.8, 1]))
    file.row([red, white, red, white, red], 0.25)
    file.camera(25)


def shadows(file):
    """Glass of five colours before a lamp, and what falls on the floor."""
    white = file.material({"metallicFactor": 0, "baseColorFactor": [0.8, 0.8, 0.8, 1]})
    floor(file, [white] * 5)
    file.row([file.material(CLEAR, {
        "transmission": {"transmissionFactor": 1},
        "volume": {"thicknessFactor": 1, "attenuationDistance": 0.5, "attenuationColor": color},
    }) for color in ([1, 1, 1], [0.8, 0.1, 0.1], [0.8, 0.6, 0.1], [0.1, 0.6, 0.2],
                     [0.1, 0.3, 0.8])], 0.25)
    light = {"type": "directional", "intensity": 4}
    file.document["extensions"] = {"KHR_lights_punctual": {"lights": [light]}}
    file.document["extensionsUsed"] = ["KHR_lights_punctual"]
    turn = math.radians(-135) / 2
    file.document["scenes"][0]["nodes"].append(file.add("nodes", {
        "rotation": [math.sin(turn), 0, 0, math.cos(turn)],
        "extensions": {"KHR_lights_punctual": {"light": 0}},
    }))
    file.camera(30)


def nested(file):
    """Glass that holds less and more of a darker liquid, up to more than it can."""
    file.wall()
    sphere = file.sphere()
    glass = file.material(CLEAR, {"transmission": {"transmissionFactor": 1},
                                  "volume": {"thicknessFactor": 1}, "ior": {"ior": 1.5}})
    liquid = file.material(CLEAR, {
        "transmission": {"transmissionFactor": 1}, "ior": {"ior": 1.33},
        "volume": {"thicknessFactor": 1, "attenuationDistance": 0.4,
                   "attenuationColor": [0.6, 0.1, 0.2]}})
    inside = dict(sphere)
    inside["indices"] = file.accessor(inwards(96, 48), "SCALAR")
    inside["attributes"] = {"POSITION": sphere["attributes"]["POSITION"],
                            "NORMAL": file.accessor(inward_normals(96, 48), "VEC3")}
    for column, share in enumerate((0.5, 0.75, 0.9, 1, 1.05)):
        at = [column - 2, 0, 0]
        file.node(sphere | {"material": glass}, translation=at, scale=[RADIUS] * 3)
        file.node(inside | {"material": glass}, translation=at, scale=[0.8 * RADIUS] * 3)
        file.node(sphere | {"material": liquid}, translation=at,
                  scale=[0.8 * share * RADIUS] * 3)
    file.camera()


def inwards(columns, rows):
    """Indices of the sphere seen from inside."""
    indices = []
    for row in range(rows):
        for column in range(columns):
            a = row * (columns + 1) + column
            b = a + columns + 1
            indices += [a, b + 1, b] if row < rows - 1 else []
            indices += [a, a + 1, b + 1] if row > 0 else []
    return indices


def inward_normals(columns, rows):
    """Those that belong to `inwards`."""
    return [tuple(-x for x in place(column, row, columns, rows))
            for row in range(rows + 1) for column in range(columns + 1)]


def lamps(file):
    """Emissive spheres on a floor that nothing else lights."""
    white = file.material({"metallicFactor": 0, "baseColorFactor": [0.8, 0.8, 0.8, 1]})
    floor(file, [white] * 5)
    file.row([file.material(BLACK, {"emissive_strength": {"emissiveStrength": 4}},
                            emissiveFactor=color)
              for color in ([1, 1, 1], [1, 0.1, 0.1], [1, 0.6, 0.1], [0.1, 0.8, 0.2],
                            [0.1, 0.3, 1])], 0.25)
    file.camera(30)


def strokes(file):
    """Points, lines, a strip, and both without normals."""
    knots = [(t / 140 * math.sin(t / 4), t / 140 * math.cos(t / 4), 0.2 - t / 200)
             for t in range(60)]
    position = file.accessor(knots, "VEC3")
    normals = file.accessor([(0, 0.6, 0.8)] * len(knots), "VEC3")
    material = file.material(RED)
    for column, (mode, lit) in enumerate(((0, True), (1, True), (3, True), (0, False),
                                          (3, False))):
        attributes = {"POSITION": position} | ({"NORMAL": normals} if lit else {})
        file.node({"attributes": attributes, "mode": mode, "material": material},
                  translation=[column - 2, 0, 0])
    file.camera()


PANE = {"transmission": {"transmissionFactor": 1}}
GLASS = PANE | {"volume": {"thicknessFactor": 1}}
FILM = {"iridescenceFactor": 1, "iridescenceThicknessMaximum": 400}
MILK = PANE | {"volume": {"thicknessFactor": 1, "attenuationDistance": 0.2,
                          "attenuationColor": [0.3, 0.3, 0.3]}}
ROWS = {
    "metallic": parameter(GOLD, QUARTERS, "metallicFactor"),
    "roughness": parameter(RED, QUARTERS, "roughnessFactor"),
    "roughness-metal": parameter(GOLD, QUARTERS, "roughnessFactor"),
    "alpha": alpha,
    "normal": normal,
    "occlusion": occlusion,
    "emissive": emissive,
    "unlit": unlit,
    "ior": parameter(BLACK, (1, 1.25, 1.5, 2, 3), "ior.ior"),
    "specular": parameter(BLACK, QUARTERS, "specular.specularFactor"),
    "specular-color": parameter(BLACK, [[1, 1 - v, 1 - v] for v in QUARTERS],
                                "specular.specularColorFactor", ior={"ior": 2}),
    "clearcoat": parameter(RED | {"roughnessFactor": 0.8}, QUARTERS, "clearcoat.clearcoatFactor"),
    "clearcoat-roughness": parameter(RED | {"roughnessFactor": 0.8}, QUARTERS,
                                     "clearcoat.clearcoatRoughnessFactor",
                                     clearcoat={"clearcoatFactor": 1}),
    "clearcoat-normal": coat_normal,
    "sheen": parameter(CLOTH, grey(QUARTERS), "sheen.sheenColorFactor",
                       sheen={"sheenRoughnessFactor": 0.4}),
    "sheen-roughness": parameter(CLOTH, QUARTERS, "sheen.sheenRoughnessFactor",
                                 sheen={"sheenColorFactor": [1, 1, 1]}),
    "transmission": parameter(RED | {"roughnessFactor": 0}, QUARTERS,
                              "transmission.transmissionFactor", wall=True),
    "transmission-roughness": parameter(CLEAR, QUARTERS, "roughnessFactor", wall=True, **PANE),
    "volume-roughness": parameter(CLEAR, QUARTERS, "roughnessFactor", wall=True, **GLASS),
    "volume-ior": parameter(CLEAR, (1, 1.1, 1.33, 1.5, 2), "ior.ior", wall=True, **GLASS),
    "attenuation": parameter(CLEAR, (4, 2, 1, 0.5, 0.25), "volume.attenuationDistance", wall=True,
                             **PANE, volume={"thicknessFactor": 1,
                                             "attenuationColor": [0.2, 0.7, 0.4]}),
    "dispersion": parameter(CLEAR, (0, 0.5, 1, 2, 5), "dispersion.dispersion", wall=True, **GLASS,
                            ior={"ior": 1.6}),
    "volume-scatter": parameter(CLEAR, grey((0, 0.25, 0.5, 0.75, 0.95)),
                                "volume_scatter.multiscatterColorFactor", wall=True, **MILK),
    "scatter-anisotropy": parameter(CLEAR, (-0.8, -0.4, 0, 0.4, 0.8),
                                    "volume_scatter.scatterAnisotropy", wall=True, **MILK,
                                    volume_scatter={"multiscatterColorFactor": [0.9, 0.9, 0.9]}),
    "iridescence": parameter(BLACK, QUARTERS, "iridescence.iridescenceFactor",
                             iridescence={"iridescenceThicknessMaximum": 400}, ior={"ior": 2}),
    "iridescence-ior": parameter(BLACK, (1, 1.3, 1.5, 1.8, 2.2), "iridescence.iridescenceIor",
                                 iridescence=FILM, ior={"ior": 2}),
    "iridescence-thickness": parameter(BLACK, (0, 200, 400, 600, 800),
                                       "iridescence.iridescenceThicknessMaximum",
                                       iridescence=FILM, ior={"ior": 2}),
    "anisotropy": parameter(GOLD, QUARTERS, "anisotropy.anisotropyStrength"),
    "anisotropy-rotation": parameter(GOLD, [math.pi / 2 * v for v in QUARTERS],
                                     "anisotropy.anisotropyRotation",
                                     anisotropy={"anisotropyStrength": 0.9}),
    "diffuse-transmission": parameter({"metallicFactor": 0, "roughnessFactor": 0.6}, QUARTERS,
                                      "diffuse_transmission.diffuseTransmissionFactor",
                                      diffuse_transmission={
                                          "diffuseTransmissionColorFactor": [0.2, 0.8, 0.1]}),
    "glossiness": glossiness,
    "reflections": reflections,
    "shadows": shadows,
    "nested": nested,
    "lamps": lamps,
    "strokes": strokes,
}
OPTIONS = {"occlusion": ["--env", "none"],
           "lamps": ["--env", "none", "--ambient", "0"], "strokes": ["--point-size", "2"]}


def main():
    """Exit code."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("names", nargs="*", metavar="NAME")
    parser.add_argument("--program", default="zig-out/bin/raylane")
    parser.add_argument("--to", default="docs/materials", type=pathlib.Path)
    parser.add_argument("--keep", type=pathlib.Path, help="a folder for the glTF files")
    arguments = parser.parse_args()
    unknown = set(arguments.names) - set(ROWS)
    if unknown:
        parser.error(f"no such row: {', '.join(sorted(unknown))}")
    arguments.to.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as temporary:
        folder = arguments.keep or pathlib.Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        for name in arguments.names or ROWS:
            file = File()
            ROWS[name](file)
            file.write(folder / f"{name}.gltf")
            command = [arguments.program, folder / f"{name}.gltf", "-r", f"{WIDTH}x{HEIGHT}",
                       "--spp", "16", "-o", arguments.to / f"{name}.jpg", "--stats", "none",
                       "--background", "#555", "--jpeg-quality", "85", *OPTIONS.get(name, [])]
            done = subprocess.run(command, check=False)
            if done.returncode != 0:
                return done.returncode
    return 0


if __name__ == "__main__":
    sys.exit(main())
