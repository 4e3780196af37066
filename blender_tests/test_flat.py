# SPDX-License-Identifier: GPL-3.0-or-later
"""Flat shapes, and vertex groups that pin, as they are sampled."""

import bpy
import numpy
from mathutils import Matrix
from matterfit.jobs import JobError
from support import SceneCase
from test_sampling import AWAY, SamplingCase, load


class PinnedGroupTest(SamplingCase):
    def test_without_render_meshes(self):
        """A vertex group lies where the deformed mesh has it, whether its mesh is baked or not."""
        group = self.item.vertex_groups.new(name="top")
        group.add([vertex.index for vertex in self.item.data.vertices if vertex.co.z > 0.0], 1.0,
                  "REPLACE")
        taper = self.item.modifiers.new("Taper", "SIMPLE_DEFORM")
        taper.deform_method, taper.factor = "TAPER", 1.0
        pin = self.row.pins.add()
        pin.kind, pin.vertex_group = "VERTEX_GROUP", "top"
        self.scene.frame_set(AWAY)
        found = []
        for output in (True, False):
            self.settings.output.mesh = output
            region = self.first_body()["pins"][0]["region"]
            found.append(load(self.cache, region["file"])["positions"])
        numpy.testing.assert_array_equal(found[0], found[1])
        undeformed = [self.item.matrix_world @ vertex.co for vertex in self.item.data.vertices
                      if vertex.co.z > 0.0]
        self.assertGreater(numpy.abs(found[1] - numpy.array(undeformed)).max(), 0.01)


class FlatTest(SceneCase):
    """What lies in one plane has nothing that could be filled."""

    def refused(self, item, advice="give it a thickness"):
        self.settings.bodies.clear()
        self.body(item)
        with self.assertRaisesRegex(JobError, f"^'{item.name}' is flat: {advice}"):
            self.document()

    def test_flat(self):
        bpy.ops.mesh.primitive_plane_add(location=(0.3, 0.0, 1.0), rotation=(0.4, 0.3, 0.2))
        self.refused(bpy.context.active_object)
        # Turned in its own mesh as well, where float32 leaves it not quite flat.
        item = bpy.context.active_object
        item.data.transform(Matrix.Translation((5.0, 7.0, 3.0)) @ Matrix.Rotation(0.7, 4, (1, 2, 3)))
        self.refused(item)
        bpy.ops.object.text_add(location=(0.0, 0.0, 1.0))
        self.refused(bpy.context.active_object)
        item = self.cube("Pressed")
        item.scale.z = 0.0
        self.refused(item, "its Scale, or a parent's, is 0")  # no thickness helps there

    def test_thin_is_not_flat(self):
        item = self.cube("Thin")
        item.scale.z = 1e-4
        self.body(item)
        bpy.ops.mesh.primitive_plane_add(location=(0.0, 0.0, 1.0))
        plane = bpy.context.active_object
        plane.modifiers.new("Solidify", "SOLIDIFY").thickness = 0.01
        self.body(plane)
        bpy.ops.mesh.primitive_plane_add(location=(0.0, 0.0, 0.0))
        self.body(bpy.context.active_object, "COLLIDER")
        self.assertEqual(len(self.document()[0]["scene"]["bodies"]), 2)
