# SPDX-License-Identifier: GPL-3.0-or-later
"""Cancel of every long job while the library is at work on it: it ends, as cancelled, and what was
there before is there still."""

import time

import bpy
from matterfit import native
from matterfit.io import cache, fit_results, takes
from matterfit.jobs import State
from support import needs_library
from test_filling import WithClip, pressed, tick_until

MOST = 1.0  # seconds of the processor that the library may go on for: it may have to share it


@needs_library
class CancelTest(WithClip):
    def setUp(self):
        super().setUp()
        self.jelly(separation=0.0125, location=(0.0, 0.0, 0.3))
        self.scene.frame_end = 30
        self.settings.output.surface = False
        self.clip()
        for row in self.settings.fit.parameters:
            row.enabled = row.key in ("material.E", "velocity")

    def cancelled(self, name, at=None):
        """The job of a button that is cancelled when `at(job)`; by default in the library's first stage."""
        stub, job = pressed(name)
        tick_until(job, lambda: job.ended or (
            job.snapshot.stage not in ("", "Filling") if at is None else at(job)), 120.0)
        self.assertFalse(job.ended, f"{name} ended before it could be cancelled: {job.error}")
        asked = time.process_time()
        job.cancel()
        self.assertIs(job.state, State.CANCELLING)
        tick_until(job, lambda: job.ended)
        self.assertLess(time.process_time() - asked, MOST, f"{name}, {job.snapshot.stage}")
        self.assertIs(job.state, State.CANCELLED, job.error)
        self.assertEqual(stub._finish(bpy.context, job), {"CANCELLED"})
        self.assertEqual(self.error(), "")
        return job

    def cancelled_while_filling(self, spent):
        """A bake that is cancelled when the library has filled bodies for `spent` seconds of the
        processor, analysis of meshes in it."""
        began = []

        def filling(job):
            if job.begun and job.snapshot.stage == "Filling bodies" and not began:
                began.append(time.process_time())
            return bool(began) and time.process_time() - began[0] > spent

        job = self.cancelled("bake", filling)
        self.assertEqual(job.snapshot.stage, "Filling bodies")

    def test_bake_and_resume(self):
        """Each keeps its frames."""
        job = self.cancelled("bake", lambda job: job.snapshot.frame >= 4)
        self.assertTrue(job.resumable)
        first = cache.manifest(job.folder)["frames_done"]
        self.assertGreater(first, 0)
        job = self.cancelled("resume", lambda job: job.snapshot.frame >= first + 4)
        self.assertTrue(job.resumable)
        self.assertGreater(cache.manifest(job.folder)["frames_done"], first)
        self.assertFalse(self.settings.takes[0].baked)

    def test_while_a_mesh_is_filled(self):
        """A mesh of a million triangles, filled for seconds."""
        self.settings.bodies.clear()
        bpy.ops.mesh.primitive_monkey_add(size=2.0, location=(0.0, 0.0, 2.0))
        item = bpy.context.active_object
        item.modifiers.new("Solidify", "SOLIDIFY").thickness = 0.2
        item.modifiers.new("Subdivision", "SUBSURF")
        self.body(item)
        self.settings.solver.particle_separation = 0.03
        self.cancelled_while_filling(0.5)

    def test_while_a_mesh_is_analysed(self):
        """A mesh of two million triangles, before anything of it is filled."""
        self.settings.bodies.clear()
        bpy.ops.mesh.primitive_grid_add(x_subdivisions=700, y_subdivisions=700, size=2.0,
                                        location=(0.0, 0.0, 2.0))
        item = bpy.context.active_object
        item.modifiers.new("Solidify", "SOLIDIFY").thickness = 0.3
        self.body(item)
        self.settings.solver.particle_separation = 0.05
        self.cancelled_while_filling(0.3)

    def test_while_the_simulation_is_prepared(self):
        """Half a million particles, which takes a second."""
        self.settings.output.mesh = False
        self.settings.solver.particle_separation = 0.0025
        job = self.cancelled("bake", lambda job: job.snapshot.stage == "Preparing")
        self.assertEqual(job.snapshot.stage, "Preparing")

    def test_preview_and_compare(self):
        self.cancelled("preview", lambda job: job.snapshot.frame >= 2)
        self.assertFalse(self.settings.preview.baked)
        self.cancelled("compare", lambda job: job.snapshot.frame >= 2)
        self.assertFalse(self.settings.compare.done or self.settings.takes[0].compared)

    def test_fit(self):
        """Before it has found anything nothing is left of it, later the best so far."""
        self.cancelled("fit")
        self.assertEqual(self.settings.fit.run.folder, "")
        job = self.cancelled("fit", lambda job: len(fit_results.history(job.folder)) >= 2)
        self.assertTrue(job.resumable and self.settings.fit.done)
        self.assertEqual(fit_results.load(job.folder).status, "cancelled")

    def test_check(self):
        self.settings.fit.check = "what was checked before"
        self.cancelled("check_fit")
        self.assertEqual(self.settings.fit.check, "what was checked before")

    def test_diagnose(self):
        job = self.cancelled("diagnose")
        self.assertEqual(job.status, 130)
        self.assertFalse(self.settings.fit.done)

    def test_batch(self):
        bpy.ops.matterfit.add_axis(quantity="Cube\tvelocity[2]")
        self.settings.batch.axes[0].values = "-1,-2,-3"
        self.settings.batch.at_once = 1
        job = self.cancelled("run_batch")
        self.assertTrue(job.resumable)
        self.assertLess(sum(take.baked for take in self.settings.takes), 3)
        self.assertTrue(takes.locate(self.settings.batch.run).exists)

    def test_nothing_of_it_runs_on(self):
        """The library takes the next job at once."""
        self.cancelled("bake")
        self.assertIn("particles", native.estimate(*self.document()))
