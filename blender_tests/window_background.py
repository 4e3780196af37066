# SPDX-License-Identifier: GPL-3.0-or-later
"""Buttons of the window test that work in the background: counting particles, Check."""

import time

import bpy
from matterfit import jobs, native
from matterfit.io import check
from matterfit.jobs import State
from window_support import modal, view, wait_for

DRAWS = 3  # of the window while the particles are counted, at least


def cancel(job, what):
    """Presses Cancel and waits for the end. The time is that of the window too, which is drawn in
    between, by a renderer in software; what the library takes is judged in test_cancel."""
    asked = job.elapsed
    bpy.ops.matterfit.cancel()
    yield from wait_for(lambda: job.ended, 10.0, "the end after Cancel")
    print(f"window: Cancel of {what} answered after {job.elapsed - asked:.2f} s")


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
    job = jobs.registry.running
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
    yield from cancel(job, "filling")
    yield
    native.estimate = estimate
    settings = bpy.context.scene.matterfit
    if job.state is not State.CANCELLED or len(settings.takes) != count:
        faults.append(f"Cancel while filling gave {job.state} and {len(settings.takes)} takes")
    settings.solver.particle_separation = separation


def modal_check():
    """Check of the recording that is fitted afterwards."""
    if modal("check_fit") != {"RUNNING_MODAL"}:
        raise AssertionError("Check does not run modally")
    job = jobs.registry.running
    yield from wait_for(lambda: job.ended, 90.0, "the end of Check")
    yield
    report = check.read(bpy.context.scene.matterfit.fit.check)
    if job.state is not State.DONE or report is None:
        raise AssertionError(f"Check gave {job.state}: {job.error}")
    print(f"window: Check took {job.elapsed:.1f} s and tells {report.known} of "
          f"{len(report.parameters)} values")
