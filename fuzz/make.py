#!/usr/bin/env python3
"""Writes fuzz/corpus/: what each fuzz target begins with, a folder for each.

    fuzz/make.py

Tiny files that use as much of a format as fits. Pictures and streams of codecs are those of
tests/images and tests/meshes, which the targets read from there, or which are wrapped here.
`beside` is what the files of the corpus may name.
"""
import base64
import gzip
import json
import pathlib
import shutil
import struct

TOP = pathlib.Path(__file__).parent
CORPUS = TOP / "corpus"
IMAGES = TOP.parent / "tests" / "images"
MESHES = TOP.parent / "tests" / "meshes"

FLOAT, UBYTE, USHORT, UINT, BYTE, SHORT = 5126, 5121, 5123, 5125, 5120, 5122
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
FORMATS = {FLOAT: "f", UBYTE: "B", USHORT: "H", UINT: "I", BYTE: "b", SHORT: "h"}


class Document:
    """A glTF document under way: every accessor has a buffer view of its own."""

    def __init__(self):
        self.data = b""
        self.json = {"asset": {"version": "2.0"}, "scene": 0, "accessors": [], "bufferViews": [],
                     "buffers": [{"byteLength": 0}]}

    def view(self, data, **more):
        self.data += b"\0" * (-len(self.data) % 4)
        self.json["bufferViews"].append(
            {"buffer": 0, "byteOffset": len(self.data), "byteLength": len(data)} | more)
        self.data += data
        return len(self.json["bufferViews"]) - 1

    def accessor(self, component, kind, numbers, **more):
        data = struct.pack(f"<{len(numbers)}{FORMATS[component]}", *numbers)
        view = self.view(data)
        self.json["accessors"].append(
            {"bufferView": view, "componentType": component, "type": kind,
             "count": len(numbers) // WIDTHS[kind]} | more)
        return len(self.json["accessors"]) - 1

    def sparse(self, component, kind, count, indices, numbers, base=None):
        at = self.view(struct.pack(f"<{len(indices)}H", *indices))
        values = self.view(struct.pack(f"<{len(numbers)}{FORMATS[component]}", *numbers))
        accessor = {"componentType": component, "type": kind, "count": count,
                    "sparse": {"count": len(indices),
                               "indices": {"bufferView": at, "componentType": USHORT},
                               "values": {"bufferView": values}}}
        if base is not None:
            accessor["bufferView"] = self.json["accessors"][base]["bufferView"]
        self.json["accessors"].append(accessor)
        return len(self.json["accessors"]) - 1

    def write(self, name):
        self.json["buffers"][0]["byteLength"] = len(self.data)
        text = json.dumps(self.json, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        data = self.data + b"\0" * (-len(self.data) % 4)
        body = (struct.pack("<I4s", len(text), b"JSON") + text +
                struct.pack("<I4s", len(data), b"BIN\0") + data)
        put(f"glb/{name}.glb", struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body)
        uri = "data:application/octet-stream;base64," + base64.b64encode(self.data).decode()
        self.json["buffers"][0]["uri"] = uri
        put(f"gltf/{name}.gltf", json.dumps(self.json, indent=0).encode())


SQUARE = [0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0]
CORNERS = [0, 1, 2, 0, 2, 3]


def square(document, **more):
    return {"attributes": {"POSITION": document.accessor(FLOAT, "VEC3", SQUARE)},
            "indices": document.accessor(USHORT, "SCALAR", CORNERS)} | more


def plain():
    document = Document()
    base = document.accessor(FLOAT, "VEC3", SQUARE)
    moved = document.sparse(FLOAT, "VEC3", 4, [1, 3], [2, 0, 0, 0, 2, 0], base)
    zeros = document.sparse(FLOAT, "VEC3", 4, [0, 2], [0, 0, 1, 0, 0, 1])
    document.json |= {
        "scenes": [{"nodes": [0, 1]}],
        "nodes": [{"mesh": 0, "rotation": [0, 0.6, 0, 0.8], "scale": [1, 2, 1], "children": [2]},
                  {"camera": 0, "translation": [0.5, 0.5, 4]},
                  {"mesh": 1, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 1, 2, 3, 1]}],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 0.8, "znear": 0.1}},
                    {"type": "orthographic",
                     "orthographic": {"xmag": 1, "ymag": 1, "znear": 0, "zfar": 9}}],
        "meshes": [{"primitives": [
            {"attributes": {"POSITION": moved, "NORMAL": zeros},
             "indices": document.accessor(UBYTE, "SCALAR", CORNERS)},
            {"attributes": {"POSITION": base}, "mode": 1}, {"attributes": {"POSITION": base},
                                                            "mode": 0}]},
            {"primitives": [{"attributes": {"POSITION": base}, "mode": mode,
                             "indices": document.accessor(UINT, "SCALAR", [0, 1, 3, 2])}
                            for mode in (2, 3, 5, 6)]}]}
    document.write("plain")


