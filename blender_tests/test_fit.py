# SPDX-License-Identifier: GPL-3.0-or-later
"""Fit, Cancel, Resume, and what they found."""

import contextlib
import io
import os
from unittest import mock

import bpy
import fake_fit
from matterfit import jobs, native, ops, scene_job
from matterfit.io import files, fit_results, number_text, presets, takes
from matterfit.io.words import owner_and_label
from matterfit.jobs import JobError
from matterfit.ui import fit_overlay
from support import tree
from test_fit_document import FitCase
from test_operators import Backend


class FakeFitCase(FitCase):
    """A fit that computes nothing: it leaves the files of fake_fit."""

    def setUp(self):
        super().setUp()
        self.started = []
        self.results = {}
        self.backend = None

        def start(path, **options):
            folder = os.path.dirname(path)
            self.started.append((files.read_json(path), options))
            return self.backend or Backend(
                frames=(0, 0), work=lambda: fake_fit.write(folder, **self.results))

        for name, value in (("start", start), ("require", lambda: None),
                            ("estimate", lambda *_arguments: {"bytes": 1, "particles": 8})):
            patch = mock.patch.object(native, name, value)
            patch.start()
            self.addCleanup(patch.stop)
        # Presets of the person who runs the tests stay as they are.
        patch = mock.patch.object(presets, "user_folder",
                                  lambda: os.path.join(self.folder, "presets"))
        patch.start()
        self.addCleanup(presets.forget)
        self.addCleanup(patch.stop)
        presets.forget()

    @property
    def run_folder(self):
        return takes.locate(self.fit.run).folder

    def fitted(self, **results):
        self.results = results
        self.assertEqual(bpy.ops.matterfit.fit(), {"FINISHED"}, self.error())
        files.write_json(os.path.join(self.run_folder, "manifest.json"), {"files": {}})

    def cancelled(self, work=None, operator="fit"):
        """Runs a fit that is cancelled after `work()`."""
        self.backend = Backend(frames=(0, 0), status=jobs.EXIT_CANCELLED, work=work)
        self.assertEqual(getattr(bpy.ops.matterfit, operator)(), {"CANCELLED"})
        self.backend = None

    @property
    def job(self):
        return jobs.registry.current

    def report(self):
        return bpy.context.window_manager.matterfit.last_report


