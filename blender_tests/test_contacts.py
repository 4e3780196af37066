# SPDX-License-Identifier: GPL-3.0-or-later
"""Contact between bodies."""

import bpy
from matterfit.jobs import JobError
from support import SceneCase


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
        self.settings.pairs[1].contact.kind = "STICKY"
        document, _folder = self.document()
        self.assertEqual(document["scene"]["contacts"], [
            {"bodies": ["One", "Two"], "kind": "friction", "mu": 0.7},
            {"bodies": ["One", "Three"], "kind": "sticky"}])
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
