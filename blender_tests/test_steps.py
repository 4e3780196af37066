# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene is read in slices, between which the window lives."""

import os
from unittest import mock

import bpy
import numpy
from matterfit import jobs, native
from matterfit.io import files, fit_rows, job_document, job_writer, still_there, takes
from matterfit.jobs import JobError, State
from support import SceneCase, tree
from test_filling import operator_stub


class StepsCase(SceneCase):
    """A jelly and a collider that deforms over 20 frames, one frame a slice."""

    def setUp(self):
        super().setUp()
        self.jelly(separation=0.1)
        self.wall = self.cube("Wall", location=(0.0, 0.0, 0.0))
        self.wall.modifiers.new("Wave", "WAVE")
        self.body(self.wall, "COLLIDER")
        self.scene.frame_end = 20
        self.scene.frame_set(7)
        slices = job_writer.SLICE
        job_writer.SLICE = 0.0
        self.addCleanup(setattr, job_writer, "SLICE", slices)
        self.take = takes.ensure_active(self.settings)
        self.folder_of_cache = takes.claim(self.take)

    def building(self):
        return job_document.building(self.scene, self.take, self.folder_of_cache, "bake")


class WalkTest(StepsCase):
    def test_the_same_document(self):
        """In slices as at once, and the frame is the one that it was."""
        at_once, _folder = self.document()
        shares = []
        steps = self.building()
        while True:
            try:
                shares.append(next(steps).fraction)
            except StopIteration as end:
                self.assertEqual(end.value, at_once)
                break
        self.assertEqual(len(shares), 21)  # once the first, then all
        self.assertEqual((shares, shares[-1]), (sorted(shares), 1.0))
        self.assertEqual(self.scene.frame_current, 7)

    def test_hidden_objects_stay_hidden_in_between(self):
        self.wall.hide_viewport = True
        self.wall.hide_set(True)
        for snapshot in self.building():
            self.assertTrue(self.wall.hide_viewport and self.wall.hide_get())
            self.assertEqual(snapshot.last_frame, 20)

    def test_the_playhead_stays(self):
        """It is the artist's in between, who may move it."""
        for snapshot in self.building():
            self.assertEqual(self.scene.frame_current, 7 if snapshot.frame < 10 else 3)
            if snapshot.frame == 9:
                self.scene.frame_set(3)
        self.assertEqual(self.scene.frame_current, 3)

    def test_a_simulation_of_blenders(self):
        """Cloth goes on from the frame before only: the playhead goes with it until all is read."""
        self.cube("Cloth", location=(3.0, 0.0, 0.0)).modifiers.new("Cloth", "CLOTH")
        found = [self.scene.frame_current for _snapshot in self.building()]
        self.assertEqual(found, [1, *range(1, 21)])
        self.assertEqual(self.scene.frame_current, 7)

    def test_left(self):
        """What was written by then is taken back, the frame too."""
        for leave in (lambda steps: steps.close(),
                      lambda steps: self.assertRaises(JobError, steps.throw, JobError("stop"))):
            steps = self.building()
            for _ in range(10):
                next(steps)
            self.assertGreater(len(os.listdir(os.path.join(self.folder_of_cache, "input"))), 3)
            leave(steps)
            self.assertEqual(self.scene.frame_current, 7)
            self.assertFalse(os.path.exists(os.path.join(self.folder_of_cache, "input")))


