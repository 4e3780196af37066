# SPDX-License-Identifier: GPL-3.0-or-later
"""What the window test shows: a scene, and what a comparison, a check, a fit, a diagnosis and a batch
would have left of it."""

import os

import bpy
import fake_check
import fake_diagnosis
import fake_fit
import numpy
from fake_diagnosis import cause, number
from matterfit import native
from matterfit.io import check, comparison, files, job_document, takes
from matterfit.props import compare as compare_properties


def build_scene(folder):
    bpy.ops.wm.save_as_mainfile(filepath=os.path.join(folder, "scene.blend"))
    for item in list(bpy.data.objects):
        bpy.data.objects.remove(item)
    bpy.ops.mesh.primitive_cube_add(size=0.2, location=(0.0, 0.0, 0.3))
    bpy.context.active_object.name = "Dough"
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 1, 20
    settings = scene.matterfit
    bpy.ops.matterfit.add_body(role="BODY")
    settings.bodies[0].material.preset = "PLASTICINE"
    bpy.ops.matterfit.add_pin()
    bpy.ops.matterfit.add_mass()
    bpy.ops.object.empty_add(location=(0.0, 0.0, 0.4))
    settings.bodies[0].pins[0].object = bpy.context.active_object
    settings.bodies[0].masses[0].object = bpy.context.active_object
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.1, location=(0.3, 0.0, 0.05))
    bpy.context.active_object.name = "Ball"
    bpy.ops.matterfit.add_body(role="COLLIDER")
    settings.body_index = 0
    path = os.path.join(folder, "clip.npz")
    times = numpy.arange(20) / 24.0
    grid = numpy.stack(numpy.meshgrid(*[numpy.linspace(-0.1, 0.1, 4)] * 3), axis=-1).reshape(-1, 3)
    positions = grid[None] + numpy.array([0, 0, 0.3]) + times[:, None, None] * [0.2, 0, -0.2]
    files.write_npz(path, {"positions": positions, "times": times})
    capture = settings.captures.add()
    capture.name, capture.filepath = "clip", "//clip.npz"
    capture.summary = "20 frames, 64 points"
    if native.load():
        bpy.ops.matterfit.check_capture()
    bpy.ops.matterfit.add_take()
    bpy.ops.matterfit.add_throw()
    bpy.ops.matterfit.list_colliders()
    for owner, key, values in (("Dough", "velocity[2]", "-1, -2, -3"),
                               ("Dough", "material.E", "5e4, 1e5")):
        bpy.ops.matterfit.add_axis(quantity=f"{owner}\t{key}")
        settings.batch.axes[len(settings.batch.axes) - 1].values = values
    return positions, times


def fake_results():
    """A check and a batch's results, as they are shown."""
    settings = bpy.context.scene.matterfit
    settings.fit.check = check.stored(fake_check.result(body="Dough"), check.asked(bpy.context.scene))
    settings.batch.task, settings.batch.varied = "COMPARE", "Velocity Z, Young's Modulus"
    for name, error in (("-2, 1e5", 0.84), ("-2, 5e4", 3.217), ("-1, 1e5", 41.6), ("-3, 5e4", -1.0)):
        row = settings.batch.results.add()
        row.name, row.error = name, error


def fake_comparison(positions, times):
    """The files that a comparison leaves, with an error that grows along x and in time."""
    scene = bpy.context.scene
    take = takes.ensure_active(scene.matterfit)
    folder = takes.claim(take)
    error = 0.01 * times[:, None] / times[-1] * (1.0 + 5.0 * (positions[:, :, 0] + 0.1))
    simulated = positions + error[:, :, None] * numpy.array([1.0, 0.0, 0.0])
    files.write_json(os.path.join(folder, "job.json"), {
        "captures": [{"name": "clip"}],
        "scene": {"fps": 24, "frames": [1, 21]}})
    files.write_npz(os.path.join(folder, "compare.npz"), {
        "error_mm": 1000.0 * error, "times": times, "captured": positions,
        "labels": numpy.array([str(i) for i in range(positions.shape[1])])})
    files.write_npz(os.path.join(folder, "simulated.npz"), {"positions": simulated,
                                                            "times": times})
    take.compared = True
    compare_properties.store(scene.matterfit.compare, comparison.load(folder))
    scene.frame_set(15)
    scene.matterfit.compare.point_size = 10.0


