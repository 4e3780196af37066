# SPDX-License-Identifier: GPL-3.0-or-later
"""The README's three pictures: a jelly thrown, water poured on a sphere, sand through a ring.

    MATTERFIT_PICTURES=FOLDER blender -b --factory-startup --python-exit-code 1 \
        -P scripts/first_pictures.py [-- [again] jelly water sand]

Each begins in an empty scene and presses the panel's buttons, with everything else at its default;
press() and choose() count what a person does in the panel. Rendered by Cycles with motion blur;
`again` renders what was baked before.
"""

import math
import os
import sys

import bpy
from mathutils import Vector

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
FOLDER = os.environ.get("MATTERFIT_PICTURES", os.path.join(ROOT, "build", "pictures"))
MOST_ACTIONS = 10
SIZE = 512, 320
SAMPLES = int(os.environ.get("MATTERFIT_SAMPLES", "48"))
_actions = []


def press(operator, **arguments):
    """A button of the panel."""
    _actions.append(operator)
    if getattr(bpy.ops.matterfit, operator)(**arguments) != {"FINISHED"}:
        raise RuntimeError(f"{operator}: {bpy.context.window_manager.matterfit.last_error}")


def choose(item, name, value):
    """A field of the panel."""
    _actions.append(name)
    setattr(item, name, value)


def begin(name, last_frame):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    folder = os.path.join(FOLDER, name)
    os.makedirs(folder, exist_ok=True)
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 1, last_frame
    bpy.ops.wm.save_as_mainfile(filepath=os.path.join(folder, f"{name}.blend"), check_existing=False)
    _actions.clear()
    return scene


def shaded(name, color, roughness=0.3, transmission=0.0):
    found = bpy.data.materials.new(name)
    found.use_nodes = True
    inputs = found.node_tree.nodes["Principled BSDF"].inputs
    inputs["Base Color"].default_value = (*color, 1.0)
    inputs["Roughness"].default_value = roughness
    inputs["Transmission" if "Transmission" in inputs else
           "Transmission Weight"].default_value = transmission
    if transmission:
        inputs["IOR"].default_value = 1.33
    bpy.context.active_object.data.materials.append(found)
    if hasattr(bpy.context.active_object.data, "polygons"):
        for face in bpy.context.active_object.data.polygons:
            face.use_smooth = True


def only(*objects):
    bpy.context.view_layer.update()
    for item in bpy.context.view_layer.objects:
        item.select_set(item in objects)
    bpy.context.view_layer.objects.active = objects[0]


# -- the three scenes ----------------------------------------------------------------------------

def pudding(name):
    """A fluted pudding, turned: rings of points from the middle of its foot to that of its top."""
    profile = [(share * 0.24, -0.14) for share in (0.3, 0.6, 0.85)]
    profile += [(0.24 - 0.075 * share, -0.14 + 0.26 * share)
                for share in (0.04, 0.2, 0.4, 0.6, 0.8, 0.94)]
    profile += [(share * 0.15, 0.14) for share in (0.95, 0.6, 0.3)]
    count = 72
    vertices = [(0.0, 0.0, -0.14)]
    for radius, z in profile:
        for i in range(count):
            angle = 2.0 * math.pi * i / count
            wide = radius * (1.0 + 0.05 * math.cos(12.0 * angle) * min(radius / 0.15, 1.0) ** 4)
            vertices.append((wide * math.cos(angle), wide * math.sin(angle), z))
    vertices.append((0.0, 0.0, 0.14))
    faces = []
    for i in range(count):
        after = (i + 1) % count
        faces.append((0, 1 + after, 1 + i))
        for ring in range(len(profile) - 1):
            low, high = 1 + ring * count, 1 + (ring + 1) * count
            faces.append((low + i, low + after, high + after, high + i))
        last = 1 + (len(profile) - 1) * count
        faces.append((last + i, last + after, len(vertices) - 1))
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(vertices, [], faces)
    item = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(item)
    only(item)
    return item


def jelly():
    begin("jelly", 6)
    item = pudding("Jelly")
    item.location, item.rotation_euler = (-0.42, 0.0, 0.6), (0.25, 0.5, 0.0)
    item.modifiers.new("Subdivision", "SUBSURF").levels = 1
    shaded("Jelly", (0.7, 0.01, 0.03), 0.12, 0.12)
    press("add_body", role="BODY")
    body = bpy.context.scene.matterfit.bodies[0]
    choose(body, "velocity", (2.5, 0.0, -3.5))
    choose(body, "spin", (0.0, 6.0, 0.0))
    press("bake")


