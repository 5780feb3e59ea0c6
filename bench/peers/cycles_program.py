"""Renders with Blender's Cycles; runs in a Python with bpy (requirements/cycles.lock). Requests and responses are lines of JSON.

The first is {"parts": file.npz, "materials": […], "cores"}. Then {"matrix", "side_m", "px", "samples", "centres", "file"} draws into a multilayer
EXR, and {"read": file.exr, "into": file.npz} converts one to arrays for comparison. It does not import map3d, because bpy pins its own NumPy.
"""

import json
import os
import sys

import bpy
import numpy as np

FAR_M = 20_000.0


def main(responses):
    scene = load(json.loads(sys.stdin.readline()))
    print(json.dumps({"device": f"Blender {bpy.app.version_string}"}), file=responses, flush=True)
    for line in sys.stdin:
        order = json.loads(line)
        read(order) if "read" in order else draw(scene, order)
        print("{}", file=responses, flush=True)


def load(setup):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    data = np.load(setup["parts"])
    for number, description in enumerate(setup["materials"]):
        add_part(scene, number, description, data)
    configure_render(scene, setup["cores"])
    camera = bpy.data.cameras.new("camera")
    camera.type, camera.clip_start, camera.clip_end = "ORTHO", 0.1, FAR_M
    scene.camera = bpy.data.objects.new("camera", camera)
    scene.collection.objects.link(scene.camera)
    return scene


def add_part(scene, number, description, data):
    """Adds a mesh per city object; Cycles does not average the numbers of objects."""
    corners, uvs, names = (data[f"{kind}{number}"] for kind in ("corners", "uvs", "names"))
    material = make_material(number, description)
    for name in np.unique(names):
        own = names == name
        mesh = bpy.data.meshes.new(f"p{number}")
        count = int(own.sum())
        mesh.vertices.add(count * 3)
        mesh.vertices.foreach_set("co", corners[own].ravel())
        mesh.loops.add(count * 3)
        mesh.loops.foreach_set("vertex_index", np.arange(count * 3, dtype=np.int32))
        mesh.polygons.add(count)
        mesh.polygons.foreach_set("loop_start", np.arange(0, count * 3, 3, dtype=np.int32))
        mesh.uv_layers.new(name="uv").uv.foreach_set("vector", uvs[own].ravel())
        mesh.materials.append(material)
        mesh.update(calc_edges=True)
        city_object = bpy.data.objects.new(f"p{number}", mesh)
        city_object.pass_index = int(name)
        scene.collection.objects.link(city_object)


def make_material(number, description):
    """Returns a material that emits its texture: without lamps and bounces the fastest way to an unlit colour."""
    material = bpy.data.materials.new(f"m{number}")
    material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()
    emission, out = nodes.new("ShaderNodeEmission"), nodes.new("ShaderNodeOutputMaterial")
    links.new(emission.outputs[0], out.inputs["Surface"])
    if description["image"] is None:
        emission.inputs["Color"].default_value = (*description["diffuse"], 1.0)
        return material
    texture = nodes.new("ShaderNodeTexImage")
    texture.image = bpy.data.images.load(description["image"])
    texture.extension = "REPEAT" if description["repeats"] else "EXTEND"
    links.new(texture.outputs["Color"], emission.inputs["Color"])
    return material


def configure_render(scene, cores):
    scene.render.engine = "CYCLES"
    scene.cycles.device, scene.cycles.max_bounces = "CPU", 0
    scene.cycles.use_adaptive_sampling = scene.cycles.use_denoising = False
    scene.cycles.pixel_filter_type = "BOX"
    scene.render.use_persistent_data = True
    scene.render.threads_mode, scene.render.threads = "FIXED", cores
    scene.render.film_transparent = True
    scene.render.resolution_percentage = 100
    scene.view_settings.view_transform = "Raw"
    layer = scene.view_layers[0]
    layer.use_pass_combined = layer.use_pass_z = layer.use_pass_normal = layer.use_pass_object_index = True
    image = scene.render.image_settings
    image.media_type = "MULTI_LAYER_IMAGE"
    image.file_format, image.color_depth, image.exr_codec = "OPEN_EXR_MULTILAYER", "32", "NONE"


def draw(scene, order):
    """Draws into a file. `matrix`: 4 × 4 camera to local, row-major."""
    matrix, side = order["matrix"], order["side_m"]
    camera = scene.camera
    camera.matrix_world = np.array(matrix).reshape(4, 4).T.tolist()
    camera.data.ortho_scale = side
    scene.render.resolution_x = scene.render.resolution_y = order["px"]
    scene.cycles.samples = order["samples"]
    scene.cycles.filter_width = 0.01 if order["centres"] else 1.0
    scene.render.filepath = order["file"]
    bpy.ops.render.render(write_still=True)


def read(order):
    import OpenEXR

    found = {}
    with OpenEXR.File(order["read"], separate_channels=True) as file:
        for part in file.parts:
            found.update((name, channel.pixels) for name, channel in part.channels.items())
    one = {name.split(".", 1)[-1]: pixels for name, pixels in found.items()}
    color = np.stack([one[f"Combined.{letter}"] for letter in "RGB"], -1)
    depth = next(pixels for name, pixels in one.items() if name.startswith("Depth"))
    name = next(pixels for name, pixels in one.items() if name.startswith(("Object Index", "IndexOB")))
    np.savez(order["into"], color=color, depth=depth, name=name)


if __name__ == "__main__":
    responses = os.fdopen(os.dup(1), "w")
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    main(responses)
