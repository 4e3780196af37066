# SPDX-License-Identifier: GPL-3.0-or-later
"""Films a baked mesh: mattes by Cycles, an outline's true coverage, and the cameras' file.

    blender -b --factory-startup --python-exit-code 1 -P scripts/film_mattes.py -- \\
        MESH.obj MOTION.pc2 FOLDER [--cameras N] [--size W H] [--every N] [--seed N] [--samples N] [--colours]

MESH.obj is the mesh that a job's `output.mesh` names, Z up, MOTION.pc2 what it baked
(`mesh/NAME.pc2`). Cameras stand on a ring around the motion's box, at 20° and every third (1, 4, …) at 55°
above the horizon, 2.75 times the box's half diagonal away, f = 1.15 W, turned by the seed. FOLDER gets
`transforms.json` and `c0_0000.png`, …, white bodies before nothing: the alpha channel is the matte.
--colours: matt bodies of coloured cells, a sixth of the first frame's size across, which move with them,
under an even sky that they keep from themselves.
"""

import argparse
import json
import math
import pathlib
import random
import struct
import sys

import bpy
from mathutils import Matrix, Vector


def read_obj(path):
    vertices, faces = [], []
    for line in pathlib.Path(path).read_text(encoding="utf-8").splitlines():
        words = line.split()
        if words[:1] == ["v"]:
            vertices.append(tuple(float(x) for x in words[1:4]))
        elif words[:1] == ["f"]:
            faces.append([int(word.split("/")[0]) - 1 for word in words[1:]])
    return vertices, faces


def read_pc2(path):
    data = pathlib.Path(path).read_bytes()
    _, _, points, _, _, samples = struct.unpack_from("<12siiffi", data)
    values = struct.unpack_from(f"<{3 * points * samples}f", data, 32)
    return [values[3 * points * k:3 * points * (k + 1)] for k in range(samples)]


def bounds(frames):
    low = [min(min(frame[axis::3]) for frame in frames) for axis in range(3)]
    high = [max(max(frame[axis::3]) for frame in frames) for axis in range(3)]
    return Vector(low), Vector(high)


def pose(place, target):
    """Camera to world: looks along its −z, y up."""
    back = (place - target).normalized()
    right = Vector((0, 0, 1)).cross(back).normalized()
    up = back.cross(right)
    return Matrix((right, up, back)).transposed().to_4x4() + Matrix(
        [[0, 0, 0, place[i] if i < 3 else 0] for i in range(4)])


def add_cameras(frames, count, width, seed):
    low, high = bounds(frames)
    target, reach = (low + high) / 2, 2.75 * (high - low).length / 2
    turn = random.Random(seed).uniform(0, 2 * math.pi)
    cameras = []
    for k in range(count):
        angle = turn + 2 * math.pi * k / count
        height = math.radians(55 if k % 3 == 1 else 20)
        place = target + reach * Vector((math.cos(height) * math.cos(angle),
                                         math.cos(height) * math.sin(angle), math.sin(height)))
        data = bpy.data.cameras.new(f"camera {k}")
        data.sensor_width = 36.0
        data.lens = 1.15 * 36.0
        data.clip_start, data.clip_end = 0.01 * reach, 10 * reach
        camera = bpy.data.objects.new(data.name, data)
        camera.matrix_world = pose(place, target)
        bpy.context.collection.objects.link(camera)
        cameras.append((camera, 1.15 * width))
    return cameras


def set_up(options):
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.device = "CPU"
    scene.cycles.samples = options.samples
    scene.cycles.use_denoising = False
    scene.cycles.max_bounces = 0
    scene.render.film_transparent = True
    scene.render.resolution_x, scene.render.resolution_y = options.size
    scene.render.use_persistent_data = True
    scene.cycles.filter_width = 1.0  # coverage of the pixel itself
    scene.render.image_settings.file_format = "PNG"
    scene.render.image_settings.color_mode = "RGBA"
    scene.view_settings.view_transform = "Standard"
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)
    return scene


def coloured(mesh, rest):
    """Gives a mesh a matt material of cells that lie at `rest` (flat list of coordinates)."""
    low, high = bounds([rest])
    mesh.attributes.new("rest", "FLOAT_VECTOR", "POINT").data.foreach_set("vector", rest)
    material = bpy.data.materials.new("cells")
    material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()
    place = nodes.new("ShaderNodeAttribute")
    place.attribute_name = "rest"
    cells = nodes.new("ShaderNodeTexVoronoi")
    cells.inputs["Scale"].default_value = 6.0 / max(high - low)
    matt = nodes.new("ShaderNodeBsdfDiffuse")
    out = nodes.new("ShaderNodeOutputMaterial")
    links.new(place.outputs["Vector"], cells.inputs["Vector"])
    links.new(cells.outputs["Color"], matt.inputs["Color"])
    links.new(matt.outputs["BSDF"], out.inputs["Surface"])
    mesh.materials.append(material)
    world = bpy.context.scene.world or bpy.data.worlds.new("sky")
    bpy.context.scene.world = world
    world.use_nodes = True
    sky = world.node_tree.nodes["Background"]
    sky.inputs["Color"].default_value, sky.inputs["Strength"].default_value = (1.0, 1.0, 1.0, 1.0), 1.0


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("mesh")
    parser.add_argument("motion")
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--cameras", type=int, default=4)
    parser.add_argument("--size", type=int, nargs=2, default=(400, 400))
    parser.add_argument("--every", type=int, default=1)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--samples", type=int, default=16)
    parser.add_argument("--colours", action="store_true")
    options = parser.parse_args(sys.argv[sys.argv.index("--") + 1:])
    vertices, faces = read_obj(options.mesh)
    frames = read_pc2(options.motion)
    scene = set_up(options)
    mesh = bpy.data.meshes.new("body")
    mesh.from_pydata(vertices, [], faces)
    if options.colours:
        coloured(mesh, frames[0])
    bpy.context.collection.objects.link(bpy.data.objects.new("body", mesh))
    width, height = options.size
    shots = []
    for k, (camera, focal) in enumerate(add_cameras(frames, options.cameras, width, options.seed)):
        scene.camera = camera
        for t in range(0, len(frames), options.every):
            mesh.vertices.foreach_set("co", frames[t])
            mesh.update()
            name = f"c{k}_{t:04d}.png"
            scene.cycles.seed = options.seed + 1000 * k + t
            scene.render.filepath = str((options.folder / name).resolve())
            bpy.ops.render.render(write_still=True)
            shots.append({"file_path": name, "transform_matrix": [list(row) for row in camera.matrix_world],
                          "fl_x": focal, "fl_y": focal, "w": width, "h": height})
    (options.folder / "transforms.json").write_text(
        json.dumps({"frames": shots}, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
