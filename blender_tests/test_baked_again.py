# SPDX-License-Identifier: GPL-3.0-or-later
"""What the artist has done to a result, or to its original meanwhile, as it is baked."""

import bpy
import numpy
from attach_case import FRAMES, evaluated_points
from mathutils import Matrix
from matterfit.io import attach
from test_refinement import RefinementCase


class ChangedMeanwhileTest(RefinementCase):
    """The artist works on while a bake runs."""

    def setUp(self):
        super().setUp()
        self.written, self.folder_of_cache = self.document()
        self.write_files(self.written)

    def shown(self):
        """The result, and what was said of it."""
        attachment = attach.Attachment(self.scene, self.take, self.folder_of_cache, self.written)
        self.frames_done = attachment.update(final=True)
        self.assertEqual(self.frames_done, len(FRAMES))
        result = next(iter(self.take.collection.objects))
        last = evaluated_points(result, FRAMES[-1])
        numpy.testing.assert_allclose(last.mean(axis=0), (0.0, 0.0, 1.4), atol=1e-4)
        return result, attachment.notes

    def test_another_scene(self):
        """That is shown as the bake ends: the mesh is made in the scene that was simulated."""
        other = bpy.data.scenes.new("Other")
        bpy.context.window.scene = other
        attachment = attach.Attachment(self.scene, self.take, self.folder_of_cache, self.written)
        attachment.update(final=True)
        self.assertEqual(attachment.notes, [])
        self.assertEqual(bpy.context.scene, other)
        result = next(iter(self.take.collection.objects))
        self.assertEqual(len(result.data.vertices), len(self.arrays["vertices"]))
        self.assertEqual(len(result.data.uv_layers), 1)

    def test_its_collection_is_switched_off(self):
        """What was sampled is shown, and that is said; the mesh of the bake before where there is one."""
        originals = bpy.data.collections.new("Originals")
        self.scene.collection.children.link(originals)
        originals.objects.link(self.item)
        self.scene.collection.objects.unlink(self.item)
        layer = bpy.context.view_layer.layer_collection.children["Originals"]
        layer.exclude = True
        result, notes = self.shown()
        self.assertRegex(notes[0], "'Cube' was changed while it was simulated.*not in this view layer")
        self.assertEqual(len(result.data.polygons), len(self.arrays["face_sizes"]))
        self.assertEqual(len(result.data.uv_layers), 0)
        layer.exclude = False
        result, notes = self.shown()
        self.assertEqual((notes, len(result.data.uv_layers)), ([], 1))
        layer.exclude = True
        result, notes = self.shown()
        self.assertEqual((len(notes), len(result.data.uv_layers)), (1, 1))

    def test_another_count(self):
        """Its mesh is edited: hours of a bake are not lost."""
        self.item.data.transform(Matrix.Diagonal((4.0, 1.0, 1.0, 1.0)))
        result, notes = self.shown()
        self.assertEqual(len(notes), 1)
        self.assertEqual(len(result.data.vertices), len(self.arrays["vertices"]))


class BakedAgainTest(RefinementCase):
    def test_materials_of_the_result(self):
        """They stay; those that came from the original follow it."""
        given, own, later = (bpy.data.materials.new(name) for name in ("Given", "Own", "Later"))
        self.item.data.materials.append(given)
        result = self.attach()["mesh:Cube"]
        self.assertEqual(result.material_slots[0].material, given)
        self.item.data.materials[0] = later
        self.assertIs(self.attach()["mesh:Cube"], result)
        self.assertEqual(result.material_slots[0].material, later)
        result.material_slots[0].material = own
        for separation in (0.02, 0.2, 0.02, 0.02):
            self.settings.solver.particle_separation = separation
            self.assertIs(self.attach()["mesh:Cube"], result)
            self.assertEqual(result.material_slots[0].material, own)
            self.assertEqual(self.item.material_slots[0].material, later)

    def test_a_first_material(self):
        result = self.attach()["mesh:Cube"]
        own = bpy.data.materials.new("Own")
        result.data.materials.append(own)
        self.attach()
        self.assertEqual([slot.material for slot in result.material_slots], [own])

    def test_another_kind(self):
        """The object stays, with what the artist added and without what he removed."""
        modifier = self.item.modifiers.new("Subdivision", "SUBSURF")
        modifier.levels, modifier.render_levels, modifier.uv_smooth = 2, 2, "NONE"
        result = self.attach()["mesh:Cube"]
        result.modifiers.new("Mine", "DISPLACE").strength = 0.0
        self.settings.solver.particle_separation = 0.2
        self.assertIs(self.attach()["mesh:Cube"], result)
        self.assertIs(result.data, self.item.data)
        self.assertEqual([other.name for other in result.modifiers], ["Matterfit Cache", "Subdivision", "Mine"])
        copy = result.modifiers["Subdivision"]
        self.assertEqual((copy.levels, copy.render_levels, copy.uv_smooth), (2, 2, "NONE"))
        result.modifiers.remove(copy)
        self.attach()
        self.assertNotIn("Subdivision", result.modifiers)
        self.settings.solver.particle_separation = 0.02
        self.assertIs(self.attach()["mesh:Cube"], result)
        self.assertEqual([other.name for other in result.modifiers], ["Matterfit Cache", "Mine"])

    def test_a_deformer_before(self):
        """It comes before the cache, what refines right after it, what the artist added stays after."""
        self.item.modifiers.new("Cast", "CAST").factor = 0.1
        self.item.modifiers.new("Subdivision", "SUBSURF").levels = 1
        result = self.attach()["mesh:Cube"]
        result.modifiers.new("Mine", "DISPLACE").strength = 0.0
        self.settings.solver.particle_separation = 0.2
        self.attach()
        self.assertEqual([other.name for other in result.modifiers],
                         ["Cast", "Matterfit Cache", "Subdivision", "Mine"])

    def test_looks_of_text(self):
        bpy.ops.object.text_add(location=(0.0, 0.0, 0.5))
        text = bpy.context.active_object
        text.data.extrude, text.data.size = 0.05, 0.4
        text.data.materials.append(bpy.data.materials.new("Ink"))
        text.material_slots[0].link = "OBJECT"
        text.material_slots[0].material = bpy.data.materials.new("Red")
        text.visible_shadow, text.pass_index, text["mine"] = False, 7, 3
        self.body_row.object = text
        result = self.attach()["mesh:Cube"]
        self.assertEqual([slot.name for slot in result.material_slots], ["Red"])
        self.assertEqual((result.visible_shadow, result.pass_index, result["mine"]), (False, 7, 3))