def fake_result(positions, times):
    """The files that a fit leaves, with those of a comparison of the fitted scene."""
    scene = bpy.context.scene
    settings = scene.matterfit
    settings.captures[0].holdout, settings.captures[0].holdout_start = "FRAMES", 15
    folder = takes.claim(takes.for_fit(settings))
    job_document.write(job_document.build(scene, settings.fit.run, folder, "fit"), folder)
    fake_fit.write(folder)
    error = 0.001 * (times[:, None] + positions[:, :, 0] + 0.1)
    files.write_npz(os.path.join(folder, "compare.npz"), {
        "error_mm": 1000.0 * error, "times": times, "captured": positions,
        "labels": numpy.array([str(i) for i in range(positions.shape[1])])})
    files.write_npz(os.path.join(folder, "simulated.npz"), {
        "positions": positions + error[:, :, None], "times": times})
    settings.fit.done = True


def record_fall():
    """A capture of the body's own fall, simulated, with noise; its last frames are held out."""
    settings = bpy.context.scene.matterfit
    path = os.path.join(os.path.dirname(bpy.data.filepath), "fall.npz")
    grid = numpy.stack(numpy.meshgrid(*[numpy.linspace(-0.09, 0.09, 3)] * 3), axis=-1)
    still = grid.reshape(-1, 3) + numpy.array([0, 0, 0.3])
    times = numpy.arange(10) / 24.0
    files.write_npz(path, {"positions": numpy.repeat(still[None], 10, axis=0), "times": times})
    capture = settings.captures.add()
    capture.name, capture.filepath = "fall", "//fall.npz"
    bpy.ops.matterfit.add_take()  # the cache of the first is of another scene
    if bpy.ops.matterfit.compare() != {"FINISHED"}:
        raise AssertionError("the recording could not be simulated")
    folder = takes.locate(takes.ensure_active(settings)).folder
    with numpy.load(os.path.join(folder, "simulated.npz")) as arrays:
        recorded = arrays["positions"]
    noise = numpy.random.default_rng(1).normal(0.0, 5e-4, recorded.shape)
    files.write_npz(path, {"positions": recorded + noise, "times": times})
    capture.use_noise, capture.noise = True, 5e-4
    capture.holdout, capture.holdout_start = "FRAMES", 9
    settings.compare.done = False


def fake_report():
    """A diagnosis of that fit."""
    folder = takes.locate(bpy.context.scene.matterfit.fit.run).folder
    frames = [{"capture": "clip", "frame": frame, "time": frame / 24.0, "before": 1e-4 * frame * frame / 4.0,
               "after": 1.1e-3, "noise": 6e-4, "numerical": 4e-5 * frame, "held_out": frame >= 15}
              for frame in range(1, 21)]
    residual = {"by_frame": frames, "wrong": [], "worst": [
        {"capture": "clip", "frame": frame, "where": [0.1, 0.0, 0.3], "size": size}
        for frame, size in ((19, 0.011), (12, 0.004))]}
    fake_diagnosis.write(folder, residual=residual, causes=[
        cause("drag_quadratic", {"drag_coefficient": number(0.47, "", 0.012)}),
        cause("gravity_size", {"added": number(-0.031, "m/s²", 0.012)}, 0.02, accepted=False, gain=0.11),
        cause("time_offset", {"offset": number(0.004, "s", 0.001)}, 0.002, accepted=False, gain=None,
              gain_interval=None)])
