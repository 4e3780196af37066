# SPDX-License-Identifier: GPL-3.0-or-later
"""Buttons of the window test that work in the background: counting particles, Check."""

import time

import bpy
from matterfit import jobs, native
from matterfit.io import check, frames
from matterfit.jobs import State
from window_support import begun, modal, view, wait_for

DRAWS = 3  # of the window while the particles are counted, at least


def cancel(job, what):
    """Presses Cancel and waits for the end. The time is that of the window too, which is drawn in
    between, by a renderer in software; what the library takes is judged in test_cancel."""
    asked = job.elapsed
    bpy.ops.matterfit.cancel()
    yield from wait_for(lambda: job.ended, 100.0, "the end after Cancel")
    print(f"window: Cancel of {what} answered after {job.elapsed - asked:.2f} s")


def drawn_in():
    """Seconds that the renderer takes for the window, beside which a Cancel is to be read."""
    window, area = view()
    began = time.monotonic()
    with bpy.context.temp_override(window=window, area=area):
        bpy.ops.wm.redraw_timer(type="DRAW_WIN_SWAP", iterations=DRAWS)
    return (time.monotonic() - began) / DRAWS


def modal_filling(picture, faults):
    """Bake with a body that takes seconds to fill: the button returns at once, the window goes on
    being drawn, Cancel answers; what was added for it is gone."""
    settings = bpy.context.scene.matterfit
    separation = settings.solver.particle_separation
    settings.solver.particle_separation = 0.0018
    count = len(settings.takes)
    estimate = native.estimate

    def slow(*arguments):
        """A quick machine fills even that in less than a second."""
        time.sleep(2.5)
        return estimate(*arguments)

    native.estimate = slow
    began = time.monotonic()
    if modal("bake") != {"RUNNING_MODAL"}:
        raise AssertionError("Bake does not run modally")
    took = time.monotonic() - began
    job = yield from begun()
    yield from wait_for(lambda: job.snapshot.stage, 200.0, "a stage")
    ticks = 0
    while ticks < DRAWS:
        yield
        job = jobs.registry.running
        if job is None or job.snapshot.stage != "Filling":
            raise AssertionError(f"{ticks} draws while filling, {DRAWS} are wanted; then: "
                                 f"{job and job.snapshot}")
        ticks += 1
        view()[1].tag_redraw()
    filling = time.monotonic() - began
    print(f"window: Bake returned after {took:.2f} s, and was still filling after {filling:.2f} s")
    if took > 0.5 * filling:
        faults.append(f"Bake held the window for {took:.2f} s")
    picture("filling")
    print(f"window: drawing it takes {drawn_in():.2f} s")
    yield from cancel(job, "filling")
    yield
    native.estimate = estimate
    settings = bpy.context.scene.matterfit
    if job.state is not State.CANCELLED or len(settings.takes) != count:
        faults.append(f"Cancel while filling gave {job.state} and {len(settings.takes)} takes")
    settings.solver.particle_separation = separation


def modal_reading(faults):
    """Bake with a collider that deforms, whose frames take .1 s to read: the window goes on being drawn,
    Cancel answers and leaves frame and takes as they were; else the bake begins by itself."""
    scene = bpy.context.scene
    settings = scene.matterfit
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=20, y_subdivisions=20, location=(0.0, 0.0, -5.0))
    grid = bpy.context.active_object
    grid.modifiers.new("Wave", "WAVE")
    bpy.context.view_layer.objects.active = None
    row = settings.bodies.add()
    row.name, row.role, row.object = "Grid", "COLLIDER", grid
    frame, count = scene.frame_current, len(settings.takes)
    visit = frames.visit

    def slow(*arguments):
        time.sleep(0.1)
        visit(*arguments)

    frames.visit = slow
    for stop in (True, False):
        if modal("bake") != {"RUNNING_MODAL"}:
            raise AssertionError("Bake does not run modally")
        job = jobs.registry.running
        seen = set()
        while len(seen) < DRAWS and not job.ended:
            if job.snapshot.stage == "Reading the scene":
                seen.add(job.snapshot.fraction)
            view()[1].tag_redraw()
            yield
        if len(seen) < DRAWS:
            raise AssertionError(f"{len(seen)} draws while reading, {DRAWS} are wanted: {job.state} {job.error}")
        if stop:
            yield from cancel(job, "reading the scene")
            yield
            scene = bpy.context.scene
            if (job.state is not State.CANCELLED or scene.frame_current != frame
                    or len(scene.matterfit.takes) != count):
                faults.append(f"Cancel while reading gave {job.state} at frame {scene.frame_current}")
    baking = yield from begun()
    if job.state is not State.DONE or bpy.context.scene.frame_current != frame:
        faults.append(f"reading ended as {job.state} at frame {bpy.context.scene.frame_current}")
    frames.visit = visit
    yield from cancel(baking, "what was read")
    yield
    settings = bpy.context.scene.matterfit
    settings.bodies.remove(len(settings.bodies) - 1)
    bpy.data.objects.remove(bpy.data.objects[grid.name])


def modal_check():
    """Check of the recording that is fitted afterwards."""
    if modal("check_fit") != {"RUNNING_MODAL"}:
        raise AssertionError("Check does not run modally")
    job = yield from begun()
    yield from wait_for(lambda: job.ended, 400.0, "the end of Check")
    yield
    report = check.read(bpy.context.scene.matterfit.fit.check)
    if job.state is not State.DONE or report is None:
        raise AssertionError(f"Check gave {job.state}: {job.error}")
    print(f"window: Check took {job.elapsed:.1f} s and identifies {report.known} of "
          f"{len(report.parameters)} values")
