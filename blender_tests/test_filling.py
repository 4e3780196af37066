# SPDX-License-Identifier: GPL-3.0-or-later
"""The particles are counted in the background: a button gives the window back at once."""

import os
import threading
import time
from unittest import mock

import bpy
import numpy
from matterfit import jobs, machine, native, ops
from matterfit.io import files, fit_rows, takes
from matterfit.jobs import JobError, State
from support import SceneCase, needs_library, select, tree
from test_operators import JobCase

BUTTONS = ("bake", "preview", "compare", "fit", "diagnose")


def operator_stub(name, **properties):
    """What has the methods of an operator, and no window: Blender makes operators itself."""
    operator = next(cls for cls in ops.CLASSES if cls.bl_idname == "matterfit." + name)
    given = {"onto": "NEW", "bl_options": operator.bl_options, **properties}
    kind = type("Pressed", (), {key: getattr(operator, key) for key in dir(operator)
                                if not key.startswith("__") and key not in (
                                    "bl_rna", "rna_type", "onto", "report")})
    stub = kind()
    stub.__dict__.update(given, report=mock.Mock())
    return stub


def pressed(name, **properties):
    """(stub of the operator, its job, started): what a button does before the window is drawn
    again."""
    stub = operator_stub(name, **properties)
    return stub, jobs.registry.add(jobs.drained(stub.begin_in_steps(bpy.context))).start()


def tick_until(job, condition, seconds=300.0):
    end = time.monotonic() + seconds
    while not condition():
        job.tick()
        if time.monotonic() > end:
            raise AssertionError(f"not so far after {seconds} s: {job.snapshot}")
        time.sleep(0.005)


class WithClip(SceneCase):
    """A recording of a cube that falls, so that every button has what it needs."""

    def clip(self):
        corners = numpy.array([[x, y, z] for x in (-0.1, 0.1) for y in (-0.1, 0.1)
                               for z in (0.2, 0.4)])
        times = numpy.arange(6) / 24.0
        fall = numpy.outer(times**2, (0.0, 0.0, -4.9))
        files.write_npz(os.path.join(self.folder, "clip.npz"),
                        {"positions": corners + fall[:, None], "times": times})
        capture = self.settings.captures.add()
        capture.name, capture.filepath = "clip", "//clip.npz"
        capture.use_noise, capture.noise = True, 5e-4
        fit_rows.refresh(self.settings)


@needs_library
class SecondsTest(WithClip):
    """With the library, and a body that takes it seconds to fill."""

    def setUp(self):
        super().setUp()
        bpy.ops.mesh.primitive_ico_sphere_add(radius=0.1, subdivisions=5, location=(0.0, 0.0, 0.3))
        item = bpy.context.active_object
        select(item)
        self.body(item)
        self.clip()

    def filling(self):
        """Seconds that the count takes, with as many particles as make it one at least."""
        for cells in (60, 80, 110, 150, 200):
            self.settings.solver.particle_separation = 0.2 / cells
            document, folder = self.document()
            began = time.monotonic()
            native.estimate({**document, "task": "simulate"}, folder)
            taken = time.monotonic() - began
            if taken > 1.0:
                return taken
        return self.fail(f"{taken} s are too quick to tell: take more particles")

    def test_the_buttons_do_not_wait(self):
        filling = self.filling()
        for name in BUTTONS:
            with self.subTest(name):
                began = time.monotonic()
                _stub, job = pressed(name)
                took = time.monotonic() - began
                self.assertLess(took, 0.5 * filling)
                job.tick()
                self.assertEqual((job.state, job.snapshot.stage), (State.RUNNING, "Filling"))
                self.assertIs(jobs.registry.running, job)
                began = time.monotonic()
                job.cancel()
                job.tick()
                self.assertIs(job.state, State.CANCELLED)
                self.assertLess(time.monotonic() - began, 0.5 * filling)

    def test_estimate_does_not_wait(self):
        """Nor does it when it is cancelled."""
        filling = self.filling()
        began = time.monotonic()
        _stub, job = pressed("estimate")
        job.tick()
        self.assertLess(time.monotonic() - began, 0.5 * filling)
        self.assertEqual((job.state, job.snapshot.stage), (State.RUNNING, "Counting particles"))
        began = time.monotonic()
        job.cancel()
        tick_until(job, lambda: job.ended)
        self.assertIs(job.state, State.CANCELLED)
        self.assertLess(time.monotonic() - began, 0.5 * filling)

    def test_the_refusal_arrives_with_the_job(self):
        self.settings.solver.particle_separation = 0.2 / 60
        with mock.patch.object(machine, "free_memory", lambda: 2e6):
            stub, job = pressed("bake")
            tick_until(job, lambda: job.ended)
        self.assertFalse(job.begun)
        stub._finish(bpy.context, job)
        self.assertIn("and 2.0 MB are free", self.error())
        self.assertIn("particles", bpy.context.window_manager.matterfit.estimate)


