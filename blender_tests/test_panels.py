# SPDX-License-Identifier: GPL-3.0-or-later
"""Panels at the sidebar's default width: no text is cut."""

import unittest

import bpy
from matterfit import effects, laws, ui
from matterfit.io import fit_rows, motion
from panel_recorder import faults_of_all, text_width, texts_of
from support import SceneCase, select


@unittest.skipUnless(text_width("Young's") > 0.0, "this Blender has no fonts in the background")
@unittest.skipIf(bpy.app.version >= (4, 0), "the room of labels was read off Blender 3.4")
class CutTest(SceneCase):
    def setUp(self):
        super().setUp()
        self.row = self.jelly()
        self.scene.frame_end = 6

    def check(self, words=""):
        self.assertEqual(faults_of_all(ui.CLASSES, bpy.context), [], words)

    def test_the_recorder_measures(self):
        self.assertGreater(text_width("Young's Modulus [Pa]"), text_width("Young's"))

    def test_every_law(self):
        for law, _name, _about in laws.LAWS:
            self.row.material.law = law
            self.check(f", {law}")

    def test_parts_of_a_body(self):
        bpy.ops.matterfit.add_pin()
        bpy.ops.matterfit.add_mass()
        bpy.ops.matterfit.add_branch()
        for kind in ("VERTEX_GROUP", "PLANE", "BOX", "ALL"):
            self.row.pins[0].kind = kind
            self.check(f", pin {kind}")
        for source in ("POINTS", "GAUSSIANS"):
            self.row.source = source
            self.check(f", {source}")

    def test_a_body_that_is_keyed_later(self):
        """Add Body takes the keys that are there; later ones are offered where the object is chosen."""
        self.assertFalse(motion.leaves_keys(self.row))
        for frame, x in ((1, 0.0), (6, 1.0)):
            self.row.object.location.x = x
            self.row.object.keyframe_insert("location", frame=frame)
        self.assertTrue(motion.leaves_keys(self.row))
        texts = texts_of(ui.bodies.MATTERFIT_PT_bodies, bpy.context)
        self.assertIn("Start as Keyed", texts)
        self.check()
        self.row.velocity_from = "ANIMATION"
        self.assertFalse(motion.leaves_keys(self.row))
        self.assertNotIn("Start as Keyed", texts_of(ui.bodies.MATTERFIT_PT_bodies, bpy.context))

    def test_keys_that_set_off_slowly(self):
        """As Blender's own do: what is thrown by them is told that it hardly moves where it begins."""
        self.scene.frame_end = 30
        item = self.row.object
        for frame, x in ((1, 0.0), (25, 2.0)):
            item.location.x = x
            item.keyframe_insert("location", frame=frame)
        self.row.velocity_from = "ANIMATION"

        def said(words):
            return any(words in text for text in texts_of(ui.bodies.MATTERFIT_PT_bodies, bpy.context))

        self.assertTrue(said("set off slowly"))
        self.check()
        # Where it is told to begin it moves; after the last key nothing does.
        solver = self.settings.solver
        solver.use_range, solver.frame_start, solver.frame_end = True, 12, 40
        self.assertFalse(said("set off slowly"))
        solver.frame_start = 30
        self.assertTrue(said("hold still"))
        self.check()
        solver.use_range = False
        self.row.velocity_from = "VALUE"
        self.assertFalse(said("set off slowly") or said("hold still"))

    def test_a_collider(self):
        self.body(self.cube("Second"))
        bpy.ops.matterfit.add_pair()
        self.body(self.cube("Ball"), "COLLIDER")
        for kind in ("STATIC", "RIGID", "DEFORMING"):
            self.settings.bodies[2].collider_kind = kind
            self.check(f", {kind}")

    def test_the_solver(self):
        solver = self.settings.solver
        solver.use_walls, solver.use_range = True, True
        solver.ground.use_stiffness = solver.ground.use_damping = True
        for quality in ("PREVIEW", "STANDARD", "FINE", "CUSTOM"):
            solver.quality = quality
            self.check(f", {quality}")

    def test_every_effect(self):
        for kind in effects.KINDS:
            bpy.ops.matterfit.add_effect(kind=kind.identifier)
            self.check(f", {kind.title}")

    def test_captures_and_fits(self):
        select(self.cube("Recorded"))
        bpy.ops.matterfit.add_capture_object()
        capture = self.settings.captures[0]
        capture.use_colours = capture.refine_cameras = True
        capture.poses = '[{"shift": [0.0123, 0, 0], "turn": [0.02, 0, 0], "focal": 0.01}]'
        for source in ("OBJECT", "FILE", "IMAGES"):
            capture.source = source
            for holdout in ("NONE", "FRAMES", "TRACKS", "BOTH"):
                capture.holdout = holdout
                self.check(f", {source}, {holdout}")
        capture.unit = "CUSTOM"
        self.check(", custom unit")
        fit = self.settings.fit
        fit_rows.refresh(self.settings)
        for index, row in enumerate(fit.parameters):
            fit.parameter_index = index
            row.use_start = row.use_bounds = row.use_prior = True
            self.check(f", {row.name}")
        fit.law, fit.use_huber = "FIND", True
        self.check(", find")

    def test_batch(self):
        for owner, key in (("Cube", "material.damping_shear"), ("", "particle_separation")):
            bpy.ops.matterfit.add_axis(quantity=f"{owner}\t{key}")
            self.settings.batch.axes[0].values = "1,2,3"
            for farm in ("NONE", "SLURM", "FLAMENCO"):
                self.settings.batch.farm = farm
                self.check(f", {key}, {farm}")
        row = self.settings.batch.results.add()
        row.name, row.error = "-1, 5e4", 1234.5
        self.settings.batch.varied = "Velocity Z, Young's Modulus"
        for task in ("BAKE", "COMPARE", "FIT"):
            self.settings.batch.task = task
            self.check(f", {task}")

    def test_takes_and_compare(self):
        bpy.ops.matterfit.add_take()
        bpy.ops.matterfit.add_throw()
        take = self.settings.takes[0]
        take.use_gravity = True
        take.throws[0].use_placement = True
        for source in ("BODY", "VALUE", "ANIMATION"):
            take.throws[0].velocity_from = source
            self.check(f", {source}")
        self.settings.compare.done = True
        self.settings.compare.range_mode = "FIXED"
        for frame, error in enumerate((1234.5, 98765.4, 1.2345e6, 22.94, 0.03125, 0.0)):
            row = self.settings.compare.worst.add()
            row.frame, row.mean, row.largest = 1000 + frame, error, 2.0 * error
        self.settings.compare.images_done = True
        for frame in range(5):
            row = self.settings.compare.worst_images.add()
            row.frame, row.camera, row.iou = 1000 + frame, 100, 1.0
        self.check(", compared")