class StepRunTest(StepsCase):
    def job(self):
        self.run_of_steps = jobs.StepRun(self.building(), still_there.watch, "changed")
        return jobs.Job("Bake", lambda: self.run_of_steps).start()

    def test_to_the_end(self):
        job = self.job()
        ticks = 0
        while not job.ended:
            job.tick()
            ticks += 1
        self.assertEqual((job.state, ticks), (State.DONE, 22))
        self.assertEqual(self.run_of_steps.value["scene"]["frames"], [1, 21])

    def test_cancel(self):
        """One more slice, at most."""
        job = self.job()
        for _ in range(5):
            job.tick()
        job.cancel()
        job.tick()
        self.assertIs(job.state, State.CANCELLED)
        self.assertEqual(self.scene.frame_current, 7)

    def test_what_was_held_is_gone(self):
        """An object or a row is removed in between, undo was pressed, or another scene is shown."""
        other = bpy.data.scenes.new("Other")
        layer = self.scene.view_layers.new("Layer")
        for change in (lambda: bpy.data.objects.remove(self.wall), still_there.undone,
                       lambda: self.settings.bodies.remove(1), self.settings.takes.add,
                       lambda: setattr(bpy.context.window, "scene", other),
                       lambda: setattr(bpy.context.window, "view_layer", layer)):
            with self.subTest(change):
                job = self.job()
                job.tick()
                self.assertIs(job.state, State.RUNNING)
                change()
                job.tick()
                self.assertEqual((job.state, job.error), (State.FAILED, "changed"))
                self.assertEqual(self.scene.frame_current, 7)
                bpy.context.window.scene = self.scene
                bpy.context.window.view_layer = self.scene.view_layers[0]
                self.take = self.settings.takes[0]
                if "Wall" not in bpy.data.objects:
                    self.settings.bodies[1].object = self.wall = self.cube("Wall")

    def test_what_it_changes_itself(self):
        """The button adds a take, and with it a row, before anything is read."""
        def steps():
            self.settings.takes.add()
            yield jobs.Snapshot()
            self.cube("Another")
            yield jobs.Snapshot()
            return 3

        run = jobs.StepRun(steps(), still_there.watch, "changed")
        self.assertEqual((run.head_start(10.0).status, run.value), (jobs.EXIT_DONE, 3))

    def test_what_does_not_matter(self):
        """Objects that are added or renamed, and what a batch lists."""
        job = self.job()
        job.tick()
        for change in (lambda: self.cube("Another"), lambda: setattr(self.wall, "name", "Rock"),
                       self.settings.batch.results.add):
            change()
            job.tick()
            self.assertIs(job.state, State.RUNNING)
        while not job.ended:
            job.tick()
        self.assertIs(job.state, State.DONE)

    def test_values_may_change(self):
        """A place or a number that is typed meanwhile is no reason to stop."""
        job = self.job()
        job.tick()
        self.wall.location.x = 1.0
        self.settings.bodies[0].material.E *= 2.0
        numpy.testing.assert_equal(self.wall.location.x, 1.0)
        while not job.ended:
            job.tick()
        self.assertIs(job.state, State.DONE)

    def test_a_refusal(self):
        self.settings.solver.particle_separation = 1e-6
        outcome = jobs.StepRun(self.building(), lambda: lambda: True, "").head_start(10.0)
        self.assertEqual(outcome.status, jobs.EXIT_INPUT)
        self.assertIn("nothing can be simulated below", outcome.error)

    def test_an_error_that_nobody_foresaw(self):
        def broken():
            yield jobs.Snapshot()
            raise ValueError("odd")

        outcome = jobs.StepRun(broken(), lambda: lambda: True, "").head_start(10.0)
        self.assertEqual((outcome.status, outcome.error), (jobs.EXIT_COMPUTE, "ValueError: odd"))


class LinkedTest(StepsCase):
    """A take, or a fit, that another .blend file made, and reading that ends without a job."""

    def setUp(self):
        super().setUp()
        patch = mock.patch.object(native, "require", lambda: None)
        patch.start()
        self.addCleanup(patch.stop)

    def link(self, run):
        """`run` shows what it did in another file, with results there; what it says of that."""
        folder = takes.claim(run)
        files.write_json(os.path.join(folder, "manifest.json"),
                         {"files": {}, "frames_baked": 3, "complete": True})
        run.baked, run.frames_done = True, 3
        self.save("scene.blend")
        self.save("copy.blend")
        self.assertTrue(takes.locate(run).linked)
        return run.folder, run.owner, run.baked, run.frames_done

    def ends(self):
        """The ways in which reading ends: the scene was changed, cancelled, an unforeseen error."""
        def broken(_writer):
            yield jobs.Snapshot()
            raise ValueError("odd")

        return ((still_there.undone, None, jobs.EXIT_INPUT), (None, None, jobs.EXIT_CANCELLED),
                (lambda: None, broken, jobs.EXIT_COMPUTE))

    def check(self, name, run):
        kept, before = self.link(run), tree(self.folder)
        for change, walking, status in self.ends():
            with self.subTest(status), mock.patch.object(
                    job_writer.JobWriter, "walking", walking or job_writer.JobWriter.walking):
                steps = jobs.StepRun(operator_stub(name).begin_in_steps(bpy.context), still_there.watch, "changed")
                steps.poll()
                self.assertNotEqual(run.folder, kept[0])
                steps.cancel() if change is None else change()
                steps.wait()
                self.assertEqual(steps.outcome().status, status, steps.outcome().error)
                self.assertEqual((run.folder, run.owner, run.baked, run.frames_done), kept)
                self.assertEqual(tree(self.folder), before)
                self.assertEqual(len(self.settings.takes), 1)

    def test_bake(self):
        self.check("bake", self.take)

    def test_fit(self):
        files.write_npz(os.path.join(self.folder, "clip.npz"),
                        {"positions": numpy.zeros((6, 8, 3)), "times": numpy.arange(6) / 24.0})
        capture = self.settings.captures.add()
        capture.name, capture.filepath = "clip", "//clip.npz"
        fit_rows.refresh(self.settings)
        self.check("fit", self.settings.fit.run)

    def test_a_take_that_was_added(self):
        """For a bake that keeps the finished one: it goes."""
        self.take.baked, self.take.frames_done = True, 3
        files.write_json(os.path.join(self.folder_of_cache, "manifest.json"),
                         {"files": {}, "frames_baked": 3, "complete": True})
        before = tree(self.folder)
        steps = jobs.StepRun(operator_stub("bake").begin_in_steps(bpy.context), still_there.watch, "changed")
        steps.poll()
        self.assertEqual((len(self.settings.takes), self.settings.take_index), (2, 1))
        still_there.undone()
        steps.wait()
        self.assertEqual((steps.outcome().error, len(self.settings.takes), self.settings.take_index),
                         ("changed", 1, 0))
        self.assertEqual(tree(self.folder), before)