EXTENSIONS = {
    "KHR_materials_anisotropy": {"anisotropyStrength": 0.5, "anisotropyRotation": 1},
    "KHR_materials_clearcoat": {"clearcoatFactor": 0.5, "clearcoatTexture": {"index": 0}},
    "KHR_materials_dispersion": {"dispersion": 0.2},
    "KHR_materials_emissive_strength": {"emissiveStrength": 3},
    "KHR_materials_ior": {"ior": 1.4},
    "KHR_materials_iridescence": {"iridescenceFactor": 1, "iridescenceThicknessMaximum": 300},
    "KHR_materials_sheen": {"sheenColorFactor": [0.5, 0.2, 0], "sheenRoughnessFactor": 0.3},
    "KHR_materials_specular": {"specularFactor": 0.5, "specularColorFactor": [1, 0.5, 0]},
    "KHR_materials_transmission": {"transmissionFactor": 0.9},
    "KHR_materials_volume": {"thicknessFactor": 0.1, "attenuationDistance": 2,
                             "attenuationColor": [0.5, 0.9, 0.5]},
    "KHR_materials_volume_scatter": {"multiscatterColor": [0.5, 0.2, 0.1]},
    "KHR_materials_diffuse_transmission": {"diffuseTransmissionFactor": 0.5},
}


def materials():
    document = Document()
    picture = document.view((IMAGES / "gray-4.png").read_bytes())
    places = document.accessor(FLOAT, "VEC2", [0, 0, 1, 0, 1, 1, 0, 1])
    colors = document.accessor(UBYTE, "VEC4", [255, 0, 0, 255] * 4, normalized=True)
    tangents = document.accessor(FLOAT, "VEC4", [1, 0, 0, 1] * 4)
    normals = document.accessor(FLOAT, "VEC3", [0, 0, 1] * 4)
    first = square(document, material=0)
    first["attributes"] |= {"TEXCOORD_0": places, "COLOR_0": colors, "NORMAL": normals,
                            "TANGENT": tangents}
    first["extensions"] = {"KHR_materials_variants": {
        "mappings": [{"material": 1, "variants": [0, 1]}]}}
    moved = {"KHR_texture_transform": {"offset": [0.5, 0], "rotation": 1, "scale": [2, 2],
                                       "texCoord": 0}}
    used = sorted([*EXTENSIONS, "KHR_materials_variants", "KHR_lights_punctual",
                   "KHR_texture_transform", "KHR_materials_unlit", "EXT_lights_image_based",
                   "KHR_materials_pbrSpecularGlossiness", "KHR_node_visibility"])
    document.json |= {
        "extensionsUsed": used,
        "extensions": {
            "KHR_materials_variants": {"variants": [{"name": "a"}, {"name": "b"}]},
            "KHR_lights_punctual": {"lights": [
                {"type": "point", "intensity": 30, "range": 9}, {"type": "directional"},
                {"type": "spot", "color": [1, 0.5, 0], "spot": {"outerConeAngle": 0.7}}]}},
        "scenes": [{"nodes": [0, 1, 2, 3]}],
        "nodes": [{"mesh": 0}] + [
            {"extensions": {"KHR_lights_punctual": {"light": index},
                            "KHR_node_visibility": {"visible": True}},
             "translation": [0, 0, 2]} for index in range(3)],
        "meshes": [{"primitives": [first, square(document, material=2)]}],
        "images": [{"bufferView": picture, "mimeType": "image/png"}, {"uri": "rgb.png"},
                   {"uri": "data:image/png;base64," + base64.b64encode(
                       (IMAGES / "gray-1.png").read_bytes()).decode()}],
        "samplers": [{"magFilter": 9728, "minFilter": 9987, "wrapS": 33071, "wrapT": 33648}],
        "textures": [{"source": 0, "sampler": 0}, {"source": 1}, {"source": 2}],
        "materials": [
            {"pbrMetallicRoughness": {
                "baseColorFactor": [1, 0.5, 0.2, 0.5], "metallicFactor": 0.5,
                "roughnessFactor": 0.3, "baseColorTexture": {"index": 0, "extensions": moved},
                "metallicRoughnessTexture": {"index": 1}},
             "normalTexture": {"index": 1, "scale": 0.5}, "alphaMode": "MASK",
             "occlusionTexture": {"index": 2, "strength": 0.5}, "alphaCutoff": 0.3,
             "emissiveTexture": {"index": 2}, "emissiveFactor": [1, 1, 0], "doubleSided": True,
             "extensions": EXTENSIONS},
            {"alphaMode": "BLEND", "extensions": {"KHR_materials_unlit": {}}},
            {"extensions": {"KHR_materials_pbrSpecularGlossiness": {
                "diffuseFactor": [1, 1, 1, 1], "glossinessFactor": 0.5}}}]}
    document.write("materials")


