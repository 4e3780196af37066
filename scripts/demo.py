# SPDX-License-Identifier: GPL-3.0-or-later
"""The demonstration: what a person does in the panel, done by the same operators.

1. Two recordings of a silicone beam are imported. An elastic material is fitted to the first part of
   one; what that gets wrong is diagnosed, the cause named and tested on the other recording, which
   nothing was fitted to; the model is extended by it, fitted again, compared and saved.
2. A cube of that material is thrown, and once more, elsewhere and over a collider; both takes are
   baked to volumes, mesh caches and attribute textures, which play without the add-on.
Each is rendered. Run by demo.sh.
"""

import math
import os
import shutil
import time

import bpy
import numpy
from mathutils import Vector

ROOT = os.environ["MATTERFIT_ROOT"]
FOLDER = os.path.join(ROOT, "build", "demo")
EXAMPLE = os.path.join(ROOT, "docs", "examples", "beam.blend")
SAMPLE = os.path.join(ROOT, "docs", "examples", "beam_gravity_V2_a.npz")
REPEAT = os.path.join(ROOT, "docs", "examples", "beam_gravity_V2_b.npz")
REPEAT_START = 6.5  # it was let go at its own frame 64.5, the first one at 71
FIRST_FRAME, LAST_FRAME = 66, 140  # the beam is held still until 71
STARTED = time.monotonic()

MATERIAL = os.path.join(FOLDER, "silicone.json")
RENDER_SAMPLES = 24


def say(text):
    """demo.sh shows the lines that begin so."""
    print(f"matterfit: [{time.monotonic() - STARTED:5.1f} s] {text}", flush=True)


def settings():
    return bpy.context.scene.matterfit


def call(operator, **arguments):
    """An operator of ours, which must finish."""
    result = operator(**arguments)
    if result != {"FINISHED"}:
        raise RuntimeError(f"{operator.idname()}: {bpy.context.window_manager.matterfit.last_error}")


def new_scene(name, fps, last_frame):
    """An empty scene, saved: caches go beside the file."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    import addon_utils

    addon_utils.enable("matterfit")
    folder = os.path.join(FOLDER, name)
    os.makedirs(folder)
    scene = bpy.context.scene
    scene.render.fps, scene.frame_start, scene.frame_end = fps, 0, last_frame
    bpy.ops.wm.save_as_mainfile(filepath=os.path.join(folder, f"{name}.blend"))
    return scene


def select(*objects):
    for item in bpy.context.view_layer.objects:
        item.select_set(item in objects)
    bpy.context.view_layer.objects.active = objects[0]


def add_mesh(name, vertices, faces):
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(vertices, [], faces)
    item = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(item)
    return item


def add_box(name, low, high, cuts=(1, 1, 1)):
    """A closed box whose sides are grids of `cuts` quads, so that it can bend."""
    places, faces = {}, []

    def vertex(point):
        return places.setdefault(point, len(places))

    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        for side in (0, cuts[axis]):
            for i in range(cuts[u]):
                for j in range(cuts[v]):
                    corners = []
                    for a, b in ((0, 0), (1, 0), (1, 1), (0, 1)):
                        point = [0, 0, 0]
                        point[axis], point[u], point[v] = side, i + a, j + b
                        corners.append(vertex(tuple(point)))
                    faces.append(corners if side else corners[::-1])
    vertices = [
        tuple(low[k] + (high[k] - low[k]) * point[k] / cuts[k] for k in range(3)) for point in places
    ]
    return add_mesh(name, vertices, faces)


def material(name, color, roughness=0.5):
    found = bpy.data.materials.new(name)
    found.use_nodes = True
    shader = found.node_tree.nodes["Principled BSDF"]
    shader.inputs["Base Color"].default_value = (*color, 1.0)
    shader.inputs["Roughness"].default_value = roughness
    return found


def stage(target, distance, angle, height, lens=50.0):
    """A floor, a light, a camera that looks at `target`."""
    scene = bpy.context.scene
    size = 40.0 * distance
    floor = add_mesh("Floor", [(-size, -size, 0), (size, -size, 0), (size, size, 0), (-size, size, 0)],
                     [(0, 1, 2, 3)])
    floor.data.materials.append(material("Floor", (0.32, 0.33, 0.35), 0.8))
    sun = bpy.data.objects.new("Sun", bpy.data.lights.new("Sun", "SUN"))
    sun.data.energy, sun.data.angle = 2.2, 0.1
    sun.rotation_euler = (math.radians(40), math.radians(10), math.radians(30))
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.data.lens = lens
    camera.data.clip_start = 0.01 * distance
    place = Vector(target) + distance * Vector((math.cos(angle), math.sin(angle), height))
    camera.location = place
    camera.rotation_euler = (Vector(target) - place).to_track_quat("-Z", "Y").to_euler()
    for item in (sun, camera):
        scene.collection.objects.link(item)
    scene.camera = camera
    world = scene.world or bpy.data.worlds.new("World")
    scene.world = world
    world.use_nodes = True
    world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.6, 0.68, 0.8, 1.0)
    world.node_tree.nodes["Background"].inputs["Strength"].default_value = 0.35
    return floor


def render(path, frame, width=800, height=450):
    """One picture with Cycles on the CPU. Debian's Blender has no denoiser."""
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.device = "CPU"
    scene.cycles.samples = RENDER_SAMPLES
    scene.cycles.use_denoising = False
    scene.render.resolution_x, scene.render.resolution_y = width, height
    scene.render.resolution_percentage = 100
    scene.render.filepath = path
    for item in dir(scene.render):  # no place of this machine goes into the picture
        if item.startswith("use_stamp_"):
            setattr(scene.render, item, False)
    scene.frame_set(frame)
    bpy.ops.render.render(write_still=True)
    say(f"picture: {os.path.relpath(path, ROOT)} (frame {frame})")


