# SPDX-License-Identifier: GPL-3.0-or-later
"""An artist's object gives way to a result that stands for it, and to nothing else."""

import bpy
from fake_cache import write_pc2
from matterfit.io import attach, takes, visibility
from support import SceneCase


class StandsForTest(SceneCase):
    def setUp(self):
        super().setUp()
        self.first, self.second = self.cube("First"), self.cube("Second", location=(1.0, 0.0, 0.5))
        self.body(self.first)
        self.body(self.second)
        self.settings.solver.particle_separation = 0.2
        self.take = self.baked(takes.ensure_active(self.settings))

    def baked(self, take):
        """The take with a cache that shows every body at rest."""
        document, folder = self.document()
        for entry in document["output"]["mesh"]:
            write_pc2(f"{folder}/mesh/{entry['name']}.pc2", [[(0.0, 0.0, 0.0)] * 8] * 6)
        shown = attach.Attachment(self.scene, take, folder, document)
        take.frames_done = shown.update(final=True)
        take.baked = True
        visibility.show_take(self.settings)
        return take

    def result(self, name):
        return next(item for item in self.scene.objects if item.get("matterfit") == f"mesh:{name}")

    def seen(self, *items):
        bpy.context.view_layer.update()
        return [item.visible_get() for item in items]

    def test_a_body_that_was_added_since(self):
        self.assertEqual(self.seen(self.first, self.second), [False, False])
        third = self.cube("Third", location=(2.0, 0.0, 0.5))
        self.body(third)
        visibility.show_take(self.settings)
        self.assertEqual(self.seen(self.first, self.second, third), [False, False, True])

    def test_a_body_that_was_renamed_since(self):
        self.settings.bodies[0].name = "Jelly"
        visibility.show_take(self.settings)
        self.assertEqual(self.seen(self.first, self.second), [False, False])

    def test_a_body_that_was_switched_off_since(self):
        """Its result is there, whatever the next bake will be of."""
        self.settings.bodies[0].enabled = False
        visibility.show_take(self.settings)
        self.assertEqual(self.seen(self.first, self.result("First")), [False, True])

    def test_a_body_that_is_removed(self):
        """Its object comes back, and is not seen twice."""
        self.settings.body_index = 0
        bpy.ops.matterfit.remove_body()
        visibility.show_take(self.settings)
        self.assertEqual(self.seen(self.first, self.result("First")), [True, False])
        self.assertTrue(self.result("First").hide_render)
        self.assertEqual(self.seen(self.second, self.result("Second")), [False, True])

    def test_a_result_in_a_collection_of_the_artists(self):
        """It is seen with its take alone, too."""
        mine = bpy.data.collections.new("Mine")
        self.scene.collection.children.link(mine)
        moved = self.result("First")
        mine.objects.link(moved)
        self.take.collection.objects.unlink(moved)
        bpy.ops.matterfit.add_take()
        self.assertEqual(self.settings.take_index, 1)
        self.assertEqual(self.seen(moved, self.result("Second"), self.first), [False, False, True])
        self.assertTrue(moved.hide_render)
        self.settings.take_index = 0
        self.assertEqual(self.seen(moved, self.result("Second"), self.first), [True, True, False])
        self.assertFalse(moved.hide_render)
