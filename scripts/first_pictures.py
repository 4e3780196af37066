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
from dataclasses import dataclass

import bpy
from mathutils import Vector

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
FOLDER = os.environ.get("MATTERFIT_PICTURES", os.path.join(ROOT, "build", "pictures"))
MOST_ACTIONS = 10
SIZE = 640, 480
SHUTTER = 0.1  # frames: what moves shows it, and keeps its shape
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


def shaded(name, color, roughness=0.3, **inputs):
    """Gives the active object a material; `inputs` are Principled BSDF's by their first words."""
    found = bpy.data.materials.new(name)
    found.use_nodes = True
    shader = found.node_tree.nodes["Principled BSDF"]
    wanted = {"Base Color": (*color, 1.0), "Roughness": roughness,
              **{key.replace("_", " "): value for key, value in inputs.items()}}
    for key, value in wanted.items():
        for socket in [socket for socket in shader.inputs if socket.name.startswith(key)][:1]:
            socket.default_value = value  # Blender 4.0 has left some of them out
    item = bpy.context.active_object
    item.data.materials.append(found)
    for face in item.data.polygons:
        face.use_smooth = True
    return found, shader


def lets_light_through(material, share):
    """Shadows of glass are black where caustics are not followed: `share` of the light comes through."""
    tree = material.node_tree
    output = tree.nodes["Material Output"]
    path, clear = tree.nodes.new("ShaderNodeLightPath"), tree.nodes.new("ShaderNodeBsdfTransparent")
    factor, mix = tree.nodes.new("ShaderNodeMath"), tree.nodes.new("ShaderNodeMixShader")
    factor.operation = "MULTIPLY"
    factor.inputs[1].default_value = share
    tree.links.new(path.outputs["Is Shadow Ray"], factor.inputs[0])
    tree.links.new(factor.outputs[0], mix.inputs[0])
    tree.links.new(tree.nodes["Principled BSDF"].outputs[0], mix.inputs[1])
    tree.links.new(clear.outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], output.inputs["Surface"])


def grained(material, shader, dark, light):
    """Each grain of a cloud in a colour of its own."""
    tree = material.node_tree
    grain, ramp = tree.nodes.new("ShaderNodeNewGeometry"), tree.nodes.new("ShaderNodeValToRGB")
    ramp.color_ramp.elements[0].color, ramp.color_ramp.elements[1].color = (*dark, 1.0), (*light, 1.0)
    tree.links.new(grain.outputs["Random Per Island"], ramp.inputs["Fac"])
    tree.links.new(ramp.outputs["Color"], shader.inputs["Base Color"])


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
    item.location, item.rotation_euler = (-0.55, 0.0, 0.5), (0.1, 0.35, 0.0)
    item.modifiers.new("Subdivision", "SUBSURF").levels = 1
    shaded("Jelly", (0.85, 0.015, 0.05), 0.08, Subsurface=0.35, Subsurface_Radius=(0.1, 0.02, 0.02),
           Subsurface_Color=(0.95, 0.03, 0.06, 1.0), Specular=0.6, Clearcoat=0.6)
    press("add_body", role="BODY")
    body = bpy.context.scene.matterfit.bodies[0]
    choose(body, "velocity", (2.5, 0.0, -3.0))
    choose(body, "spin", (0.0, -2.5, 0.0))
    press("bake")


def water():
    begin("water", 9)
    bpy.ops.mesh.primitive_cylinder_add(radius=0.085, depth=0.9, location=(0.03, -0.02, 0.91))
    jet = bpy.context.active_object
    jet.name = "Water"
    material, _shader = shaded("Water", (0.86, 0.97, 1.0), 0.02, Transmission=1.0, IOR=1.33)
    lets_light_through(material, 0.95)
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.2, location=(0.0, 0.0, 0.22), segments=64,
                                         ring_count=32)
    ball = bpy.context.active_object
    ball.name = "Sphere"
    shaded("Sphere", (0.95, 0.28, 0.05), 0.3, Clearcoat=0.4)
    only(jet)
    press("add_body", role="BODY")
    choose(bpy.context.scene.matterfit.bodies[0].material, "preset", "WATER")
    output = bpy.context.scene.matterfit.output
    choose(output, "surface_smoothing", 20)
    choose(output, "surface_offset", 0.6)
    only(ball)
    press("add_body", role="COLLIDER")
    press("bake")


def sand():
    begin("sand", 12)
    bpy.ops.mesh.primitive_cylinder_add(radius=0.105, depth=0.4, location=(0.02, 0.0, 0.76))
    column = bpy.context.active_object
    column.name = "Sand"
    material, shader = shaded("Sand", (0.8, 0.5, 0.2), 0.85)
    grained(material, shader, (0.58, 0.34, 0.13), (0.97, 0.74, 0.42))
    bpy.ops.mesh.primitive_torus_add(location=(0.0, 0.0, 0.45), major_radius=0.18,
                                     minor_radius=0.06, major_segments=64, minor_segments=24)
    ring = bpy.context.active_object
    ring.name = "Ring"
    shaded("Ring", (0.0, 0.35, 0.42), 0.18, Clearcoat=0.8)
    only(column)
    press("add_body", role="BODY")
    choose(bpy.context.scene.matterfit.bodies[0].material, "preset", "SAND")
    only(ring)
    press("add_body", role="COLLIDER")
    press("bake")