class RunTest(FakeFitCase):
    def test_fit(self):
        """A cache of its own, beside the takes'; the scene stays as it was."""
        take = takes.ensure_active(self.settings)
        self.fitted()
        document, options = self.started[0]
        self.assertEqual((document["task"], options["restart"]), ("fit", 2))
        self.assertEqual(take.folder, "")
        self.assertTrue(self.fit.run.folder.startswith("//cache_matterfit_"))
        self.assertTrue(self.fit.done)
        self.assertEqual(self.settings.bodies[0].material.E, 1e5)
        self.assertIn("16 → 0.75 mm", self.report())

    def test_without_hold_out(self):
        self.fitted(held_out=False)
        self.assertIn("Fitted error 8 → 0.5 mm", self.report())

    def test_the_fit_throws_what_the_take_throws(self):
        bpy.ops.matterfit.add_take()
        self.settings.body_index = 0
        bpy.ops.matterfit.add_throw()
        self.settings.takes[0].throws[0].velocity = (4.0, 0.0, 0.0)
        self.fitted()
        self.assertEqual(self.started[0][0]["scene"]["bodies"][0]["velocity"], [4, 0, 0])

    def test_cancel_keeps_the_best(self):
        self.cancelled(lambda: fake_fit.write_cancelled(self.run_folder))
        self.assertTrue(self.job.resumable)
        self.assertEqual(self.job.resume, "matterfit.resume_fit")
        self.assertTrue(self.fit.done)
        result = fit_results.load(self.run_folder)
        self.assertEqual(result.status, "cancelled")
        self.assertTrue(all(estimate.observable for estimate in result.estimates))
        self.assertEqual(bpy.ops.matterfit.apply_fit(), {"FINISHED"})

    def test_resume(self):
        """The same document into the same folder, without beginning afresh."""
        self.assertFalse(bpy.ops.matterfit.resume_fit.poll())
        self.fitted()
        folder = self.run_folder
        self.assertEqual(bpy.ops.matterfit.resume_fit(), {"FINISHED"})
        (first, _options), (second, options) = self.started
        self.assertEqual((first, options["restart"]), (second, 0))
        self.assertEqual(self.run_folder, folder)

    def test_a_refused_resume(self):
        self.fitted()
        self.backend = Backend(status=2, error="other inputs. Run with --restart to replace them")
        message = self.fails(bpy.ops.matterfit.resume_fit, ["Press Fit to begin afresh"])
        self.assertNotIn("--restart", message)
        self.assertTrue(self.fit.done, "the results in the folder are those of before")

    def test_what_could_not_be_completed(self):
        """Without a result nothing is offered."""
        self.fitted()
        os.remove(os.path.join(self.run_folder, "result.json"))
        self.backend = Backend(status=3, error="unstable at the start")
        self.fails(bpy.ops.matterfit.fit, ["unstable at the start"])
        self.assertFalse(self.fit.done)
        self.assertFalse(bpy.ops.matterfit.apply_fit.poll())

    def test_the_result_of_an_earlier_fit_is_not_shown(self):
        """A fit that has begun, and ends without a result of its own, shows none."""
        self.fitted()
        self.settings.bodies[0].material.E = 2e5
        self.backend = Backend(frames=(0, 0), status=3, error="unstable at frame 3",
                               work=lambda: fake_fit.write_checkpoint(self.run_folder))
        self.fails(bpy.ops.matterfit.fit, ["unstable at frame 3"])
        self.assertFalse(self.fit.done)

    def test_what_was_before_stays_where_nothing_comes_of_a_fit(self):
        """Refused by us, refused by the library, cancelled at once: the result, job.json and the
        inputs are those of before, and Apply knows what they are of."""
        self.fitted()
        folder, before = self.run_folder, tree(self.run_folder)
        first = self.settings.takes[0].name
        bpy.ops.matterfit.add_take()
        self.settings.body_index = 0
        bpy.ops.matterfit.add_throw()
        bpy.data.meshes[0].vertices[0].co.x *= 1.1
        self.settings.bodies[0].material.E = 2e5

        def refused():
            self.backend = Backend(status=2, error="scene.bodies[0]: no")
            self.fails(bpy.ops.matterfit.fit, ["'Cube': no"])
            self.backend = None

        def refused_at_once():
            with mock.patch.object(native, "estimate", lambda *_arguments: {"bytes": 10**15}):
                self.fails(bpy.ops.matterfit.fit, ["limit is 8.0 GB"])

        for end in (refused, refused_at_once, self.cancelled,
                    lambda: self.cancelled(operator="resume_fit")):
            end()
            self.assertEqual(tree(folder), before)
            self.assertEqual((self.run_folder, self.fit.run.name), (folder, first))
            self.assertEqual(len(self.fit.run.throws), 0)
            self.assertTrue(self.fit.done)
        self.assertFalse(self.job.resumable)
        bpy.ops.matterfit.apply_fit()
        self.assertEqual(tuple(self.settings.takes[1].throws[0].velocity), (0.0, 0.0, 0.0))
        self.assertEqual(tuple(self.settings.bodies[0].velocity), (1.0, 2.0, 3.0))

    def test_a_first_fit_that_is_refused_leaves_nothing(self):
        before = sorted(os.listdir(self.folder))
        self.backend = Backend(status=2, error="no")
        self.fails(bpy.ops.matterfit.fit, ["no"])
        self.assertEqual(self.fit.run.folder, "")
        self.assertEqual(sorted(os.listdir(self.folder)), before)

    def test_a_cancelled_second_fit_keeps_its_own_document(self):
        """What lies in the folder is of the second fit then, and Resume goes on with that."""
        self.fitted()
        self.settings.bodies[0].material.E = 2e5
        self.cancelled(lambda: fake_fit.write_cancelled(self.run_folder))
        document = files.read_json(os.path.join(self.run_folder, "job.json"))
        self.assertEqual(document["scene"]["bodies"][0]["material"]["E"], 2e5)
        self.assertTrue(self.job.resumable)
        self.assertTrue(self.fit.done)

    def test_cancelled_before_there_is_a_checkpoint(self):
        """There is nothing to resume, and Resume is not promised."""
        self.cancelled()
        self.assertFalse(self.job.resumable)
        self.assertFalse(self.fit.done)

    def test_the_window_closes(self):
        """The best so far is there when the file is opened again."""
        operator = next(cls for cls in ops.CLASSES if cls.bl_idname == "matterfit.fit")
        stub = mock.Mock(spec=operator)
        stub.task, stub.resume_operator, stub._steps = operator.task, operator.resume_operator, None
        for name in ("begin_at_scene", "settings_of", "show_result", "start", "stopped",
                     "taken_away"):
            function = getattr(operator, name)
            setattr(stub, name, lambda *arguments, call=function: call(stub, *arguments))
        self.backend = Backend(frames=[0] * 1000)
        self.backend.wait = lambda: (self.backend.frames.clear(),
                                     fake_fit.write_cancelled(self.run_folder))
        stub._job = jobs.drained(operator.begin(stub, bpy.context)).start()
        while not stub._job.begun:
            stub._job.tick()
        operator.cancel(stub, bpy.context)
        self.assertTrue(self.fit.done)

    def test_write_job(self):
        """What Fit would run, for a farm; a result of another job is not shown as its."""
        self.assertEqual(bpy.ops.matterfit.write_fit_job(), {"FINISHED"}, self.error())
        path = os.path.join(self.run_folder, "job.json")
        self.assertEqual(self.report(), path)
        written = files.read_json(path)
        self.assertEqual(written["task"], "fit")
        self.fitted()
        self.assertEqual(self.started[0][0], written)
        bpy.ops.matterfit.write_fit_job()
        self.assertTrue(self.fit.done)
        self.settings.bodies[0].material.E = 2e5
        bpy.ops.matterfit.write_fit_job()
        self.assertFalse(self.fit.done)
        before, self.capture.enabled = tree(self.run_folder), False
        self.fails(bpy.ops.matterfit.write_fit_job, ["no capture to fit to"])
        self.assertEqual(tree(self.run_folder), before)

    def test_what_to_go_on_with(self):
        """Without a window the job.json is named, and the saved scene shows no earlier result."""
        self.fitted()
        self.settings.bodies[0].material.E = 2e5
        scene = scene_job.SceneJob("fit", True)
        fake_fit.write_checkpoint(self.run_folder)
        with contextlib.redirect_stderr(io.StringIO()) as words:
            scene.end(mock.Mock(status=3))
        self.assertIn(f"to go on: fit {os.path.join(self.run_folder, 'job.json')}",
                      words.getvalue())
        self.reopen()
        self.assertFalse(self.fit.done)
        self.assertTrue(fit_results.is_unfinished(self.run_folder))

    def test_resume_after_apply(self):
        """It would be refused: Apply says so."""
        self.fitted()
        bpy.ops.matterfit.apply_fit()
        self.assertNotIn("Resume", self.report())
        self.settings.bodies[0].material.E = 2e5
        self.cancelled(lambda: fake_fit.write_cancelled(self.run_folder))
        bpy.ops.matterfit.apply_fit()
        self.assertIn("undo this before Resume", self.report())

    def test_a_copied_scene_shows_the_fit(self):
        self.fitted()
        bpy.ops.scene.new(type="FULL_COPY")
        self.fails(bpy.ops.matterfit.resume_fit, ["scene that was copied", "Press Fit"])

    def test_saving_is_advised(self):
        """A fit whose folder is not in the saved file cannot be found again after a crash."""
        reports = []
        self.cancelled(lambda: reports.append(self.report()))
        self.assertIn("Save the .blend file now", reports[0])

    def test_refused_before_it_starts(self):
        self.settings.captures.clear()
        self.fails(bpy.ops.matterfit.fit, ["no capture to fit to"])
        self.assertEqual(self.started, [])

    def test_save_as_links(self):
        self.fitted()
        self.save("scene.blend")
        self.save("copy.blend")
        self.assertTrue(takes.locate(bpy.context.scene.matterfit.fit.run).linked)
        self.settings = bpy.context.scene.matterfit
        self.fails(bpy.ops.matterfit.resume_fit, ["linked, read-only", "Press Fit"])

    def test_free(self):
        """Ours goes, what was applied stays, and so does what is not ours."""
        self.fitted()
        folder = self.run_folder
        bpy.ops.matterfit.apply_fit()
        files.write_bytes(os.path.join(folder, "notes.txt"), b"mine")
        bpy.ops.matterfit.free_fit()
        self.assertEqual(list(tree(folder)), ["notes.txt"])
        self.assertFalse(self.fit.done)
        self.assertAlmostEqual(self.settings.bodies[0].material.E, fake_fit.E, delta=1.0)
        os.remove(os.path.join(folder, "notes.txt"))
        bpy.ops.matterfit.free_fit()
        self.assertEqual(self.fit.run.folder, "")

    def test_greyed_while_a_job_runs(self):
        self.fitted()
        names = ("fit", "resume_fit", "free_fit", "apply_fit", "save_material", "add_preset")
        for name in names:
            self.assertTrue(getattr(bpy.ops.matterfit, name).poll(), name)
        jobs.registry.add(jobs.Job("long", lambda: Backend(frames=[1] * 1000))).start()
        for name in names:
            self.assertFalse(getattr(bpy.ops.matterfit, name).poll(), name)

    def test_running_fit(self):
        """The curve of the panel and the viewport is that of the job that runs."""
        self.fitted()
        self.assertEqual(fit_overlay.running_fit(self.settings), "")
        job = jobs.Job("long", lambda: Backend(frames=[1] * 1000), folder=self.run_folder)
        job.stale = fit_results.history_stamp(self.run_folder)
        jobs.registry.add(job).start()
        self.assertEqual(fit_overlay.running_fit(self.settings), self.run_folder)
        self.assertEqual(fit_overlay.live_curve(self.run_folder), [], "it is of the fit before")
        fake_fit.write_history(self.run_folder, [{"stage": "a", "rms_mm": 2.0}])
        self.assertEqual(len(fit_overlay.live_curve(self.run_folder)), 1)