def take_folder(take):
    return os.path.normpath(bpy.path.abspath(take.folder))


def report_files(take):
    """What a bake left, by kind."""
    folder = take_folder(take)
    kinds = {}
    for base, _, names in os.walk(folder):
        for name in names:
            kind = os.path.splitext(name)[1]
            size = os.path.getsize(os.path.join(base, name))
            count, total = kinds.get(kind, (0, 0))
            kinds[kind] = (count + 1, total + size)
    wanted = [".vdb", ".pc2", ".exr"]
    text = ", ".join(f"{kinds[k][0]} {k[1:]} ({kinds[k][1] / 1e6:.1f} MB)" for k in wanted if k in kinds)
    say(f"  {text} in {os.path.relpath(folder, ROOT)}")
    missing = [k for k in wanted if k not in kinds]
    if missing:
        raise RuntimeError(f"{folder} holds no {', '.join(missing)} files")


# -- 1: the recording ----------------------------------------------------------------------------


def open_beam():
    """The example scene of docs/start.md (make_beam_scene.py), saved here: caches go beside it."""
    bpy.ops.wm.open_mainfile(filepath=EXAMPLE)
    folder = os.path.join(FOLDER, "beam")
    os.makedirs(folder)
    bpy.ops.wm.save_as_mainfile(filepath=os.path.join(folder, "beam.blend"))
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = FIRST_FRAME, LAST_FRAME
    capture = settings().captures[0]
    capture.filepath = SAMPLE
    capture.use_start_frame, capture.start_frame = True, 0.0
    call(bpy.ops.matterfit.check_capture)
    for line in capture.summary.splitlines():
        say(f"  {line}")


def show_errors(folder, frame):
    """Spheres where the markers were recorded, coloured by error, smaller ones where simulated."""
    name = settings().captures[0].name
    with numpy.load(os.path.join(folder, f"compare_{name}.npz")) as arrays:
        captured, errors, times = arrays["captured"], arrays["error_mm"], arrays["times"]
    with numpy.load(os.path.join(folder, f"simulated_{name}.npz")) as arrays:
        simulated = arrays["positions"]
    row = int(numpy.argmin(numpy.abs(times * 100.0 - frame)))
    worst = max(float(numpy.nanmax(errors)), 1e-9)
    for point in range(captured.shape[1]):
        share = float(errors[row, point]) / worst
        color = (share, 0.25 * (1.0 - share), 1.0 - share)
        for place, radius, tint in (
            (captured[row, point], 0.003, color),
            (simulated[row, point], 0.002, (0.9, 0.9, 0.9)),
        ):
            bpy.ops.mesh.primitive_uv_sphere_add(radius=radius, location=[float(x) for x in place])
            bpy.context.object.data.materials.append(material(f"Marker {point}", tint, 0.3))


