"""Renders a glTF file by Cycles, in a Python that has Blender as a module (bpy).

Reads jobs, one JSON object a line, from standard input, and answers each by a line of JSON:

    {"do": "load", "model", "width", "height", "fov_deg", "eye", "target", "environment",
     "bounces", "threads"}
        -> {"triangles"}; eye and target in the coordinates of glTF; environment null: the light of
        the file alone
    {"do": "render", "samples", "seed", "denoise", "out"}
        -> {"wall_s", "cpu_s"} of rendering, the scene's preparation with it; `out` null: no file,
        else a PNG

The environment is turned as glTF's renderers have it, the camera sees it, nothing is exposed or
tone mapped. All bounces count for all kinds of light, nothing is clamped or blurred, no sampling is
adaptive; what else there is to set is as Cycles has it.
"""

import json
import math
import os
import resource
import sys
import time

import bpy
import mathutils


def to_blender(point):
    """From y up to z up."""
    return mathutils.Vector((point[0], -point[2], point[1]))


def place_camera(scene, job):
    """A pinhole with a vertical angle."""
    camera = bpy.data.objects.new("view", bpy.data.cameras.new("view"))
    scene.collection.objects.link(camera)
    eye, target = to_blender(job["eye"]), to_blender(job["target"])
    camera.location = eye
    camera.rotation_mode = "QUATERNION"
    camera.rotation_quaternion = (target - eye).to_track_quat("-Z", "Y")
    camera.data.sensor_fit = "VERTICAL"
    camera.data.angle = math.radians(job["fov_deg"])
    distance = (target - eye).length
    camera.data.clip_start, camera.data.clip_end = distance * 1e-3, distance * 1e4
    scene.camera = camera


def place_environment(scene, path):
    """An image all around, or darkness."""
    world = bpy.data.worlds.new("world")
    scene.world = world
    world.use_nodes = True
    background = world.node_tree.nodes["Background"]
    if path is None:
        background.inputs["Strength"].default_value = 0
        return
    image = world.node_tree.nodes.new("ShaderNodeTexEnvironment")
    image.image = bpy.data.images.load(path)
    world.node_tree.links.new(image.outputs["Color"], background.inputs["Color"])


def load(job):
    """A scene with one view."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.import_scene.gltf(filepath=job["model"],
                              export_import_convert_lighting_mode="COMPAT")
    scene = bpy.context.scene
    for light in bpy.data.lights:
        if hasattr(light, "shadow_soft_size"):
            light.shadow_soft_size = 0
    place_camera(scene, job)
    place_environment(scene, job["environment"])
    scene.render.engine = "CYCLES"
    scene.render.resolution_x, scene.render.resolution_y = job["width"], job["height"]
    scene.render.resolution_percentage = 100
    scene.render.threads_mode, scene.render.threads = "FIXED", job["threads"]
    scene.render.image_settings.file_format = "PNG"
    scene.render.image_settings.color_mode = "RGB"
    scene.view_settings.view_transform = "Standard"
    cycles = scene.cycles
    cycles.device = "CPU"
    cycles.use_adaptive_sampling = False
    cycles.max_bounces = job["bounces"]
    cycles.diffuse_bounces = cycles.glossy_bounces = job["bounces"]
    cycles.transmission_bounces = job["bounces"]
    cycles.blur_glossy = 0
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0
    graph = bpy.context.evaluated_depsgraph_get()
    count = 0
    for instance in graph.object_instances:
        if instance.object.type == "MESH":
            mesh = instance.object.to_mesh()
            mesh.calc_loop_triangles()
            count += len(mesh.loop_triangles)
    return {"triangles": count}


def render(job):
    """One picture."""
    scene = bpy.context.scene
    scene.cycles.samples = job["samples"]
    scene.cycles.seed = job["seed"]
    scene.cycles.use_denoising = job["denoise"]
    if job["denoise"]:
        scene.cycles.denoiser = "OPENIMAGEDENOISE"
        scene.cycles.denoising_input_passes = "RGB_ALBEDO_NORMAL"
    if job["out"] is not None:
        scene.render.filepath = job["out"]
    wall, usage = time.monotonic(), resource.getrusage(resource.RUSAGE_SELF)
    bpy.ops.render.render(write_still=job["out"] is not None)
    after = resource.getrusage(resource.RUSAGE_SELF)
    return {"wall_s": time.monotonic() - wall,
            "cpu_s": after.ru_utime - usage.ru_utime + after.ru_stime - usage.ru_stime}


def main():
    # What Blender says of itself goes to standard error.
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    for line in sys.stdin:
        job = json.loads(line)
        answers.write(json.dumps(load(job) if job["do"] == "load" else render(job)) + "\n")
        answers.flush()


main()