def motion():
    document = Document()
    one = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
    times = document.accessor(FLOAT, "SCALAR", [0, 1, 2], min=[0], max=[2])
    primitive = square(document)
    primitive["attributes"] |= {
        "JOINTS_0": document.accessor(UBYTE, "VEC4", [0, 1, 0, 0] * 4),
        "WEIGHTS_0": document.accessor(FLOAT, "VEC4", [0.5, 0.5, 0, 0] * 4)}
    primitive["targets"] = [
        {"POSITION": document.accessor(FLOAT, "VEC3", [0, 0, 1] * 4)},
        {"POSITION": document.sparse(FLOAT, "VEC3", 4, [2], [0, 1, 0])}]
    small = {"attributes": {"POSITION": document.accessor(
        SHORT, "VEC3", [0, 0, 0, 32767, 0, 0, 0, 32767, 0], normalized=True)}}
    turns = document.accessor(FLOAT, "VEC4", [0, 0, 0, 1, 0, 0.6, 0, 0.8, 0, 1, 0, 0])
    cubic = document.accessor(FLOAT, "VEC3", [0, 0, 0, 1, 0, 0, 0, 0, 0] * 3)
    samplers = [
        {"input": times, "output": turns, "interpolation": "LINEAR"},
        {"input": times, "output": cubic, "interpolation": "CUBICSPLINE"},
        {"input": times, "interpolation": "STEP",
         "output": document.accessor(FLOAT, "SCALAR", [0, 0, 1, 0.5, 0, 1])},
        {"input": times, "output": document.accessor(FLOAT, "VEC3", [1, 1, 1, 2, 2, 2, 1, 1, 1])}]
    paths = [(1, "rotation"), (1, "translation"), (0, "weights"), (2, "scale")]
    channels = [{"sampler": index, "target": {"node": node, "path": path}}
                for index, (node, path) in enumerate(paths)]
    channels.append({"sampler": 3, "target": {"path": "pointer", "extensions": {
        "KHR_animation_pointer": {"pointer": "/nodes/2/translation"}}}})
    document.json |= {
        "extensionsUsed": ["EXT_mesh_gpu_instancing", "KHR_mesh_quantization",
                           "KHR_animation_pointer"],
        "extensionsRequired": ["KHR_mesh_quantization"],
        "scenes": [{"nodes": [0, 1, 3]}],
        "nodes": [{"mesh": 0, "skin": 0, "weights": [0.5, 0.2]}, {"children": [2]},
                  {"translation": [0, 1, 0]},
                  {"mesh": 1, "extensions": {"EXT_mesh_gpu_instancing": {"attributes": {
                      "TRANSLATION": document.accessor(FLOAT, "VEC3", [0, 0, 0, 2, 0, 0]),
                      "SCALE": document.accessor(FLOAT, "VEC3", [1, 1, 1, 2, 2, 2])}}}}],
        "skins": [{"joints": [1, 2], "skeleton": 1,
                   "inverseBindMatrices": document.accessor(FLOAT, "MAT4", one * 2)}],
        "meshes": [{"primitives": [primitive], "weights": [0, 0]}, {"primitives": [small]}],
        "animations": [{"samplers": samplers, "channels": channels}]}
    document.write("motion")


