# SPDX-License-Identifier: GPL-3.0-or-later
"""Makes docs/examples/beam.blend, the scene of docs/start.md and of the demonstration: the silicone
beam of the sample recording, clamped at one end, held straight until it is let go.

    blender -b --factory-startup --python-exit-code 1 -P scripts/make_beam_scene.py
"""

import math
import os
import shutil
import sys
import tempfile

import bpy

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
EXAMPLES = os.path.join(ROOT, "docs", "examples")
RECORDING = "beam_gravity_V2_a.npz"

# Clamped at x = -0.1 m, let go at frame 71; where its markers are on it.
LOW, HIGH, CUTS = (-0.1, 0.0, 0.0), (0.0, 0.03, 0.03), (20, 6, 6)
MARKERS = {
    "Tip-1": (0.0, 0.015, 0.036),
    "Tip-2": (0.0, -0.006, 0.024),
    "Tip-3": (0.0, 0.036, 0.006),
    "Base-1": (-0.094, -0.010, -0.001),
    "Base-3": (-0.094, 0.040, 0.0),
}
RATE, RELEASE, LAST_FRAME = 100, 71, 170
HELD_OUT = 111  # a fit sees the frames before: the first two swings


def add_empty(name, location, rotation, collection):
    item = bpy.data.objects.new(name, None)
    item.empty_display_size = 0.01
    item.location, item.rotation_euler = location, rotation
    collection.objects.link(item)
    return item


def add_beam():
    """A closed box whose sides are grids of quads, so that it can bend."""
    places, faces = {}, []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        for side in (0, CUTS[axis]):
            for i in range(CUTS[u]):
                for j in range(CUTS[v]):
                    corners = []
                    for a, b in ((0, 0), (1, 0), (1, 1), (0, 1)):
                        point = [0, 0, 0]
                        point[axis], point[u], point[v] = side, i + a, j + b
                        corners.append(places.setdefault(tuple(point), len(places)))
                    faces.append(corners if side else corners[::-1])
    mesh = bpy.data.meshes.new("beam")
    mesh.from_pydata([[LOW[k] + (HIGH[k] - LOW[k]) * point[k] / CUTS[k] for k in range(3)]
                      for point in places], [], faces)
    shader = bpy.data.materials.new("Silicone")
    shader.use_nodes = True
    shader.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = (
        0.83, 0.42, 0.25, 1.0)
    mesh.materials.append(shader)
    item = bpy.data.objects.new("beam", mesh)
    bpy.context.scene.collection.objects.link(item)
    return item


def set_body(ours):
    body = ours.bodies[0]
    body.density, body.material.law = 1070.0, "NEO_HOOKEAN"
    # Rough: of this order, and nearly incompressible. What relaxes faster than the beam swings
    # tells its viscosity only, modulus times time, so the time stays.
    body.material.E, body.material.nu = 1e5, 0.49
    body.material.damping_shear = body.material.damping_bulk = 0.0
    bpy.ops.matterfit.add_branch()
    body.material.maxwell[0].modulus, body.material.maxwell[0].time = 1e4, 1e-3
    bpy.ops.matterfit.add_pin()
    body.pins[0].kind = "PLANE"
    body.pins[0].object = add_empty("Clamp", LOW, (0.0, math.radians(90), 0.0),
                                    bpy.context.scene.collection)
    bpy.ops.matterfit.add_pin()
    hold = body.pins[1]
    hold.kind, hold.use_release, hold.release = "ALL", True, RELEASE


def set_capture(ours):
    bpy.ops.matterfit.import_capture(filepath=bpy.path.abspath("//" + RECORDING))
    capture = ours.captures[0]
    capture.filepath = "//" + RECORDING
    capture.markers = "Tip-1, Tip-2, Tip-3"
    capture.use_noise, capture.noise = True, 1e-5
    capture.use_release, capture.release = True, RELEASE
    capture.holdout, capture.holdout_start = "FRAMES", HELD_OUT
    places = bpy.data.collections.new("Markers at rest")
    bpy.context.scene.collection.children.link(places)
    for name, place in MARKERS.items():
        add_empty(name, place, (0.0, 0.0, 0.0), places)
    capture.align = places
    bpy.ops.matterfit.check_capture()


def set_fit(ours):
    """Stiffness and relaxation, and when within a frame the beam was let go."""
    wanted = {"material.E", "material.maxwell[0].modulus", "start_frame"}
    for row in ours.fit.parameters:
        row.enabled = row.key in wanted
    ours.fit.levels = 1


def main():
    sys.path.insert(0, os.path.join(ROOT, "addon"))
    import matterfit
    bpy.ops.wm.read_factory_settings(use_empty=True)
    matterfit.register()
    scene = bpy.context.scene
    scene.render.fps, scene.frame_start, scene.frame_end = RATE, 0, LAST_FRAME
    # Made elsewhere: a .blend file keeps the path that it was saved under. The capture is looked
    # for beside it.
    folder = tempfile.mkdtemp()
    shutil.copy(os.path.join(EXAMPLES, RECORDING), folder)
    path = os.path.join(folder, "beam.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path, compress=True)
    beam = add_beam()
    beam.select_set(True)
    bpy.context.view_layer.objects.active = beam
    bpy.ops.matterfit.add_body(role="BODY")
    ours = scene.matterfit
    set_body(ours)
    ours.solver.use_ground = False
    ours.solver.gravity = (0.0, 0.0, -9.80709)
    ours.solver.quality = "PREVIEW"
    set_capture(ours)
    set_fit(ours)
    scene.frame_set(0)
    bpy.ops.wm.save_as_mainfile(filepath=path, compress=True)
    shutil.copy(path, os.path.join(EXAMPLES, "beam.blend"))
    shutil.rmtree(folder)


main()
