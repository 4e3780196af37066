# SPDX-License-Identifier: GPL-3.0-or-later
"""Contact between bodies."""

from unittest import mock

import bpy
from matterfit import native
from matterfit.io import job_boxes
from matterfit.jobs import JobError
from support import SceneCase, needs_library


class PairTest(SceneCase):
    """Contact between two bodies, set in the panel."""

    def setUp(self):
        super().setUp()
        for name in ("One", "Two", "Three"):
            self.body(self.cube(name))

    def test_pairs(self):
        bpy.ops.matterfit.add_pair()
        bpy.ops.matterfit.add_pair()
        self.settings.pairs[0].contact.mu = 0.7
        self.settings.pairs[1].contact.kind = "GLUE"
        document, _folder = self.document()
        self.assertEqual(document["scene"]["contacts"], [
            {"bodies": ["One", "Two"], "kind": "friction", "mu": 0.7},
            {"bodies": ["One", "Three"], "kind": "glue"}])
        self.settings.bodies[2].enabled = False
        document, _folder = self.document()
        self.assertEqual(len(document["scene"]["contacts"]), 1)
        bpy.ops.matterfit.add_pair()
        self.assertFalse(bpy.ops.matterfit.add_pair.poll())
        for _pair in range(3):
            bpy.ops.matterfit.remove_pair()
        self.assertNotIn("contacts", self.document()[0]["scene"])

    def test_names_that_name_nothing(self):
        bpy.ops.matterfit.add_pair()
        self.settings.pairs[0].second = "Gone"
        with self.assertRaisesRegex(JobError, "'Gone' is not among the Bodies"):
            self.document()
        self.settings.pairs[0].second = "One"
        with self.assertRaisesRegex(JobError, "no pair, or listed twice"):
            self.document()


class OverlapTest(SceneCase):
    """Two bodies that lie in each other."""

    def setUp(self):
        super().setUp()
        self.jelly(name="One", separation=0.05)
        self.second = self.jelly(name="Two", separation=0.05, location=(0.1, 0.0, 0.5)).object

    def vary(self):
        bpy.ops.matterfit.add_axis(quantity="One\tvelocity[0]")
        self.settings.batch.axes[0].values = "-1, -2"

    @needs_library
    def test_refused(self):
        self.vary()
        for operator in (bpy.ops.matterfit.estimate, bpy.ops.matterfit.bake,
                         bpy.ops.matterfit.run_batch):
            self.fails(operator, ["'One' and 'Two' lie in each other"])

    @needs_library
    def test_only_where_the_boxes_meet(self):
        self.second.location.x = 0.2  # they touch
        self.scene.frame_end = 2
        with mock.patch.object(native, "validate", wraps=native.validate) as asked:
            bpy.ops.matterfit.estimate()
            bpy.ops.matterfit.bake()
            self.vary()
            bpy.ops.matterfit.run_batch()
            asked.assert_not_called()
        self.assertEqual([take.baked for take in self.settings.takes], [True] * 3)

    def test_boxes_where_the_bodies_stand(self):
        for place, angle, wanted in (((0.1, 0.0, 0.5), 0.0, True), ((0.2, 0.0, 0.5), 0.0, False),
                                     ((0.23, 0.0, 0.5), 0.785, True), ((0.25, 0.0, 0.5), 0.785, False)):
            self.second.location, self.second.rotation_euler.z = place, angle
            document, folder = self.document()
            self.assertEqual(job_boxes.may_overlap(document, folder), wanted, (place, angle))