class ResultTest(FakeFitCase):
    def test_read(self):
        self.fitted()
        result = fit_results.load(self.run_folder)
        self.assertEqual(result.estimates[0].text, "234600 ± 1200 Pa")
        self.assertFalse(result.estimates[1].observable)
        self.assertIsNone(result.estimates[1].interval)
        self.assertEqual(result.held_out.after["mean_mm"], 0.75)

    def test_damaged(self):
        self.fitted()
        path = os.path.join(self.run_folder, "result.json")
        for content, words in (({"status": "done"}, "holds no result of a fit"),
                               ({"fit": {"parameters": [{"unit": "Pa"}]}}, "KeyError: 'path'")):
            files.write_json(path, content)
            with self.assertRaisesRegex(JobError, words):
                fit_results.load(self.run_folder)
            self.assertIsNone(fit_results.load_quietly(self.run_folder))

    def test_history(self):
        """Refused steps are no points of the curve; a line that is being written is not read."""
        self.fitted()
        found = fit_results.segments(fit_results.history(self.run_folder))
        self.assertEqual([segment.stage for segment in found], ["frames 1-8", "frames 1-20"])
        self.assertEqual(found[0].places, [0, 1, 2, 4, 5, 6, 7])
        self.assertEqual(found[1].places[0], 8)
        path = fake_fit.write_history(self.run_folder, [{"stage": "a", "rms_mm": 2.0},
                                                        {"stage": "a", "rms_mm": None}])
        with open(path, "a", encoding="utf-8") as stream:
            stream.write('{"stage": "a", "rms')
        self.assertEqual(len(fit_results.history(self.run_folder)), 2)
        found = fit_results.segments(fit_results.history(self.run_folder))
        self.assertEqual([segment.errors for segment in found], [[2.0]])
        self.assertEqual(fit_results.history(self.folder), [])

    def test_values_with_errors(self):
        for value, error, unit, expected in (
                (294312.0, 1203.0, "Pa", "294300 ± 1200 Pa"),
                (2.943e7, 1.2e5, "Pa", "(2.943 ± 0.012)e7 Pa"),
                (0.2004, 0.0123, "", "0.200 ± 0.012"),
                (1.9999, 0.01, "m/s", "2.000 ± 0.010 m/s"),
                (3.2e-6, 1.1e-7, "s", "(3.20 ± 0.11)e-6 s"),
                (5.0, None, "Pa s", "5 Pa s"), (0.0, 0.5, "m/s", "0.00 ± 0.50 m/s"),
                (-0.0001, 0.012, "m/s", "0.000 ± 0.012 m/s"), (-0.0, None, "", "0")):
            self.assertEqual(number_text.value_text(value, error, unit), expected)
        for value, error, expected in ((232148.3, 1234.0, "232100"), (0.98041, 0.01, "0.980"),
                                       (2.943e7, 1.2e5, "2.943e+07"), (5.0, None, "5"),
                                       (1.849e-6, 1.849e-6, "1.8e-06"), (-0.0001, 0.01, "0.000"),
                                       (-0.0, None, "0")):
            self.assertEqual(number_text.rounded(value, error), expected)

    def test_names(self):
        self.assertEqual(owner_and_label(self.settings, "bodies.Cube.velocity[2]"),
                         ("Cube", "Velocity Z"))
        self.assertEqual(owner_and_label(self.settings, "material.E"),
                         ("Cube", "Young's Modulus"))
        self.assertEqual(owner_and_label(self.settings, "colliders.ground.contact.mu"),
                         ("ground", "Friction"))