def plys():
    properties = ["x", "y", "z", "nx", "ny", "nz", "s", "t"]
    vertices = [SQUARE[3 * i:3 * i + 3] + [0, 0, 1, i / 4, 0] for i in range(4)]
    faces = [(0, 1, 2, 3), (0, 2, 1)]

    def header(form, extra=""):
        lines = ["ply", f"format {form} 1.0", "comment made here", "element vertex 4"]
        lines += [f"property float {name}" for name in properties]
        lines += ["property uchar red", "property uchar green", "property uchar blue",
                  "element face 2", "property list uchar int vertex_indices"]
        return ("\n".join(lines) + extra + "\nend_header\n").encode()

    text = "".join(" ".join(map(str, v)) + " 255 128 0\n" for v in vertices)
    text += "".join(f"{len(f)} {' '.join(map(str, f))}\n" for f in faces)
    put("ply/text.ply", header("ascii") + text.encode())
    for name, form, order in (("little", "binary_little_endian", "<"),
                              ("big", "binary_big_endian", ">")):
        data = b"".join(struct.pack(order + "8f3B", *v, 255, 128, 0) for v in vertices)
        data += b"".join(struct.pack(f"{order}B{len(f)}i", len(f), *f) for f in faces)
        put(f"ply/{name}.ply", header(form) + data)
    put("ply/cloud.ply", b"ply\nformat ascii 1.0\nelement vertex 2\nproperty double x\n"
        b"property double y\nproperty double z\nproperty uchar red\nproperty uchar green\n"
        b"property uchar blue\nproperty uchar alpha\nelement other 1\n"
        b"property list uint short what\nend_header\n0 0 0 1 2 3 255\n1 1 1 9 9 9 0\n2 5 6\n")
    put("ply/strips.ply", b"ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\n"
        b"property float y\nproperty float z\nelement tristrips 1\n"
        b"property list int int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n1 1 0\n"
        b"5 0 1 2 -1 3\n")


def stls():
    put("stl/text.stl", b"solid a\n facet normal 0 0 1\n  outer loop\n   vertex 0 0 0\n"
        b"   vertex 1 0 0\n   vertex 0 1 0\n  endloop\n endfacet\nendsolid a\n"
        b"solid b\nfacet normal 0 1 0\nouter loop\nvertex 0 0 1\nvertex 1e0 0 1\nvertex 0 .5 1\n"
        b"endloop\nendfacet\nendsolid\n")
    facets = [[0, 0, 1, *SQUARE[0:9]], [0, 0, 0, *SQUARE[0:3], *SQUARE[6:12]]]
    for name, head in (("binary", b"made here"), ("colors", b"COLOR=\xff\x00\x80\xff")):
        data = b"".join(struct.pack("<12fH", *facet, 0x8421) for facet in facets)
        put(f"stl/{name}.stl", head.ljust(80, b"\0") + struct.pack("<I", 2) + data)


OBJ = """mtllib a.mtl b.mtl
o thing
v 0 0 0
v 2 0 0 1 0.5 0
v 2 2 0 1.0
v 0 2 \\
  0
vt 0 0
vt 1 0.25
vn 0 0 1
g a b
s 1
usemtl red
f 1/1/1 2/2/1 3//1 4//1 # a square
usemtl textured
f -4/-1 -3/-2 -2
s off
f 1//1 2//1 4//1
l 1 2 3/
p 1 3
curv 0 1 1 2
"""

MTL = """# by hand
newmtl a
Kd 0.5 0 1
Ka 1 1 1
Ks .5 .25 0
Ns 30
illum 2
d 0.25
Ni 1.25
Tf 1 .5 .5
map_Kd -s 2 3 1 -o .5 .25 -clamp on rgb.png
map_d -imfchan m rgb.png
bump -bm .5 rgb.png
newmtl b
Pm 1
Pr .5
Pc .75
Pcr .25
Ps .5
aniso .5
Ke 3 2 1
map_Pr rgb.png
norm -bm 2 rgb.png
Kd spectral x.rfl 1
Tr 0.5
Kd xyz .5 .5 .5
"""

