# SPDX-License-Identifier: GPL-3.0-or-later
"""Values beyond what a field takes: Blender would clamp them and say nothing."""

import copy
import os
import subprocess
import unittest

import bpy
import fake_fit
from matterfit import handlers, machine, quantities
from matterfit.io import batch, job_checks, material_check, presets
from matterfit.jobs import JobError
from support import SceneCase, needs_library
from test_batch import BatchCase
from test_fit import FakeFitCase


class BatchTest(BatchCase):
    def test_beyond_the_field(self):
        document, _folder = self.document()
        for key, values, words in (
                ("velocity[2]", "1, 2e5", "Velocity Z has the value 2e5; its field takes from -100000 to 100000"),
                ("material.E", "0", "Young's Modulus has the value 0; its field takes from 0.001 to 9.9e"),
                ("density", "1e4, -1", "Density has the value -1; its field takes from 0.001 to 1e"),
                ("material.nu", "0.5", "Poisson's Ratio has the value 0.5; its field takes from")):
            with self.subTest(key):
                self.batch.axes.clear()
                self.vary("Cube", key, values)
                with self.assertRaisesRegex(JobError, words):
                    batch.assignments(self.settings, document["scene"])
        self.batch.axes.clear()
        self.vary("", batch.SEPARATION, "0.01, 2000")
        with self.assertRaisesRegex(JobError, "Particle Separation is 2000 m, and nothing can be simulated above"):
            batch.assignments(self.settings, document["scene"])

    def test_its_bounds_themselves(self):
        document, _folder = self.document()
        row = quantities.find("material.nu")
        self.vary("Cube", "material.nu", f"{row.least}, {row.most}")
        self.assertEqual(len(batch.assignments(self.settings, document["scene"])), 1)


class FileTest(SceneCase):
    def test_a_material_file(self):
        """Refused by name, and not read as another material."""
        document = copy.deepcopy(presets.materials()["JELLY"])
        material_check.check(document, "jelly.json")
        for key, value, words in (("E", 1e-5, "E is 1e-05, and the panel takes from 0.001 to 9.9e"),
                                  ("nu", 0.6, "nu is 0.6, and the panel takes from")):
            with self.subTest(key):
                wrong = {**document, "material": {**document["material"], key: value}}
                with self.assertRaisesRegex(JobError, f"jelly.json: {words}"):
                    material_check.check(wrong, "jelly.json")
        with self.assertRaisesRegex(JobError, "density is 10000000.0, and the panel takes"):
            material_check.check({**document, "density": 1e7}, "jelly.json")


class FitTest(FakeFitCase):
    def test_of_a_fit(self):
        """What is applied at a bound is said."""
        def change(scene):
            scene["bodies"][0]["density"] = 5e6
        self.fitted(change=change, extra=[fake_fit.estimate("bodies.Cube.density", "kg/m³", 1e3, 5e6, 1.0)])
        bpy.ops.matterfit.apply_fit()
        self.assertEqual(self.settings.bodies[0].density, 1e6)
        self.assertIn("'Cube': Density is 5e+06 in the fit; its field takes from 0.001 to 1e+06",
                      bpy.context.window_manager.matterfit.last_report)


class SeparationTest(SceneCase):
    def test_the_field_ends_where_the_library_does(self):
        solver = self.settings.solver
        solver.particle_separation = 1e4
        self.assertEqual(solver.particle_separation, job_checks.MOST_SEPARATION)

    def test_in_a_scene_of_kilometres(self):
        self.jelly()
        self.scene.unit_settings.scale_length = 1000.0
        self.settings.solver.particle_separation = 2.0
        with self.assertRaisesRegex(JobError, "Particle Separation is 2000 m, and nothing can be simulated above"):
            self.document()

    @needs_library
    def test_an_object_that_is_far_away(self):
        body = self.jelly(separation=0.05)
        body.object.location.x = 1e12
        message = self.fails(bpy.ops.matterfit.bake, ["'Cube', Position X is", "from -1000000 to 1000000 [m]"])
        self.assertNotIn("placement", message)


class ToolTest(unittest.TestCase):
    def test_numbers_of_the_command_line(self):
        """In the tool's words, with the status of wrong input."""
        if not os.path.isfile(machine.tool()):
            self.skipTest("the matterfit program was not built")
        for arguments, words in (
                (("simulate", "job.json", "--threads", "abc"),
                 "matterfit: --threads: 'abc' is not a whole number, 0 or more.\nmatterfit simulate --help"),
                (("bake", "job.json", "--threads", "-3"), "--threads: '-3' is not a whole number, 0 or more."),
                (("wedge", "job.json", "--output", "x", "--jobs", "0"),
                 "--jobs: '0' is not a whole number, 1 to 1024."),
                (("new-job", "x.npz", "--output", "y", "--density", "abc"), "--density = abc is not a number."),
                ((), "matterfit: what is to be done is missing.")):
            with self.subTest(arguments):
                done = subprocess.run([machine.tool(), *arguments], capture_output=True, text=True, check=False)
                self.assertEqual(done.returncode, 2)
                self.assertIn(words, done.stderr)
        told = subprocess.run([machine.tool(), "--help"], capture_output=True, text=True, check=False)
        self.assertEqual(told.returncode, 0)


class SaidTest(SceneCase):
    def test_undo_takes_back_what_was_said(self):
        """Undo of a bake takes the take's frames: that they were baked is not said any more."""
        state = bpy.context.window_manager.matterfit
        state.last_report = "Bake Take 1: 8 frames in 3 s"
        handlers.look_after_undo()
        self.assertEqual(state.last_report, "")