@dataclass(frozen=True)
class Picture:
    """What is done, which frame is shown, where the camera stands and looks, the colour of the
    backdrop, and the strength of the lights before and behind [W]."""

    do: object
    frame: int
    eye: tuple
    target: tuple
    backdrop: tuple
    key: float = 60.0
    rim: float = 90.0


PICTURES = {
    "jelly": Picture(jelly, 5, (0.15, -1.6, 0.42), (-0.23, 0.0, 0.17), (0.25, 0.62, 0.6)),
    "water": Picture(water, 8, (0.5, -2.4, 0.6), (0.0, 0.0, 0.36), (0.05, 0.2, 0.42), 80.0, 170.0),
    "sand": Picture(sand, 11, (0.45, -2.15, 0.7), (0.02, 0.0, 0.27), (0.5, 0.16, 0.12)),
}


# -- the picture ---------------------------------------------------------------------------------

def stage(picture):
    """A sheet that is the floor and rises behind, two soft boxes, a camera."""
    scene = bpy.context.scene
    backdrop(picture.backdrop)
    target = Vector(picture.target)
    for name, place, size, power, color in (
            ("Key", (-1.6, -1.3, 1.9), 1.2, picture.key, (1.0, 0.93, 0.84)),
            ("Rim", (1.3, 1.5, 1.5), 0.9, picture.rim, (1.0, 0.97, 0.92)),
            ("Fill", (2.2, -1.6, 0.9), 1.6, 0.25 * picture.key, (0.8, 0.9, 1.0))):
        light = bpy.data.objects.new(name, bpy.data.lights.new(name, "AREA"))
        light.data.energy, light.data.size, light.data.color = power, size, color
        aim(light, Vector(place), target)
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.data.lens = 70.0
    camera.data.dof.use_dof = True
    camera.data.dof.focus_distance = (Vector(picture.eye) - target).length
    camera.data.dof.aperture_fstop = 4.0
    aim(camera, Vector(picture.eye), target)
    scene.camera = camera
    scene.world = bpy.data.worlds.new("World")
    scene.world.use_nodes = True
    background = scene.world.node_tree.nodes["Background"].inputs
    background["Color"].default_value = (0.8, 0.88, 1.0, 1.0)
    background["Strength"].default_value = 0.25


def aim(item, place, target):
    item.location = place
    item.rotation_euler = (target - place).to_track_quat("-Z", "Y").to_euler()
    bpy.context.scene.collection.objects.link(item)


def backdrop(color):
    """A floor that bends into a wall behind, so that there is no horizon."""
    profile = [(-4.0, 0.0), (1.6, 0.0)]
    profile += [(1.6 + math.sin(angle), 1.0 - math.cos(angle))
                for angle in (math.radians(7.5 * step) for step in range(1, 13))]
    profile.append((2.6, 5.0))
    vertices = [(side, y, z) for y, z in profile for side in (-6.0, 6.0)]
    faces = [(2 * i, 2 * i + 1, 2 * i + 3, 2 * i + 2) for i in range(len(profile) - 1)]
    mesh = bpy.data.meshes.new("Backdrop")
    mesh.from_pydata(vertices, [], faces)
    item = bpy.data.objects.new("Backdrop", mesh)
    bpy.context.scene.collection.objects.link(item)
    only(item)
    shaded("Backdrop", color, 0.55)


def render(name, frame):
    import _cycles  # there once bpy is
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.device = "CPU"
    # Debian's Blender has no denoiser, a wheel of bpy has one: `python scripts/first_pictures.py -- again`.
    scene.cycles.use_denoising = _cycles.with_openimagedenoise
    scene.cycles.samples = int(os.environ.get(
        "MATTERFIT_SAMPLES", "64" if _cycles.with_openimagedenoise else "256"))
    scene.cycles.max_bounces = 12
    scene.cycles.caustics_reflective = scene.cycles.caustics_refractive = False
    scene.cycles.sample_clamp_indirect = 4.0
    for material in bpy.data.materials:  # of a file of 3.4 a later version takes it for switched off
        if hasattr(material, "use_transparent_shadow"):
            material.use_transparent_shadow = True
    scene.render.use_motion_blur = True
    scene.render.motion_blur_shutter = SHUTTER
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    scene.render.image_settings.file_format = "JPEG"
    scene.render.image_settings.quality = 90
    scene.render.filepath = os.path.join(FOLDER, f"{name}.jpg")
    for item in dir(scene.render):  # no place of this machine goes into the picture
        if item.startswith("use_stamp_"):
            setattr(scene.render, item, False)
    scene.view_settings.view_transform = "Standard"
    scene.frame_set(frame)
    bpy.ops.render.render(write_still=True)


def bake(name):
    PICTURES[name].do()
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
    for name in [name for name in names if name != "again"] or list(PICTURES):
        if again:
            bpy.ops.wm.open_mainfile(filepath=os.path.join(FOLDER, name, f"{name}.blend"))
        else:
            bake(name)
        stage(PICTURES[name])
        render(name, PICTURES[name].frame)


main()
