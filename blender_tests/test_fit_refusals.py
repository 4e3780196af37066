# SPDX-License-Identifier: GPL-3.0-or-later
"""What a fit refuses before it begins, and captures made of objects."""

import os

import bpy
from matterfit.jobs import JobError
from support import select
from test_fit_document import FitCase


class RefusalTest(FitCase):
    def refused(self, words):
        with self.assertRaisesRegex(JobError, words):
            self.written()

    def test_captures(self):
        self.capture.holdout = "CAPTURE"
        self.refused("Every capture is held out whole")
        self.recording("second")
        self.written()
        for capture in self.settings.captures:
            capture.enabled = False
        self.refused("no capture to fit to.*Import one")

    def test_the_start_of_what_is_only_tested(self):
        """Nothing tells a fit when a capture began that is held out as a whole."""
        self.recording("second")

        def listed():
            return {row.owner for row in self.fit.parameters if row.key == "start_frame"}

        self.assertEqual(listed(), {"clip", "second"})
        self.settings.captures["second"].holdout = "CAPTURE"
        self.assertEqual(listed(), {"clip"})
        self.settings.captures["second"].holdout = "NONE"
        self.assertEqual(listed(), {"clip", "second"})

    def test_nothing_to_find(self):
        self.only()
        self.refused("no parameter is switched on")

    def test_a_start_at_nothing(self):
        """A logarithm has no start at 0: a new row has one of its own, which may be switched off."""
        self.settings.bodies[0].material.damping_shear = 0.0
        self.only("material.damping_shear")
        row = self.row("material.damping_shear")
        self.assertTrue(row.use_start)
        self.assertGreater(row.start, 0.0)
        self.written()
        row.use_start = False
        self.refused("Cube: Shear Damping.*no value yet.*Switch on its Start")
        self.settings.bodies[0].material.preset = "PLASTICINE"
        self.only("material.hardening")
        self.row("material.hardening").use_start = False
        self.refused("would start at 0, and must start above 0")

    def test_bounds(self):
        self.only("material.E")
        row = self.row("material.E")
        row.use_bounds, row.low, row.high = True, 1e6, 1e5
        self.refused("Lowest must be the smaller")
        row.low, row.high = 2e5, 1e6
        self.refused("start at 100000, outside its bounds 200000 to 1e.06")
        row.low = -1.0
        self.refused("Lowest is -1, and must be above 0")

    def test_priors(self):
        self.only("material.nu")
        row = self.row("material.nu")
        row.use_prior, row.mean = True, 0.0
        self.refused("Cube: Poisson's Ratio: Expected is 0, and must be above 0")
        row.mean = 0.5
        self.refused("Cube: Poisson's Ratio: Expected is 0.5, and must be below .5")

    def test_nearly_incompressible(self):
        self.only("material.nu")
        row = self.row("material.nu")
        row.use_start, row.start = True, 0.5
        self.refused("must start below .5")

    def test_a_list_of_long_ago(self):
        self.only()
        row = self.fit.parameters.add()
        row.owner, row.key, row.name, row.enabled = "Cube", "material.cohesion", "Cube c", True
        self.refused("'Cube c' is not in the scene any more. Press List Parameters")
        bpy.ops.matterfit.list_parameters()
        self.assertNotIn("material.cohesion", [row.key for row in self.fit.parameters])

    def test_keyed_gravity(self):
        solver = self.settings.solver
        for frame, down in ((1, -9.0), (6, 0.0)):
            solver.gravity = (0.0, 0.0, down)
            self.scene.keyframe_insert("matterfit.solver.gravity", frame=frame)
        self.only("gravity", owner="")
        row = self.row("gravity", "")
        row.axes = (False, False, True)
        row.use_bounds = True
        self.refused("Gravity.*is animated")


class ObjectCaptureTest(FitCase):
    def test_an_animated_object(self):
        """A fit to an object's animation writes its track, as Compare does."""
        self.settings.captures.clear()
        item = self.cube("Recorded", size=0.2, location=(0.0, 0.0, 0.3))
        select(item)
        bpy.ops.matterfit.add_capture_object()
        document, folder = self.document("fit")
        self.assertTrue(os.path.isfile(os.path.join(folder, document["captures"][0]["tracks"])))