def import_repeat():
    """The second recording, on the same beam, kept for testing."""
    call(bpy.ops.matterfit.import_capture, filepath=REPEAT)
    first, repeat = settings().captures
    for name in ("markers", "use_noise", "noise", "align", "use_release", "release"):
        setattr(repeat, name, getattr(first, name))
    repeat.use_start_frame, repeat.start_frame = True, REPEAT_START
    repeat.holdout = "CAPTURE"
    call(bpy.ops.matterfit.check_capture)


def without_relaxation():
    """Elastic alone: what that cannot do is to be found. Bending hardly knows of ν, which at .49 would
    take twice the substeps."""
    material_of_beam = settings().bodies[0].material
    material_of_beam.maxwell.clear()
    material_of_beam.nu = 0.45
    first = settings().captures[0].name
    for row in settings().fit.parameters:
        row.enabled = row.key == "material.E" or (row.key == "start_frame" and row.owner == first)


def diagnose_beam():
    from matterfit.io import diagnosis

    fit, capture = settings().fit, settings().captures[0]
    say(f"fitting an elastic law to the frames {capture.release + 1} to {capture.holdout_start - 1}, "
        f"particles {1e3 * settings().solver.particle_separation:.2g} mm apart, and asking what it "
        "gets wrong …")
    call(bpy.ops.matterfit.diagnose)
    folder = take_folder(fit.run)
    report = diagnosis.load(folder)
    say(f"  {report.sentence}")
    accepted = [cause for cause in report.causes if cause.accepted]
    if not accepted:
        raise RuntimeError(f"the diagnosis names no cause ({report.verdict})")
    cause = accepted[0]
    numbers = ", ".join(number.text for number in cause.numbers)
    say(f"  {cause.label}, {numbers}: probability {100 * cause.probability:.3g} %; what was held out, the "
        f"repeat included, is predicted to {1e3 * cause.holdout_after:.2f} mm in place of "
        f"{1e3 * cause.holdout_before:.2f} mm")
    say(f"  the page: {os.path.relpath(os.path.join(folder, diagnosis.PAGE_FILE), ROOT)}")
    call(bpy.ops.matterfit.extend_model)


def fit_beam():
    """Stiffness, what the model was extended by, and when within a frame the beam was let go."""
    from matterfit import quantities
    from matterfit.io import fit_results

    fit = settings().fit
    say("fitting the extended model …")
    call(bpy.ops.matterfit.fit)
    for line in bpy.context.window_manager.matterfit.last_report.splitlines()[:1]:
        say("  " + line)
    result = fit_results.load(take_folder(fit.run))
    for estimate in result.estimates:
        say(f"  {quantities.label_of(estimate.path.split('.', 2)[2])}: {estimate.text}")
    before, after = (measure["mean_mm"] for measure in (result.held_out.before,
                                                        result.held_out.after))
    if not after < before:
        raise RuntimeError(f"the fit predicts no better than its start: {before} -> {after} mm")
    call(bpy.ops.matterfit.apply_fit)
    call(bpy.ops.matterfit.save_material, filepath=MATERIAL)
    say(f"  saved as {os.path.relpath(MATERIAL, ROOT)}")


def demonstrate_beam():
    say("1. A silicone beam, clamped at one end, held straight and let go: recorded twice, fitted, "
        "diagnosed, compared.")
    open_beam()
    import_repeat()
    without_relaxation()
    diagnose_beam()
    fit_beam()
    say(f"comparing frames {FIRST_FRAME} to {LAST_FRAME} at 100 per second with the recording …")
    call(bpy.ops.matterfit.compare)
    found = settings().compare
    say(f"  mean error {found.mean_mm:.2f} mm, 95 % below {found.p95_mm:.2f} mm")
    say("baking its render mesh …")
    output = settings().output
    output.surface = output.velocity_attribute = False
    call(bpy.ops.matterfit.bake)
    worst = found.worst[0].frame if found.worst else LAST_FRAME
    floor = stage((-0.05, 0.015, 0.01), 0.28, math.radians(-62), 0.45)
    floor.location.z = -0.06
    show_errors(take_folder(settings().takes[0]), worst)
    render(os.path.join(FOLDER, "beam.png"), worst)
    bpy.ops.wm.save_mainfile()


