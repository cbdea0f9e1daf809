"""Makes a glTF file of a PBRT scene of PLY meshes and quads that emit, by Blender (bpy).

Usage: coffee.py SCENE.pbrt OUT.glb

Reads what B. Bitterli's scenes of version 3 are made of: MakeNamedMaterial, NamedMaterial, Shape
"plymesh" and "trianglemesh", AreaLightSource "diffuse". Substrates become dielectrics of their
diffuse colour, mirrors metals, glass a solid of its index; both renderers then read the same file.
"""

import json
import pathlib
import re
import struct
import sys

import bpy

STATEMENT = re.compile(r"^\s*(\w+)(.*)$")
PARAMETER = re.compile(r'"(\w+) (\w+)" \[ ([^\]]*)\]')


def parameters(text):
    """By name: numbers, or the text of a string."""
    found = {}
    for kind, name, value in PARAMETER.findall(text):
        if kind in ("string", "bool", "texture"):
            found[name] = value.strip().strip('"')
        else:
            found[name] = [float(word) for word in value.split()]
    return found


def material_of(name, values):
    """Blender's principled surface for a material of PBRT."""
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    inputs = material.node_tree.nodes["Principled BSDF"].inputs
    kind = values.get("type", "matte")
    roughness = values.get("uroughness", [0.0 if kind in ("glass", "mirror") else 1.0])[0]
    # PBRT has alpha without remapping, glTF the square root of it.
    inputs["Roughness"].default_value = roughness ** 0.5
    color = values.get("Kd", [1.0, 1.0, 1.0])
    inputs["Base Color"].default_value = (*color, 1)
    if kind == "mirror":
        inputs["Metallic"].default_value = 1
        inputs["Base Color"].default_value = (0.9, 0.9, 0.9, 1)
    if kind == "glass":
        inputs["Transmission Weight"].default_value = 1
        inputs["IOR"].default_value = values.get("index", [1.5])[0]
        inputs["Base Color"].default_value = (1, 1, 1, 1)
    return material


def light_of(number, radiance):
    """A black surface that emits."""
    material = bpy.data.materials.new(f"light {number}")
    material.use_nodes = True
    inputs = material.node_tree.nodes["Principled BSDF"].inputs
    inputs["Base Color"].default_value = (0, 0, 0, 1)
    strength = max(radiance)
    inputs["Emission Color"].default_value = (*(part / strength for part in radiance), 1)
    inputs["Emission Strength"].default_value = strength
    return material


def quad_of(number, values):
    """A mesh of triangles, from y up to z up."""
    points = values["P"]
    corners = [(points[at], -points[at + 2], points[at + 1]) for at in range(0, len(points), 3)]
    indices = [int(index) for index in values["indices"]]
    faces = [indices[at:at + 3] for at in range(0, len(indices), 3)]
    mesh = bpy.data.meshes.new(f"quad {number}")
    mesh.from_pydata(corners, [], faces)
    thing = bpy.data.objects.new(mesh.name, mesh)
    bpy.context.scene.collection.objects.link(thing)
    return thing


def build(path):
    """The scene, in Blender."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    materials, current, radiance = {}, None, None
    for number, line in enumerate(path.read_text().splitlines()):
        match = STATEMENT.match(line)
        if not match:
            continue
        word, rest = match.groups()
        names, values = re.findall(r'^\s*"([^"]*)"', rest), parameters(rest)
        if word == "MakeNamedMaterial":
            materials[names[0]] = material_of(names[0], values)
        elif word == "NamedMaterial":
            current = materials[names[0]]
        elif word == "AreaLightSource":
            radiance = values["L"]
        elif word == "AttributeEnd":
            radiance = None
        elif word == "Shape":
            if names[0] == "plymesh":
                bpy.ops.wm.ply_import(filepath=str(path.parent / values["filename"]),
                                      forward_axis="NEGATIVE_Z", up_axis="Y")
                thing = bpy.context.selected_objects[0]
            else:
                thing = quad_of(number, values)
            thing.data.materials.clear()
            thing.data.materials.append(current if radiance is None else
                                        light_of(number, radiance))


def make_solid(path):
    """Gives what transmits an inside, which Blender's exporter leaves out."""
    data = path.read_bytes()
    length = struct.unpack_from("<I", data, 12)[0]
    document = json.loads(data[20:20 + length])
    for material in document["materials"]:
        extensions = material.get("extensions", {})
        if "KHR_materials_transmission" in extensions:
            extensions["KHR_materials_volume"] = {"thicknessFactor": 1}
            document["extensionsUsed"].append("KHR_materials_volume")
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    rest = data[20 + length:]
    header = struct.pack("<4sIIII", b"glTF", 2, 20 + len(text) + len(rest), len(text), 0x4E4F534A)
    path.write_bytes(header + text + rest)


def main():
    path, out = map(pathlib.Path, sys.argv[1:])
    build(path)
    bpy.ops.export_scene.gltf(filepath=str(out), export_format="GLB")
    make_solid(out)


main()
