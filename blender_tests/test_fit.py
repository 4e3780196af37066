# SPDX-License-Identifier: GPL-3.0-or-later
"""Fit, Cancel, Resume, what they found, Apply, Save Material, presets of one's own."""

import contextlib
import io
import os
import signal
from unittest import mock

import bpy
import fake_fit
import numpy
from matterfit import jobs, native, ops, scene_job
from matterfit.io import diagnosis, files, fit_results, job_document, number_text, presets, takes
from matterfit.io.words import owner_and_label
from matterfit.jobs import JobError
from matterfit.ui import fit_overlay
from support import SceneCase, kill_cli, needs_library, printed_json, run_cli, tree
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


class ApplyTest(FakeFitCase):
    def test_material_and_velocity(self):
        self.fitted()
        self.settings.bodies[0].density = 777.0
        bpy.ops.matterfit.apply_fit()
        body = self.settings.bodies[0]
        self.assertAlmostEqual(body.material.E, fake_fit.E, delta=1.0)
        self.assertEqual(tuple(body.velocity), (1.0, 2.0, 3.0))
        self.assertEqual(body.material.preset, "CUSTOM")
        self.assertIn("held-out error 0.75 mm", body.material.source)
        self.assertEqual(body.density, 777.0, "what was not fitted stays")

    def test_another_law(self):
        """The whole material of the law that was found."""
        self.fit.law = "FIND"
        self.fitted(law={"law": "von_mises", "E": 2e5, "nu": 0.3, "yield_stress": 4e3,
                         "damping_shear": 5.0, "maxwell": [{"modulus": 3e3, "time": 0.2}]})
        self.assertEqual(len(fit_results.load(self.run_folder).models), 2)
        bpy.ops.matterfit.apply_fit()
        material = self.settings.bodies[0].material
        self.assertEqual((material.law, material.yield_stress, material.damping_shear),
                         ("VON_MISES", 4e3, 5.0))
        self.assertEqual(len(material.maxwell), 1)
        self.assertAlmostEqual(material.maxwell[0].time, 0.2, places=6)
        self.assertIn("material.maxwell[0].time", [row.key for row in self.fit.parameters])

    def test_what_pours_is_as_fine_as_it_was_fitted(self):
        """A fit that finds a liquid leaves the separation, so that Compare repeats its error."""
        self.fit.law = "FIND"
        self.fitted(law={"law": "newtonian", "bulk_modulus": 2e5, "viscosity": 3.0})
        solver = self.settings.solver
        before = (solver.quality, solver.particle_separation)
        bpy.ops.matterfit.apply_fit()
        self.assertEqual(self.settings.bodies[0].material.law, "NEWTONIAN")
        self.assertEqual((solver.quality, solver.particle_separation), before)
        self.assertTrue(solver.for_flows)

    def test_the_throw_of_the_take(self):
        """A velocity that came from a throw goes back to it."""
        bpy.ops.matterfit.add_take()
        self.settings.body_index = 0
        bpy.ops.matterfit.add_throw()
        self.fitted()
        bpy.ops.matterfit.add_take()
        self.settings.takes[1].throws.clear()
        bpy.ops.matterfit.apply_fit()
        throw = self.settings.takes[0].throws[0]
        self.assertEqual((throw.velocity_from, tuple(throw.velocity)), ("VALUE", (1.0, 2.0, 3.0)))
        self.assertEqual(tuple(self.settings.bodies[0].velocity), (0.0, 0.0, 0.0))

    def test_everything_else(self):
        """Placement, gravity, ground, a collider, in Blender's units."""
        self.scene.unit_settings.scale_length = 0.5
        self.body(self.cube("Ball", location=(2, 0, 0)), role="COLLIDER")
        item = bpy.data.objects["Cube"]
        item.scale = (1.0, 2.0, 1.0)
        bpy.context.view_layer.update()

        def change(scene):
            scene["bodies"][0]["density"] = 555.0
            scene["bodies"][0]["placement"] = {
                "position": [0.5, 0.0, 1.0], "rotation": [0.5**0.5, 0.0, 0.0, 0.5**0.5]}
            scene["gravity"] = [0.0, 0.0, -9.5]
            ground = next(item for item in scene["colliders"] if item["name"] == "ground")
            ground["height"] = 0.1
            ground["contact"]["mu"] = 0.7
            ball = next(item for item in scene["colliders"] if item["name"] == "Ball")
            ball["contact"]["stiffness"] = 3e6

        extra = [fake_fit.estimate(path, "", 0.0, 1.0, 0.1) for path in (
            "bodies.Cube.density", "bodies.Cube.placement.position[0]",
            "bodies.Cube.placement.rotation[2]", "gravity[2]", "colliders.ground.height",
            "colliders.ground.contact.mu", "colliders.Ball.contact.stiffness")]
        extra.append(fake_fit.estimate("captures.clip.start_frame", "frames", 1.0, 0.25, 0.1))
        self.fitted(change=change, extra=extra)
        bpy.ops.matterfit.apply_fit()
        bpy.context.view_layer.update()
        body = self.settings.bodies[0]
        solver = self.settings.solver
        self.assertEqual(body.density, 555.0)
        self.assertEqual(tuple(body.velocity), (2.0, 4.0, 6.0))
        numpy.testing.assert_allclose(item.matrix_world.translation, (1.0, 0.0, 2.0), atol=1e-6)
        numpy.testing.assert_allclose(item.rotation_euler, (0.0, 0.0, numpy.pi / 2), atol=1e-5)
        numpy.testing.assert_allclose(item.scale, (1.0, 2.0, 1.0), atol=1e-5)
        self.assertAlmostEqual(solver.gravity[2], -9.5, places=5)
        self.assertAlmostEqual(solver.ground_height, 0.2, places=6)
        self.assertAlmostEqual(solver.ground.mu, 0.7, places=6)
        ball = self.settings.bodies[1].contact
        self.assertEqual((ball.use_stiffness, ball.stiffness), (True, 3e6))
        self.assertEqual((self.capture.use_start_frame, self.capture.start_frame), (True, 0.25))

    def test_the_take_that_is_gone(self):
        """Not into the one that happens to be active."""
        self.fitted()
        self.settings.takes[0].name = "Other"
        self.fails(bpy.ops.matterfit.apply_fit, ["'Take 1'", "not among the Takes"])
        self.assertEqual(self.settings.bodies[0].material.E, 1e5)

    def test_a_body_that_is_gone(self):
        """Nothing is half applied."""
        self.fitted()
        self.settings.bodies[0].name = "Dough"
        self.fails(bpy.ops.matterfit.apply_fit, ["'Cube'", "not among the Bodies"])
        self.assertEqual(self.settings.bodies[0].material.E, 1e5)

    def test_a_collider_that_is_gone(self):
        """What was found of it goes neither onto the ground nor onto a body."""
        self.body(self.cube("Ball", location=(2, 0, 0)), role="COLLIDER")
        self.fitted(extra=[fake_fit.estimate("colliders.Ball.contact.mu", "", 0.4, 0.7, 0.1)])
        ground, ball = self.settings.solver.ground.mu, self.settings.bodies[1]
        ball.name = "Wall"
        self.fails(bpy.ops.matterfit.apply_fit, ["'Ball'", "not among the colliders"])
        ball.name, ball.role = "Ball", "BODY"
        self.fails(bpy.ops.matterfit.apply_fit, ["'Ball'", "not among the colliders"])
        self.settings.bodies[0].role = "COLLIDER"
        ball.role = "COLLIDER"
        self.fails(bpy.ops.matterfit.apply_fit, ["'Cube'", "not among the Bodies"])
        self.assertEqual(self.settings.solver.ground.mu, ground)
        self.assertEqual(self.settings.bodies[0].material.E, 1e5)

    def test_names_with_quotes(self):
        """In the words of the result."""
        self.settings.bodies[0].name = 'the "cube"'
        self.fitted()
        path = os.path.join(self.run_folder, "result.json")
        result = files.read_json(path)
        for entry in result["fit"]["parameters"]:
            entry["path"] = entry["path"].replace('the "cube"', "'the \"cube\"'")
        files.write_json(path, result)
        bpy.ops.matterfit.apply_fit()
        self.assertAlmostEqual(self.settings.bodies[0].material.E, fake_fit.E, delta=1.0)

    def test_a_capture_that_is_gone(self):
        self.fitted(extra=[fake_fit.estimate("captures.clip.start_frame", "frames", 1, 0.25, 0.1)])
        self.capture.name = "other"
        self.fails(bpy.ops.matterfit.apply_fit, ["'clip'", "not among the Captures"])
        self.assertEqual(self.settings.bodies[0].material.E, 1e5)

    def test_compare_is_out_of_date(self):
        self.fitted()
        self.settings.compare.done = True
        bpy.ops.matterfit.apply_fit()
        self.assertFalse(self.settings.compare.done)