PBRT = """Scale -1 1 1 LookAt 0 1 -5  0 0 0  0 1 0
Camera "perspective" "float fov" [50] "float screenwindow" [-1 1 -1 1]
Film "rgb" "integer xresolution" [16] "integer yresolution" [16] "float cropwindow" [0 1 0 .5]
Sampler "halton" "integer pixelsamples" 2 Integrator "path" "integer maxdepth" 3
Option "string rendercoordsys" "camera"
MakeNamedMaterial "m" "string type" "uber" "rgb Kt" [.1 .2 .3] "rgb Kr" [.1 0 0]
MakeNamedMedium "fog" "string type" "homogeneous" "rgb sigma_a" [1 2 3] "float scale" .1
Texture "t" "spectrum" "imagemap" "string filename" "rgb.png" "float uscale" 2
Texture "u" "spectrum" "scale" "texture tex" "t" "rgb scale" [.5 .5 .5]
Texture "v" "spectrum" "mix" "texture tex1" "t" "texture tex2" "u" "float amount" .3
Texture "w" "spectrum" "checkerboard" "rgb tex1" [1 0 0] "rgb tex2" [0 1 0]
CoordinateSystem "here"
WorldBegin Attribute "shape" "float alpha" 1 "string note" "x" ColorSpace "rec2020"
LightSource "spot" "point3 from" [0 5 0] "point3 to" [0 0 0] "blackbody I" [3000]
LightSource "infinite" "string filename" "rgb.png" "float scale" .5
LightSource "point" "spectrum I" "stdillum-D65" "float power" 20
LightSource "goniometric" "rgb I" [1 2 3] LightSource "projection" "float fov" 30
AttributeBegin
AreaLightSource "diffuse" "rgb L" [1 1 1] "bool twosided" false
Translate 0 3 0 Rotate 90 1 0 0 Shape "disk" "float radius" .5 "float innerradius" .1
AttributeEnd
Material "coateddiffuse" "texture reflectance" "v" "float roughness" .1
ObjectBegin "o" Shape "cone" Shape "cylinder" "float phimax" 90 ObjectEnd
TransformBegin Transform [1 0 0 0 0 1 0 0 0 0 1 0 1 2 3 1] ObjectInstance "o" TransformEnd
ConcatTransform [1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1] CoordSysTransform "here" Identity
ActiveTransform StartTime Translate 1 0 0 ActiveTransform All TransformTimes 0 1
Material "conductor" "spectrum eta" "metal-Cu-eta" "spectrum k" "metal-Cu-k"
Shape "plymesh" "string filename" "shapes.ply"
Material "dielectric" "float eta" 1.5 "float uroughness" .2 MediumInterface "fog" ""
Shape "bilinearmesh" "point3 P" [0 0 0 1 0 0 0 1 0 1 1 1] "integer indices" [0 1 2 3]
NamedMaterial "m"
Shape "trianglemesh" "integer indices" [0 1 2 0 2 3] "point3 P" [0 0 0 1 0 0 1 1 0 0 1 0]
  "normal N" [0 0 1 0 0 1 0 0 1 0 0 1] "point2 uv" [0 0 1 0 1 1 0 1]
Shape "loopsubdiv" "integer indices" [0 1 2] "point3 P" [0 0 0 1 0 0 1 1 0] "integer levels" 2
Shape "nurbs" "integer nu" 2 "integer nv" 2 "integer uorder" 2 "integer vorder" 2
"float uknots" [0 0 1 1] "float vknots" [0 0 1 1] "point P" [0 0 0 2 0 0 0 3 0 2 3 0]
Shape "heightfield" "integer nu" [2] "integer nv" [2] "float Pz" [0 0.3 0 0.5]
Shape "curve" "point3 P" [0 0 0 1 0 0 1 1 0 0 1 0] "float width" .1
ReverseOrientation Shape "hyperboloid" "point p1" [1 0 0] "point p2" [.5 1 1]
Shape "paraboloid" Shape "sphere" "float zmax" .5 "float radius" 2
Include "more.pbrt"
Import "more.pbrt"
"""