class GateTest(JobCase, WithClip):
    """native.estimate ends when the test says so."""

    def setUp(self):
        super().setUp()
        self.clip()
        self.gate = threading.Event()
        self.addCleanup(self.gate.set)
        self.told = {"bytes": 1000, "particles": 8}

        def estimate(*_arguments):
            if not self.gate.wait(20.0):
                raise JobError("the test did not open the gate: the button waits for the count")
            if isinstance(self.told, JobError):
                raise self.told
            return self.told

        patch = mock.patch.object(native, "estimate", estimate)
        patch.start()
        self.addCleanup(patch.stop)

    def session(self):
        return bpy.context.window_manager.matterfit

    def test_runs_after_the_count(self):
        for name in BUTTONS:
            with self.subTest(name):
                self.gate.clear()
                self.session().estimate = ""
                self.started.clear()
                self.backend.frames = [1, 1, 1]
                _stub, job = pressed(name)
                job.tick()
                self.assertEqual(job.snapshot.stage, "Filling")
                self.assertEqual((self.started, job.begun, self.session().estimate), ([], False, ""))
                self.gate.set()
                tick_until(job, lambda job=job: job.ended)
                self.assertEqual((len(self.started), job.begun, job.state), (1, True, State.DONE))
                self.assertIn("8 particles", self.session().estimate)

    def test_what_the_count_refuses_is_reported_as_before(self):
        """In the panel's words, in Status, with nothing left over."""
        self.told = JobError("scene.bodies[0]: the mesh has no inside", 2)
        self.gate.set()
        for name in BUTTONS:
            self.fails(getattr(bpy.ops.matterfit, name), ["'Cube': the mesh has no inside"])
        self.assertEqual(self.started, [])
        self.assertEqual(self.settings.fit.run.folder, "")

    def test_cancelled_onto_a_new_take(self):
        """The take that was added for it goes with its folder; the finished one is shown again."""
        take, folder = self.cached()
        take.baked = True
        files.write_json(os.path.join(folder, "manifest.json"),
                         {"files": {}, "complete": True, "frames_baked": 5})
        self.settings.compare.done = True
        before = tree(folder)
        stub, job = pressed("bake")
        self.assertEqual((len(self.settings.takes), self.settings.take_index), (2, 1))
        added = job.folder
        self.assertTrue(os.path.isdir(added))
        job.cancel()
        job.tick()
        self.assertEqual(stub._finish(bpy.context, job), {"CANCELLED"})
        self.assertEqual((len(self.settings.takes), self.settings.take_index), (1, 0))
        self.assertFalse(os.path.exists(added))
        self.assertEqual(tree(folder), before)
        self.assertFalse(job.resumable, "there is nothing to resume")

    def test_cancelled_over_what_was_baked(self):
        """The document, the inputs and the comparison are those of the results."""
        _take, folder = self.cached()
        self.settings.compare.done = True
        before = tree(folder)
        self.scene.frame_end = 4
        stub, job = pressed("bake", onto="REPLACE")
        job.cancel()
        job.tick()
        stub._finish(bpy.context, job)
        self.assertEqual(tree(folder), before)
        self.assertTrue(self.settings.compare.done)
        self.assertFalse(job.resumable)

    def test_a_resume_that_is_cancelled_can_be_resumed(self):
        self.cached()
        _stub, job = pressed("resume")
        job.cancel()
        job.tick()
        self.assertTrue(job.resumable)

    def test_a_take_that_is_gone_meanwhile(self):
        """Removed by the artist while its particles are counted."""
        _stub, job = pressed("bake")
        self.settings.takes.clear()
        self.assertEqual(takes.find(job.folder), (None, None))
        job.cancel()
        job.tick()
        _stub._finish(bpy.context, job)
        self.assertEqual(len(self.settings.takes), 0)