class PresetTest(FakeFitCase):
    def test_save_and_load(self):
        self.fitted()
        path = os.path.join(self.folder, "dough")
        self.assertEqual(bpy.ops.matterfit.save_material(filepath=path), {"FINISHED"})
        document = files.read_json(path + ".json")
        self.assertEqual(document["name"], "dough")
        self.assertEqual(document["provenance"]["held_out"]["mean_mm"], 0.75)
        self.assertEqual(document["material"]["E"], fake_fit.E)
        self.body(self.cube("Other", location=(2, 0, 0)))
        self.assertEqual(bpy.ops.matterfit.load_material(filepath=path + ".json"), {"FINISHED"})
        self.assertAlmostEqual(self.settings.bodies[1].material.E, fake_fit.E, delta=1.0)
        self.assertIn("Fitted to", self.settings.bodies[1].material.source)

    def test_a_fit_that_is_no_result(self):
        """Whoever applies, saves, loads or keeps it is told."""
        words = "The search did not end at a minimum."
        self.fitted(warning=words)
        path = os.path.join(self.folder, "dough.json")
        for act in (bpy.ops.matterfit.apply_fit,
                    lambda: bpy.ops.matterfit.save_material(filepath=path),
                    lambda: bpy.ops.matterfit.load_material(filepath=path),
                    lambda: bpy.ops.matterfit.add_preset(name="doubtful")):
            bpy.context.window_manager.matterfit.last_report = ""
            self.assertEqual(act(), {"FINISHED"})
            self.assertIn(words, self.report())

    def test_another_bodys_material(self):
        """It was not fitted, and the files of an earlier fit are not looked at."""
        self.body(self.cube("Other", location=(2, 0, 0)))
        self.fitted()
        files.write_json(os.path.join(self.run_folder, "material_Other.json"),
                         files.read_json(os.path.join(self.run_folder, "material.json")))
        path = os.path.join(self.folder, "dough.json")
        self.settings.body_index = 1
        self.fails(bpy.ops.matterfit.save_material, ["material of 'Cube', not of 'Other'"],
                   filepath=path)
        self.fails(bpy.ops.matterfit.add_preset, ["material of 'Cube', not of 'Other'"], name="x")
        self.assertFalse(os.path.exists(path))
        self.settings.bodies[1].role = "COLLIDER"  # has none, so it says nothing
        self.assertEqual(bpy.ops.matterfit.save_material(filepath=path), {"FINISHED"})

    def test_of_two_bodies(self):
        """The file of the first has no name; that of the second has."""
        self.body(self.cube("Other", location=(2, 0, 0)))
        self.fitted(extra=[fake_fit.estimate("bodies.Other.material.E", "Pa", 1e5, 3e5, 1e3)])
        first = files.read_json(os.path.join(self.run_folder, "material.json"))
        files.write_json(os.path.join(self.run_folder, "material_Other.json"),
                         {**first, "material": {**first["material"], "E": 3e5}})
        path = os.path.join(self.folder, "dough.json")
        for index, value in enumerate((fake_fit.E, 3e5)):
            self.settings.body_index = index
            bpy.ops.matterfit.save_material(filepath=path)
            self.assertEqual(files.read_json(path)["material"]["E"], value)

    def test_load_refuses(self):
        path = os.path.join(self.folder, "bad.json")
        good = dict(presets.materials()["JELLY"])
        elastic = {"law": "neo_hookean", "E": 1e5, "nu": 0.3}
        for change, words in (
                ({"schema": "other/1"}, ["bad.json", "schema is 'other/1'"]),
                ({"material": {"law": "jam"}}, ["law is 'jam'"]),
                ({"material": {**elastic, "E": "stiff"}}, ["E is 'stiff'", "a number"]),
                ({"material": {**elastic, "maxwell": [{"modulus": 1}]}}, ["maxwell time is None"]),
                ({"material": {**elastic, "maxwell": 3}}, ["at most 6 branches"]),
                ({"material": {"law": "neo_hookean", "E": 1e5}}, ["'nu' is missing"]),
                ({"material": {**elastic, "law": "von_mises"}}, ["'yield_stress' is missing"]),
                ({"material": {"law": "newtonian", "viscosity": 1}}, ["'bulk_modulus' is missing"]),
                ({"material": {**elastic, "E": 0}}, ["E is 0", "above 0"]),
                ({"material": {**elastic, "damping_shear": -1}}, ["damping_shear is -1", "above 0"]),
                ({"density": 0.0}, ["density is 0.0", "above 0"]),
                ({"source": 3}, ["source is 3", "a text"]),
                ({"name": None}, ["name is None", "a text"])):
            files.write_json(path, {**good, **change})
            self.fails(bpy.ops.matterfit.load_material, words, filepath=path)
        files.write_json(path, [])
        self.fails(bpy.ops.matterfit.load_material, ["schema is None"], filepath=path)

    def test_a_preset_of_ones_own(self):
        """In the list, applied by its name, kept in saved files, removed again."""
        self.fitted()
        self.assertEqual(bpy.ops.matterfit.add_preset(name="Grandma's dough"), {"FINISHED"})
        items = {item[1]: item for item in presets.enum_items()}
        identifier, number = items["Grandma's dough"][0], items["Grandma's dough"][3]
        self.assertGreaterEqual(number, presets.USER_NUMBERS)
        self.assertLess(number, 2**31)
        body = self.settings.bodies[0]
        body.material.preset = identifier
        self.assertAlmostEqual(body.material.E, fake_fit.E, delta=1.0)
        self.assertFalse(presets.differs(body.material))
        self.save("scene.blend")
        self.reopen()
        body = self.settings.bodies[0]
        self.assertEqual(body.material.preset, identifier)
        self.fails(bpy.ops.matterfit.add_preset, ["there is one of this name"],
                   name="Grandma's dough")
        self.settings.body_index = 0
        self.assertEqual(bpy.ops.matterfit.remove_preset(), {"FINISHED"})
        self.assertEqual(body.material.preset, "CUSTOM")
        self.assertAlmostEqual(body.material.E, fake_fit.E, delta=1.0)
        self.assertFalse(bpy.ops.matterfit.remove_preset.poll())

    def test_one_that_cannot_be_deleted(self):
        """It stays, and so does the choice of it."""
        self.fitted()
        bpy.ops.matterfit.add_preset(name="mine")
        self.settings.body_index = 0
        body = self.settings.bodies[0]
        body.material.preset = "USER_MINE"
        with mock.patch.object(os, "remove", side_effect=PermissionError(13, "Permission denied")):
            self.fails(bpy.ops.matterfit.remove_preset, ["mine.json", "Permission denied"])
        self.assertEqual(body.material.preset, "USER_MINE")

    def test_a_preset_that_this_machine_lacks(self):
        """The values lie in the scene; nothing raises."""
        self.fitted()
        bpy.ops.matterfit.add_preset(name="mine")
        body = self.settings.bodies[0]
        body.material.preset = "USER_MINE"
        os.remove(os.path.join(presets.user_folder(), "mine.json"))
        presets.forget()
        self.assertFalse(presets.differs(body.material))
        self.assertFalse(presets.is_users(body.material.preset))
        self.assertAlmostEqual(body.material.E, fake_fit.E, delta=1.0)

    def test_a_damaged_one_is_left_out(self):
        files.write_bytes(os.path.join(presets.user_folder(), "broken.json"), b"{")
        presets.forget()
        self.assertIn("JELLY", presets.materials())
        self.assertNotIn("USER_BROKEN", presets.materials())
        self.assertIn("broken.json", presets.faults()[0])

    def test_no_name(self):
        self.fitted()
        self.fails(bpy.ops.matterfit.add_preset, ["no name is given"], name="  ")


