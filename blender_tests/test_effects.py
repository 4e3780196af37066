# SPDX-License-Identifier: GPL-3.0-or-later
"""Effects: the list in the panel, and what of it is written."""

import json

import bpy
from matterfit import effects, library, native
from matterfit.jobs import JobError
from support import SceneCase, needs_library


class EffectsTest(SceneCase):
    def setUp(self):
        super().setUp()
        self.body(self.cube(size=0.2, location=(0.0, 0.0, 1.0)))
        bpy.context.view_layer.update()

    def add(self, kind, **numbers):
        self.assertEqual(bpy.ops.matterfit.add_effect(kind=kind), {"FINISHED"})
        effect = self.scene.matterfit.effects[-1]
        for key, value in numbers.items():
            setattr(effect, key, value)
        return effect

    def written(self):
        return self.document()[0]["scene"]["effects"]

    def test_no_effects_leave_no_trace(self):
        self.assertNotIn("effects", self.document()[0]["scene"])
        self.add("WIND").enabled = False
        self.assertNotIn("effects", self.document()[0]["scene"])

    def test_the_panel_has_every_effect_of_the_library(self):
        self.assertEqual([kind.name for kind in effects.KINDS], list(library.EFFECTS))

    def test_every_kind_is_written_with_its_own_numbers(self):
        for kind in effects.KINDS:
            self.add(kind.identifier)
        rows = self.written()
        self.assertEqual([row["effect"] for row in rows], [kind.name for kind in effects.KINDS])
        self.assertEqual(len({row["name"] for row in rows}), len(rows))
        for row, kind in zip(rows, effects.KINDS, strict=True):
            self.assertEqual(set(row) - {"effect", "name"}, set(kind.numbers))

    @needs_library
    def test_the_library_reads_every_kind(self):
        for kind in effects.KINDS:
            self.add(kind.identifier)
        document, folder = self.document()
        native.validate(json.dumps(document), folder)
        for row, kind in zip(document["scene"]["effects"], effects.KINDS, strict=True):
            for key in kind.keyed:
                row[key] = {"frames": [1, 3], "values": [row[key]] * 2}
        native.validate(json.dumps(document), folder)

    def test_lengths_are_metres(self):
        self.scene.unit_settings.scale_length = 0.01
        self.add("FORCE_FIELD", center=(100.0, 0.0, 200.0), radius=50.0,
                 acceleration=(0.0, 0.0, 5.0))
        self.add("DRAG_QUADRATIC", area=10000.0)
        field, drag = self.written()
        self.assertEqual(field["center"], [1, 0, 2])
        self.assertEqual(field["radius"], 0.5)
        self.assertEqual(field["acceleration"], [0, 0, 5])
        self.assertEqual(drag["area"], 1)

    def test_keys_are_sampled_once_a_frame(self):
        self.add("DRAG_LINEAR")
        effect = self.add("WIND", velocity=(0.0, 0.0, 0.0))
        effect.keyframe_insert("velocity", frame=1)
        effect.velocity = (5.0, 0.0, 0.0)
        effect.keyframe_insert("velocity", frame=6)
        drag, wind = self.written()
        self.assertEqual(drag["rate"], 0.5)
        first, end = self.document()[0]["scene"]["frames"]
        self.assertEqual(wind["velocity"]["frames"], list(range(first, end)))
        self.assertEqual(wind["velocity"]["values"][0], [0, 0, 0])
        self.assertEqual(wind["velocity"]["values"][5], [5, 0, 0])
        self.assertEqual(wind["drag_coefficient"], 0.5)

    def test_an_object_says_where_it_is(self):
        place = bpy.data.objects.new("Eye", None)
        self.scene.collection.objects.link(place)
        place.location = (1.0, 2.0, 3.0)
        place.keyframe_insert("location", frame=1)
        place.location = (1.0, 2.0, 4.0)
        place.keyframe_insert("location", frame=6)
        place.rotation_euler = (1.5707963, 0.0, 0.0)
        self.add("VORTEX", place=place, strength=3.0)
        vortex = self.written()[0]
        self.assertEqual(vortex["center"]["values"][0], [1, 2, 3])
        self.assertEqual(vortex["center"]["values"][5], [1, 2, 4])
        self.assertAlmostEqual(vortex["axis"][1], -1.0, places=6)
        self.assertEqual(vortex["strength"], 3)

    def test_what_is_a_part_of_a_body_is_told_where_it_starts(self):
        place = bpy.data.objects.new("Core", None)
        self.scene.collection.objects.link(place)
        place.location = (1.0, 2.0, 3.0)
        place.keyframe_insert("location", frame=1)
        place.location = (1.0, 2.0, 4.0)
        place.keyframe_insert("location", frame=6)
        place.rotation_euler = (1.5707963, 0.0, 0.0)
        self.add("STIFFNESS_INCLUSION", place=place, modulus=2e4, radius=0.05)
        self.add("FIBRES", place=place, modulus=1e5)
        core, fibres = self.written()
        self.assertEqual(core["center"], [1, 2, 3])
        self.assertEqual((core["radius"], core["modulus"]), (0.05, 20000))
        self.assertAlmostEqual(fibres["direction"][1], -1.0, places=6)
        # Keys of such a number would say nothing.
        effect = self.scene.matterfit.effects[0]
        effect.keyframe_insert("radius", frame=1)
        effect.radius = 0.1
        effect.keyframe_insert("radius", frame=6)
        self.assertIsInstance(self.written()[0]["radius"], float)

    def test_a_body_that_is_gone_is_named(self):
        self.add("WIND", body="Cube")
        self.assertEqual(self.written()[0]["body"], "Cube")
        self.scene.matterfit.effects[0].body = "Ball"
        with self.assertRaisesRegex(JobError, "effect 'Wind': there is no body 'Ball'"):
            self.document()

    def test_the_name_follows_the_kind_until_it_is_typed(self):
        for _ in range(2):
            bpy.ops.matterfit.add_effect(kind="WIND")
        first, second = self.settings.effects
        self.assertEqual((first.name, second.name), ("Wind", "Wind 2"))
        first.kind = second.kind = "BUOYANCY"
        self.assertEqual((first.name, second.name), ("Buoyancy", "Buoyancy 2"))
        first.name = "Sea"
        first.kind = "VORTEX"
        self.assertEqual(first.name, "Sea")

    def test_removing(self):
        for _ in range(3):
            self.add("WIND")
        self.assertEqual([effect.name for effect in self.scene.matterfit.effects],
                         ["Wind", "Wind 2", "Wind 3"])
        self.scene.matterfit.effect_index = 1
        bpy.ops.matterfit.remove_effect()
        self.assertEqual([effect.name for effect in self.scene.matterfit.effects],
                         ["Wind", "Wind 3"])
        self.assertEqual(self.scene.matterfit.effects[self.scene.matterfit.effect_index].name,
                         "Wind 3")