def water():
    begin("water", 7)
    bpy.ops.mesh.primitive_cylinder_add(radius=0.1, depth=0.44, location=(0.05, -0.02, 0.68))
    jet = bpy.context.active_object
    jet.name = "Water"
    shaded("Water", (0.01, 0.12, 0.24), 0.12)
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.2, location=(0.0, 0.0, 0.22), segments=64,
                                         ring_count=32)
    ball = bpy.context.active_object
    ball.name = "Sphere"
    shaded("Sphere", (0.85, 0.3, 0.08), 0.35)
    only(jet)
    press("add_body", role="BODY")
    choose(bpy.context.scene.matterfit.bodies[0].material, "preset", "WATER")
    choose(bpy.context.scene.matterfit.solver, "particle_separation", 0.008)
    only(ball)
    press("add_body", role="COLLIDER")
    press("bake")


def sand():
    begin("sand", 11)
    bpy.ops.mesh.primitive_cylinder_add(radius=0.105, depth=0.4, location=(0.03, 0.0, 0.76))
    column = bpy.context.active_object
    column.name = "Sand"
    shaded("Sand", (0.66, 0.47, 0.24), 0.95)
    bpy.ops.mesh.primitive_torus_add(location=(0.0, 0.0, 0.45), major_radius=0.18,
                                     minor_radius=0.06, major_segments=64, minor_segments=24)
    ring = bpy.context.active_object
    ring.name = "Ring"
    shaded("Ring", (0.08, 0.22, 0.5), 0.25)
    only(column)
    press("add_body", role="BODY")
    choose(bpy.context.scene.matterfit.bodies[0].material, "preset", "SAND")
    choose(bpy.context.scene.matterfit.solver, "particle_separation", 0.009)
    only(ring)
    press("add_body", role="COLLIDER")
    press("bake")


# What is done, where the camera looks, from how far.
SCENES = {"jelly": (jelly, (-0.02, 0.0, 0.17), 1.35), "water": (water, (0.0, 0.0, 0.3), 1.9),
          "sand": (sand, (0.0, 0.0, 0.42), 2.2)}


# -- the picture ---------------------------------------------------------------------------------

def stage(target, distance):
    """A floor, a sun, a soft sky, a camera that looks at `target`."""
    scene = bpy.context.scene
    bpy.ops.mesh.primitive_plane_add(size=60.0)
    shaded("Floor", (0.2, 0.205, 0.215), 0.6)
    sun = bpy.data.objects.new("Sun", bpy.data.lights.new("Sun", "SUN"))
    sun.data.energy, sun.data.angle = 2.6, 0.08
    sun.rotation_euler = (math.radians(42), math.radians(12), math.radians(25))
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    place = Vector(target) + distance * Vector((0.28, -0.92, 0.3))
    camera.location = place
    camera.rotation_euler = (Vector(target) - place).to_track_quat("-Z", "Y").to_euler()
    for item in (sun, camera):
        scene.collection.objects.link(item)
    scene.camera = camera
    scene.world = bpy.data.worlds.new("World")
    scene.world.use_nodes = True
    background = scene.world.node_tree.nodes["Background"].inputs
    background["Color"].default_value = (0.62, 0.72, 0.88, 1.0)
    background["Strength"].default_value = 0.4


def render(name, frame):
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.device = "CPU"
    scene.cycles.samples = SAMPLES
    scene.cycles.use_denoising = False
    scene.cycles.max_bounces = 8
    scene.render.use_motion_blur = True
    scene.render.motion_blur_shutter = 0.3
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    scene.render.image_settings.file_format = "JPEG"
    scene.render.image_settings.quality = 88
    scene.render.filepath = os.path.join(FOLDER, f"{name}.jpg")
    scene.view_settings.view_transform = "Standard"
    scene.frame_set(frame)
    bpy.ops.render.render(write_still=True)


def bake(name):
    SCENES[name][0]()
    print(f"first pictures: {name}: {len(_actions)} actions in the panel: {', '.join(_actions)}",
          flush=True)
    print(bpy.context.window_manager.matterfit.last_report, flush=True)
    if len(_actions) >= MOST_ACTIONS:
        raise RuntimeError(f"{name} takes {len(_actions)} actions in the panel")
    bpy.ops.wm.save_mainfile()


def main():
    names = sys.argv[sys.argv.index("--") + 1:] if "--" in sys.argv else []
    again = "again" in names
    sys.path.insert(0, os.path.join(ROOT, "addon"))
    import matterfit
    matterfit.register()
    for name in [name for name in names if name != "again"] or list(SCENES):
        if again:
            bpy.ops.wm.open_mainfile(filepath=os.path.join(FOLDER, name, f"{name}.blend"))
        else:
            bake(name)
        stage(*SCENES[name][1:])
        render(name, bpy.context.scene.frame_end - 1)


main()