@needs_library
class NativeTest(SceneCase):
    """A jelly cube that hits the ground is simulated, and its softness found again."""

    def setUp(self):
        super().setUp()
        body = self.jelly(separation=0.025, location=(0.0, 0.0, 0.115))
        body.velocity = (0.0, 0.0, -2.0)
        body.material.E = 6e4
        self.scene.frame_end = 5
        corners = numpy.array([[x, y, z] for x in (-0.09, 0.0, 0.09) for y in (-0.09, 0.0, 0.09)
                               for z in (0.025, 0.115, 0.205)])
        times = numpy.arange(5) / 24.0
        self.write(numpy.repeat(corners[None], 5, axis=0), times)
        capture = self.settings.captures.add()
        capture.name, capture.filepath = "clip", "//clip.npz"
        self.assertEqual(bpy.ops.matterfit.compare(), {"FINISHED"}, self.error())
        folder = takes.locate(self.settings.takes[0]).folder
        with numpy.load(os.path.join(folder, "simulated.npz")) as arrays:
            recorded = arrays["positions"]
        noise = numpy.random.default_rng(1).normal(0.0, 2e-4, recorded.shape)
        self.write(recorded + noise, times)
        capture.use_noise, capture.noise = True, 2e-4
        capture.holdout, capture.holdout_start = "FRAMES", 5
        self.settings.bodies[0].material.E = 1.5e5
        for row in self.settings.fit.parameters:
            row.enabled = row.key == "material.E"
        self.settings.fit.windows = False

    def write(self, positions, times):
        files.write_npz(os.path.join(self.folder, "clip.npz"),
                        {"positions": positions, "times": times})

    def test_fit(self):
        self.assertEqual(bpy.ops.matterfit.fit(), {"FINISHED"}, self.error())
        folder = takes.locate(self.settings.fit.run).folder
        result = fit_results.load(folder)
        self.assertEqual(len(result.estimates), 1)
        self.assertAlmostEqual(result.estimates[0].value / 6e4, 1.0, delta=0.05)
        self.assertLess(result.fitted.after["mean_mm"], result.fitted.before["mean_mm"])
        self.assertIsNotNone(result.held_out.after)
        self.assertTrue(fit_results.segments(fit_results.history(folder)))
        bpy.ops.matterfit.apply_fit()
        self.assertAlmostEqual(self.settings.bodies[0].material.E / 6e4, 1.0, delta=0.05)
        path = os.path.join(self.folder, "found.json")
        self.assertEqual(bpy.ops.matterfit.save_material(filepath=path), {"FINISHED"},
                         self.error())
        self.assertIn("provenance", files.read_json(path))

    def test_killed_then_resumed(self):
        """kill -9 in the middle of a fit; going on finds what an unbroken fit finds, to the bit."""
        for row in self.settings.fit.parameters:
            row.enabled = row.key in ("material.E", "material.nu", "velocity")
        self.settings.fit.windows = True
        run = takes.for_fit(self.settings)
        folder = takes.claim(run)
        path = job_document.write(job_document.build(self.scene, run, folder, "fit"), folder)
        kill_cli("fit", path, when=lambda: len(fit_results.history(folder)) >= 2)
        self.assertFalse(os.path.exists(os.path.join(folder, "result.json")))
        self.assertTrue(os.path.exists(os.path.join(folder, "fit", "checkpoint.json")))
        found = []
        for more in ((), ("--restart",)):
            done = run_cli("fit", path, "--json", "--quiet", *more, timeout=300)
            fit = printed_json(done)["fit"]
            found.append([(entry["path"], entry["value"], entry["standard_error"])
                          for entry in fit["parameters"]] + fit["history"])
        self.assertEqual(*found)

    def test_interrupted_without_a_window(self):
        """Ctrl-C and SIGTERM cancel: status 130, and the best values so far are written."""
        for row in self.settings.fit.parameters:
            row.enabled = row.key in ("material.E", "material.nu", "velocity")
        self.settings.fit.windows = True
        for number in (signal.SIGINT, signal.SIGTERM):
            run = takes.for_fit(self.settings)
            folder = takes.claim(run)
            path = job_document.write(job_document.build(self.scene, run, folder, "fit"), folder)
            status = kill_cli("fit", path, "--restart", number=number,
                              when=lambda at=folder: len(fit_results.history(at)) >= 2)
            self.assertEqual(status, jobs.EXIT_CANCELLED)
            result = files.read_json(os.path.join(folder, "result.json"))
            self.assertEqual(result["status"], "cancelled")
            os.remove(os.path.join(folder, "fit", "history.jsonl"))

    def test_killed_without_a_window(self):
        """The saved scene knows the folder, so that Resume goes on there."""
        if not bpy.app.binary_path:
            self.skipTest("a .blend on the command line needs Blender itself")
        for row in self.settings.fit.parameters:
            row.enabled = row.key in ("material.E", "material.nu", "velocity")
        self.settings.fit.windows = True
        self.save("scene.blend")
        path = os.path.join(self.folder, "scene.blend")
        before = set(os.listdir(self.folder))

        def begun():
            return any(len(fit_results.history(os.path.join(self.folder, name))) >= 2
                       for name in set(os.listdir(self.folder)) - before)

        kill_cli("fit", "--save", when=begun, blend=path)
        self.reopen()
        folder = takes.locate(self.settings.fit.run).folder
        self.assertTrue(fit_results.is_unfinished(folder))
        lines = len(fit_results.history(folder))
        self.assertEqual(bpy.ops.matterfit.resume_fit(), {"FINISHED"}, self.error())
        self.assertGreaterEqual(len(fit_results.history(folder)), lines)
        self.assertTrue(self.settings.fit.done)

    def test_refused_without_a_window(self):
        """Questions and what is refused leave nothing beside the scene, nor in it."""
        if not bpy.app.binary_path:
            self.skipTest("a .blend on the command line needs Blender itself")
        self.save("scene.blend")
        path = os.path.join(self.folder, "scene.blend")
        before = sorted(name for name in os.listdir(self.folder) if not name.endswith(".blend1"))

        def names():
            return sorted(name for name in os.listdir(self.folder) if not name.endswith(".blend1"))

        self.assertIn("particles", printed_json(run_cli("estimate", blend=path)))
        self.assertEqual(names(), before)
        for wrong, words in ((("--threads", "-3"), "-3, expected a number of threads"),
                             (("--target", "foo"), "foo")):
            for verb in ("estimate", "validate"):
                done = run_cli(verb, *wrong, blend=path)
                self.assertEqual(done.returncode, 2, (verb, wrong))
                self.assertIn(words, done.stderr)
        self.assertEqual(run_cli("diagnose", "--quiet", "--set", "density=-5", blend=path).returncode, 2)
        self.assertEqual(names(), before)
        done = run_cli("fit", "--save", "--quiet", "--set", "density=-5", blend=path)
        self.assertEqual(done.returncode, 2)
        self.assertIn("density is -5", done.stderr)
        self.assertEqual(names(), before)
        self.reopen()
        self.assertEqual(self.settings.fit.run.folder, "")

    def test_without_a_window(self):
        """`fit --save` from the command line fits the open scene, applies and saves."""
        if not bpy.app.binary_path:
            self.skipTest("a .blend on the command line needs Blender itself")
        self.save("scene.blend")
        done = run_cli("fit", "--json", "--save", "--quiet", timeout=300,
                       blend=os.path.join(self.folder, "scene.blend"))
        result = printed_json(done)
        self.assertAlmostEqual(result["fit"]["parameters"][0]["value"] / 6e4, 1.0, delta=0.05)
        self.reopen()
        self.assertAlmostEqual(self.settings.bodies[0].material.E / 6e4, 1.0, delta=0.05)

    def test_diagnosed_without_a_window(self):
        """`diagnose --save` fits the open scene in the fit's own cache, and leaves its report there."""
        if not bpy.app.binary_path:
            self.skipTest("a .blend on the command line needs Blender itself")
        self.save("scene.blend")
        done = run_cli("diagnose", "--save", "--quiet", timeout=300,
                       blend=os.path.join(self.folder, "scene.blend"))
        self.assertEqual(done.returncode, 0, done.stderr)
        self.reopen()
        self.assertTrue(self.settings.fit.done)
        folder = takes.locate(self.settings.fit.run).folder
        report = diagnosis.load(folder)
        self.assertTrue(diagnosis.is_of_fit(report, fit_results.load(folder)))
        self.assertNotAlmostEqual(self.settings.bodies[0].material.E / 6e4, 1.0, delta=0.05)