LINES = {
    "render": "scene.gltf -o out.png -r 640x480 --spp 16 --depth 4 -t 2 --env sky.hdr -v",
    "view": "a.glb --camera 1 --fov 40 --eye 1,2,3 --target 0,0,0 --up 0,1,0 --crop 0,0,8,8",
    "orbit": "a.glb --orbit 30,70,105% --turntable 8 -o out-%03d.png --background #ff8800",
    "film": "a.glb --frames 1-20 --fps 24 --animation 0 -o film.y4m --frame-all",
    "many": "a.glb b.obj models -o {name}.png --jobs 2 --skip-existing --max-memory 2G",
    "light": "a.pbrt --integrator lights --virtual-lights 8 --sky-lights 4 --noise 0.01",
    "kept": "builtin:cornell --tile 1/4 -o part.exr --layers normal,depth --exr float",
    "words": "render -- -scene.gltf --help --stats=json --exposure auto --tone-mapping aces",
    "compare": "compare a.png b.png --threshold 0.1 --metric flip --json",
    "info": "info a.glb --json", "merge": "merge a.exr b.exr -o c.exr",
    "bench": "bench --rounds 3 builtin:cornell", "shell": "completion bash",
    "scenario": "--scenario {\"input\":\"a.glb\"} -o {name}.png",
}

JOBS = {
    "options": {"input": ["a.glb", "b.obj"], "output": "{name}.png", "resolution": "64x48",
                "spp": 4, "quiet": True, "exposure": -1.5, "id": 7, "layers": "normal"},
    "list": [{"name": "one", "input": "a.glb", "orbit": "30,70,2"},
             {"name": "two", "scenario": {"input": "b.glb", "env": None}, "depth": 3}],
    "generator": {"renderers": [{"name": "raylane"}], "scenarios": [{
        "name": "box", "model": "../models/box.glb", "lighting": "sky.hdr",
        "dimensions": {"width": 64, "height": 48}, "verticalFoV": 30, "renderSkybox": False,
        "target": {"x": 0, "y": 1, "z": 0}, "orbit": {"theta": 45, "phi": 80, "radius": 0},
        "exclude": ["other"]}]},
}


def streams():
    """Before a stream: mode, filter, stride and count, as fuzz/targets.zig has them."""
    for name, mode, filtered, stride, count in (
            ("positions", 0, 0, 8, 63), ("normals", 0, 1, 4, 63), ("texcoords", 0, 3, 8, 63),
            ("colors", 0, 4, 4, 63), ("triangles", 1, 0, 2, 288), ("indices", 2, 0, 2, 63)):
        put(f"meshopt/{name}.bin", struct.pack("<BBBH", mode, filtered, stride, count) +
            (MESHES / f"{name}.bin").read_bytes())
    put("meshopt/quaternions.bin", struct.pack("<BBBH", 0, 2, 8, 63) +
        (MESHES / "positions.bin").read_bytes())


def put(name, data):
    path = CORPUS / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(data)


def main():
    if CORPUS.exists():
        shutil.rmtree(CORPUS)
    plain()
    materials()
    motion()
    plys()
    stls()
    streams()
    put("obj/all.obj", OBJ.encode())
    put("obj/cloud.obj", b"v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv nan 0 -inf\n")
    put("mtl/all.mtl", MTL.encode())
    put("pbrt/all.pbrt", PBRT.encode())
    put("gzip/text.gz", gzip.compress((CORPUS / "ply/text.ply").read_bytes(), 9, mtime=0))
    put("gzip/two.gz", b"".join(gzip.compress(part, 0, mtime=0) for part in (b"ply\n", b"format")))
    put("any/obj", OBJ.encode())
    put("any/pbrt", b"# Anything.\nLookAt 0 1 -5  0 0 0  0 1 0\nWorldBegin\n")
    put("any/stl", (CORPUS / "stl/text.stl").read_bytes())
    for name, line in LINES.items():
        put(f"cli/{name}.args", "\n".join(line.split(" ")).encode())
    for name, job in JOBS.items():
        put(f"scenario/{name}.json", json.dumps(job, indent=1).encode() + b"\n")
    put("beside/more.pbrt", b"Shape \"sphere\" \"float radius\" [.2]\n")
    for name in ("shapes.ply", "shapes.inc"):
        put(f"beside/{name}", (TOP.parent / "tests" / "pictures" / name).read_bytes())
    put("beside/rgb.png", (IMAGES / "gray-4.png").read_bytes())
    put("beside/a.mtl", b"newmtl red\nKd 1 0 0\nnewmtl textured\nmap_Kd rgb.png\n")
    for path in MESHES.glob("*.bin"):
        put(f"beside/{path.name}", path.read_bytes())


if __name__ == "__main__":
    main()