# -- 2: the throws -------------------------------------------------------------------------------


def set_up_cube():
    new_scene("throw", 24, 48)
    half = 0.15
    cube = add_box("cube", (-half,) * 3, (half,) * 3, cuts=(3, 3, 3))
    modifier = cube.modifiers.new("Subdivision", "SUBSURF")
    modifier.levels = modifier.render_levels = 2
    for face in cube.data.polygons:
        face.use_smooth = True
    cube.location = (-0.9, 0.0, 0.7)
    cube.data.materials.append(material("Silicone", (0.83, 0.42, 0.25), 0.25))
    bpy.ops.mesh.primitive_torus_add(
        location=(0.0, 0.0, 0.12), major_radius=0.26, minor_radius=0.12, major_segments=48,
        minor_segments=24,
    )
    ring = bpy.context.object
    ring.name = "ring"
    for face in ring.data.polygons:
        face.use_smooth = True
    ring.data.materials.append(material("Ring", (0.2, 0.35, 0.5)))
    select(cube)
    call(bpy.ops.matterfit.add_body)
    select(ring)
    call(bpy.ops.matterfit.add_body, role="COLLIDER")
    ours = settings()
    ours.body_index = 0
    call(bpy.ops.matterfit.load_material, filepath=MATERIAL)
    body = ours.bodies[0]
    body.velocity, body.spin = (1.6, 0.0, 0.5), (0.0, 3.0, 1.0)
    ours.output.density = ours.output.surface = ours.output.mesh = True
    ours.output.velocity_attribute = ours.output.stretch = True
    return ring


def bake_take(title):
    say(f"{title}: particles {1e3 * settings().solver.particle_separation:.2g} mm apart, baking …")
    call(bpy.ops.matterfit.bake)
    take = settings().takes[settings().take_index]
    say("  " + bpy.context.window_manager.matterfit.last_report)
    report_files(take)
    call(bpy.ops.matterfit.verify)
    for item in take.collection.objects:
        # The pictures show the mesh; the density would lie around it as a mist.
        item.hide_render = item.hide_render or item.type == "VOLUME"
    return take


def demonstrate_throws():
    say("2. A cube of that silicone (a subdivision surface) thrown on the floor; then over a ring.")
    ring = set_up_cube()
    call(bpy.ops.matterfit.add_take)
    call(bpy.ops.matterfit.list_colliders)
    take = settings().takes[0]
    take.name = "Floor"
    for switch in take.colliders:
        switch.enabled = False
    bake_take("take 1, on the floor")
    stage((-0.05, 0.0, 0.2), 2.6, math.radians(-75), 0.42)
    ring.hide_render = True
    render(os.path.join(FOLDER, "throw.png"), 10)

    call(bpy.ops.matterfit.add_take)
    take = settings().takes[settings().take_index]
    take.name = "Ring"
    for switch in take.colliders:
        switch.enabled = True
    call(bpy.ops.matterfit.add_throw)
    throw = take.throws[0]
    throw.use_placement, throw.location = True, (-0.75, -0.1, 0.9)
    throw.velocity, throw.spin = (1.7, 0.2, 0.0), (2.0, -4.0, 0.0)
    bake_take("take 2, another throw, over a ring")
    ring.hide_render = False
    render(os.path.join(FOLDER, "rerun.png"), 12)
    bpy.ops.wm.save_mainfile()


def main():
    shutil.rmtree(FOLDER, ignore_errors=True)
    os.makedirs(FOLDER)
    from matterfit import native

    say(f"Blender {bpy.app.version_string}, Matterfit {native.version()}")
    demonstrate_beam()
    demonstrate_throws()
    say("The scenes, to be opened in Blender: build/demo/beam/beam.blend, build/demo/throw/throw.blend")
    say("Done.")


main()
