# SPDX-License-Identifier: GPL-3.0-or-later
"""Bodies that are thrown by keys which hardly move them where the simulation begins."""

from unittest import mock

from matterfit.io import motion, takes
from matterfit.ui import bodies
from support import SceneCase
from test_sampling import curves_of


class SlowStartTest(SceneCase):
    def setUp(self):
        super().setUp()
        self.item = self.cube(location=(0.0, 0.0, 1.0))

    def test_keys_that_set_off_slowly(self):
        """As Blender's own do; those that are linear do not."""
        self.key("location", (1, (0.0, 0.0, 1.0)), (25, (2.0, 0.0, 1.0)))
        found = motion.slow_start(self.item, 1, 31)
        self.assertLess(found.speed, 0.02 * found.fastest)
        self.assertAlmostEqual(found.fastest, 0.125, delta=0.01)  # in the middle, 1.5 times the mean
        self.assertIn(found.frame, (12, 13))
        self.assertFalse(found.turns)
        self.assertIsNone(motion.slow_start(self.item, found.frame, 40))
        self.assertEqual(motion.slow_start(self.item, 30, 40), motion.SlowStart(0.0, 0.0, 30))
        self.linear()
        self.assertIsNone(motion.slow_start(self.item, 1, 31))

    def test_keys_that_turn_slowly_at_first(self):
        """Turning is a motion too."""
        self.key("rotation_euler", (1, (0.0, 0.0, 0.0)), (6, (0.0, 0.0, 1.0)))
        found = motion.slow_start(self.item, 1, 7)
        self.assertEqual((found.fastest, found.turns), (0.0, True))
        self.assertIn(found.frame, (3, 4))
        self.linear()
        self.assertIsNone(motion.slow_start(self.item, 1, 7))
        self.assertEqual(motion.slow_start(self.item, 8, 20), motion.SlowStart(0.0, 0.0, 8))

    def test_the_throw_of_the_take_says_it(self):
        """The panel speaks of the keys where they are used."""
        self.key("location", (1, (0.0, 0.0, 1.0)), (25, (2.0, 0.0, 1.0)))
        row = self.body(self.item)
        row.velocity_from = "ANIMATION"
        take = takes.ensure_active(self.settings)
        throw = take.throws.add()
        throw.name = row.name
        for body, thrown, said in (("ANIMATION", "BODY", True), ("ANIMATION", "VALUE", False),
                                   ("VALUE", "ANIMATION", True), ("VALUE", "BODY", False)):
            row.velocity_from, throw.velocity_from = body, thrown
            with mock.patch.object(bodies, "lines") as lines:
                bodies._slow_start(None, self.scene, row)
            self.assertEqual(lines.called, said, (body, thrown))

    def key(self, name, *keys):
        for frame, value in keys:
            setattr(self.item, name, value)
            self.item.keyframe_insert(name, frame=frame)

    def linear(self):
        for curve in curves_of(self.item):
            for key in curve.keyframe_points:
                key.interpolation = "LINEAR"
