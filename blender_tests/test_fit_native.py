# SPDX-License-Identifier: GPL-3.0-or-later
"""Fits that the library makes."""

import os
import signal

import bpy
import numpy
from matterfit import jobs
from matterfit.io import diagnosis, files, fit_results, job_document, takes
from support import SceneCase, kill_cli, needs_library, printed_json, run_cli


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
        for wrong, words in ((("--threads", "-3"), "'-3' is not a whole number"),
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
