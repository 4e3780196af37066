# SPDX-License-Identifier: GPL-3.0-or-later
"""The result of an object with a negative scale looks outside, as the object does."""

import bmesh
import bpy
import numpy
from attach_case import FRAMES, evaluated_points
from mathutils import Vector
from matterfit.io import attach, refinement
from test_refinement import RefinementCase


def volume_seen(item):
    """Signed volume that the faces enclose as they are drawn: Blender turns those of an object that is
    mirrored."""
    mesh = bmesh.new()
    evaluated = item.evaluated_get(bpy.context.evaluated_depsgraph_get())
    mesh.from_mesh(evaluated.to_mesh())
    evaluated.to_mesh_clear()
    try:
        return mesh.calc_volume(signed=True)
    finally:
        mesh.free()


class MirroredTest(RefinementCase):
    def setUp(self):
        super().setUp()
        self.item.data.vertices[0].co.x -= 0.05  # tells left from right
        self.item.data.update()

    def outside(self, kind):
        """The result lies where the object is, rises, and looks outside."""
        self.item.scale = (-1.5, 1.0, 1.0)
        bpy.context.view_layer.update()
        result = self.attach()["mesh:Cube"]
        self.assertEqual(result.data.get("matterfit", 0), kind)
        rise = numpy.array(result.rotation_quaternion.to_matrix())[:, 2] * 0.1  # of the file, which is not turned
        original = evaluated_points(self.item, FRAMES[0])
        for passed, frame in enumerate(FRAMES[:2]):
            points = evaluated_points(result, frame) - passed * rise
            numpy.testing.assert_allclose(points.min(axis=0), original.min(axis=0), atol=1e-5)
            numpy.testing.assert_allclose(points.max(axis=0), original.max(axis=0), atol=1e-5)
        self.assertGreater(volume_seen(self.item), 0.0)
        self.assertGreater(volume_seen(result), 0.0)
        return result

    def test_refined(self):
        self.outside(2)

    def test_the_objects_own_mesh(self):
        self.settings.solver.particle_separation = 0.2
        result = self.outside(0)
        self.assertIs(result.data, self.item.data)

    def test_made_by_modifiers(self):
        self.settings.solver.particle_separation = 0.2
        self.item.modifiers.new("Solidify", "SOLIDIFY")
        self.outside(1)

    def test_baked_again_without_the_mirror(self):
        """The same result follows."""
        self.outside(2)
        self.item.scale = (1.5, 1.0, 1.0)
        bpy.context.view_layer.update()
        result = self.attach()["mesh:Cube"]
        self.assertEqual(tuple(result.scale), (1.0, 1.0, 1.0))
        self.assertGreater(volume_seen(result), 0.0)
        numpy.testing.assert_allclose(evaluated_points(result, FRAMES[0]).max(axis=0),
                                      evaluated_points(self.item, FRAMES[0]).max(axis=0), atol=1e-5)

    def test_the_object_is_gone_meanwhile(self):
        """What was sampled is shown, and looks outside too."""
        self.item.scale = (-1.5, 1.0, 1.0)
        bpy.context.view_layer.update()
        document, self.folder_of_cache = self.document()
        self.write_files(document)
        self.item.data.clear_geometry()
        shown = attach.Attachment(self.scene, self.take, self.folder_of_cache, document)
        shown.update(final=True)
        self.assertEqual(len(shown.notes), 1)
        result = next(item for item in self.take.collection.objects if item["matterfit"] == "mesh:Cube")
        self.assertGreater(volume_seen(result), 0.0)
        self.assertLess(result.scale.x, 0.0)

    def test_what_is_not_mirrored_has_no_mark(self):
        document, folder = self.document()
        path = f"{folder}/{document['output']['mesh'][0]['mesh']}"
        self.assertFalse(refinement.is_mirrored(path))
        self.assertFalse(refinement.is_mirrored(f"{folder}/missing.npz"))
        self.item.scale = Vector((-1.0, -1.0, 1.0))
        bpy.context.view_layer.update()
        document, folder = self.document()
        self.assertFalse(refinement.is_mirrored(f"{folder}/{document['output']['mesh'][0]['mesh']}"))
