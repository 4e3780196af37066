# SPDX-License-Identifier: GPL-3.0-or-later
"""Which meshes are refined, and to how many faces."""

import os
from unittest import mock

import bpy
import numpy
from matterfit import compat
from matterfit.io import halving, meshes, refinement, shapes
from support import SceneCase


class BoundTest(SceneCase):
    """As many faces as there may be, and which meshes stay as they are."""

    def setUp(self):
        super().setUp()
        self.item = self.cube()
        patch = mock.patch.object(refinement, "MOST_FACES", 2000)
        patch.start()
        self.addCleanup(patch.stop)

    def read(self, separation, stretch=((1, 0, 0), (0, 1, 0), (0, 0, 1))):
        return refinement.read(self.item, numpy.array(stretch, dtype=float), separation)

    def subdivided(self, level):
        modifier = self.item.modifiers.new("Subdivision", "SUBSURF")
        modifier.levels = modifier.render_levels = level

    def test_what_modifiers_make_counts(self):
        """The faces of an array, or what nodes make of an empty mesh, and not only the object's own mesh."""
        array = self.item.modifiers.new("Array", "ARRAY")
        array.count = 50
        self.subdivided(5)
        arrays, refined = self.read(0.02)
        self.assertTrue(refined)
        self.assertTrue(1200 <= len(arrays["face_sizes"]) <= 2000, len(arrays["face_sizes"]))

        tree = bpy.data.node_groups.new("Make", "GeometryNodeTree")
        compat.add_group_socket(tree, "Geometry", "OUTPUT", "NodeSocketGeometry")
        grid, end = tree.nodes.new("GeometryNodeMeshCube"), tree.nodes.new("NodeGroupOutput")
        for name in ("Vertices X", "Vertices Y", "Vertices Z"):
            grid.inputs[name].default_value = 8
        tree.links.new(grid.outputs[0], end.inputs[0])
        self.item.modifiers.clear()
        self.item.data.clear_geometry()
        self.item.modifiers.new("Make", "NODES").node_group = tree
        self.subdivided(5)
        arrays, refined = self.read(0.02)
        self.assertTrue(refined)
        self.assertTrue(6 * 49 * 4 <= len(arrays["face_sizes"]) <= 2000, len(arrays["face_sizes"]))

    def test_a_long_face_of_many(self):
        """The mesh has too many faces already: it stays as it is, and its Subdivision with it."""
        bpy.ops.mesh.primitive_grid_add(x_subdivisions=60, y_subdivisions=60, size=0.2)
        self.item = bpy.context.active_object
        mesh = self.item.data
        mesh.vertices[0].co.x = -5.0
        self.subdivided(2)
        arrays, refined = self.read(0.02)
        self.assertFalse(refined)
        self.assertEqual(len(arrays["face_sizes"]), len(mesh.polygons))

    def test_uneven_scale(self):
        """Bristles, .3 m long and 1 mm thick: the bound holds, and every one is divided."""
        bpy.ops.mesh.primitive_cube_add(size=1.0)
        self.item = bpy.context.active_object
        array = self.item.modifiers.new("Array", "ARRAY")
        array.count, array.relative_offset_displace = 100, (2.0, 0.0, 0.0)
        arrays, refined = self.read(0.002, ((0.001, 0, 0), (0, 0.001, 0), (0, 0, 0.3)))
        self.assertTrue(refined)
        self.assertTrue(1500 < len(arrays["face_sizes"]) <= 2000, len(arrays["face_sizes"]))
        bristles = numpy.round(arrays["vertices"][:, 0] / 0.002).astype(int)
        counts = numpy.unique(bristles, return_counts=True)[1]
        self.assertEqual(len(counts), 100)
        self.assertGreater(min(counts), 8)

    def test_a_large_area(self):
        """Evenly, where the wanted length would make too many."""
        arrays, refined = self.read(0.02, ((50, 0, 0), (0, 50, 0), (0, 0, 50)))
        self.assertTrue(refined)
        self.assertTrue(1000 < len(arrays["face_sizes"]) <= 2000, len(arrays["face_sizes"]))
        sides = halving.lengths(arrays)
        self.assertLess(sides.max() / sides.min(), 2.1)

    def test_the_area(self):
        arrays = meshes.read_arrays(self.item.data, numpy.diag((1.0, 2.0, 3.0)), 1.0)
        self.assertAlmostEqual(halving.area(arrays), 0.04 * 2.0 * (2.0 + 3.0 + 6.0), places=6)

    def test_what_makes_the_shape_stays_as_sampled(self):
        """A Subdivision before a deformer belongs to the shape: it is not made finer."""
        modifier = self.item.modifiers.new("Subdivision", "SUBSURF")
        modifier.levels, modifier.render_levels = 1, 4
        self.item.modifiers.new("Cast", "CAST").factor = 0.1
        arrays, refined = self.read(0.02)
        self.assertTrue(refined)
        self.assertLess(len(arrays["face_sizes"]), 400)

    def test_smooth(self):
        """It is the bound mesh's shading that counts, and nothing is not smooth."""
        for polygon in self.item.data.polygons:
            polygon.use_smooth = True
        bound = shapes.bound_shape(self.item)
        cage = refinement._Cage(self.item, bound, numpy.eye(3))
        self.assertTrue(cage.smooth)
        self.item.data.clear_geometry()
        bpy.context.view_layer.update()
        self.assertFalse(refinement._Cage(self.item, bound, numpy.eye(3)).smooth)

    def test_an_empty_file(self):
        path = os.path.join(self.folder, "empty.npz")
        open(path, "wb").close()
        self.assertIsNone(refinement.how_refined(path))
