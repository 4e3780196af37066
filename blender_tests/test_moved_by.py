# SPDX-License-Identifier: GPL-3.0-or-later
"""What is moved by another object, by a constraint, by nodes, or by keys of its scale."""

import bpy
import numpy
from mathutils import Matrix
from matterfit.io import motion
from matterfit.ui import throw_overlay
from support import SceneCase


class MovedByTest(SceneCase):
    def setUp(self):
        super().setUp()
        self.item = self.cube("Thing", location=(0.0, 0.0, 1.0))
        self.mover = bpy.data.objects.new("Mover", None)
        self.scene.collection.objects.link(self.mover)

    def key(self, item, name, *values):
        """Keys at frames 1 and 6, linear."""
        for frame, value in zip((1, 6), values, strict=True):
            setattr(item, name, value)
            item.keyframe_insert(name, frame=frame)
        for curve in motion._curves(item.animation_data.action):
            for point in curve.keyframe_points:
                point.interpolation = "LINEAR"
        self.scene.frame_set(1)

    def starts_with(self, row, velocity):
        """The body is thrown by what moves it as soon as it is added."""
        self.assertEqual(row.velocity_from, "ANIMATION")
        document, _folder = self.document()
        numpy.testing.assert_allclose(document["scene"]["bodies"][0]["velocity"], velocity, atol=2e-3)

    def test_a_body_that_is_carried(self):
        self.item.parent = self.mover
        self.key(self.mover, "location", (0.0, 0.0, 0.0), (1.0, 0.0, 0.0))
        self.starts_with(self.body(self.item), (24 / 5, 0.0, 0.0))

    def test_where_it_is_carried_is_known(self):
        """Without playing frames: for the arrow, and for what is said of keys that set off slowly."""
        self.item.parent = self.mover
        self.item.matrix_parent_inverse = Matrix.Translation((0.0, 0.0, -1.0))
        self.mover.rotation_euler.z = 1.0
        self.key(self.mover, "location", (0.0, 0.0, 0.0), (1.0, 0.0, 0.0))
        row = self.body(self.item)
        for frame, matrix in zip((1, 3, 6), motion.keyed_matrices(self.item, (1, 3, 6)), strict=True):
            self.scene.frame_set(frame)
            numpy.testing.assert_allclose(matrix, self.item.matrix_world, atol=1e-6)
        self.assertIsNone(motion.slow_start(self.item, 1, 6))
        flights = throw_overlay.flights(self.scene)
        self.assertEqual([flight.name for flight in flights], [row.name])
        numpy.testing.assert_allclose(flights[0].velocity, (24 / 5, 0.0, 0.0), atol=2e-3)
        for curve in motion._curves(self.mover.animation_data.action):
            for point in curve.keyframe_points:
                point.interpolation = "BEZIER"
        self.assertGreater(motion.slow_start(self.item, 1, 6).fastest, 0.0)
        self.item.constraints.new("COPY_ROTATION")
        self.assertIsNone(motion.keyed_matrices(self.item, (1, 3, 6)))

    def test_a_body_that_follows(self):
        constraint = self.item.constraints.new("COPY_LOCATION")
        constraint.target = self.mover
        self.key(self.mover, "location", (0.0, 0.0, 1.0), (0.0, 2.0, 1.0))
        constraint.mute = True
        self.assertFalse(motion.is_keyed(self.item))
        constraint.mute = False
        self.starts_with(self.body(self.item), (0.0, 2 * 24 / 5, 0.0))

    def test_a_body_on_what_stands(self):
        self.item.parent = self.mover
        self.mover.parent = None
        self.mover.constraints.new("COPY_LOCATION").target = self.item  # round in a ring
        self.assertEqual(self.body(self.item).velocity_from, "VALUE")

    def test_a_collider_that_grows(self):
        """Its mesh is sampled at every frame, as it is no rigid motion."""
        self.key(self.item, "scale", (1.0, 1.0, 1.0), (1.0, 1.0, 3.0))
        row = self.body(self.item, "COLLIDER")
        self.assertEqual(motion.collider_kind(row), "DEFORMING")
        self.jelly(location=(3.0, 0.0, 1.0))
        document, _folder = self.document()
        written = next(found for found in document["scene"]["colliders"] if found["name"] == "Thing")
        self.assertEqual(len(written["meshes"]), 6)
        row.collider_shape = "BOX"
        self.assertEqual(motion.collider_kind(row), "RIGID")

    def test_a_collider_whose_keyed_scale_stays(self):
        """As keys of location, rotation and scale together leave it."""
        self.key(self.item, "scale", (2.0, 2.0, 2.0), (2.0, 2.0, 2.0))
        self.assertEqual(motion.collider_kind(self.body(self.item, "COLLIDER")), "RIGID")

    def test_a_collider_whose_parent_grows(self):
        self.item.parent = self.mover
        self.key(self.mover, "scale", (1.0, 1.0, 1.0), (2.0, 2.0, 2.0))
        self.assertEqual(motion.collider_kind(self.body(self.item, "COLLIDER")), "DEFORMING")

    def test_a_collider_with_nodes_of_time(self):
        """Geometry Nodes that ask for the scene's time, also inside of a group."""
        inner = bpy.data.node_groups.new("Inner", "GeometryNodeTree")
        outer = bpy.data.node_groups.new("Outer", "GeometryNodeTree")
        outer.nodes.new("GeometryNodeGroup").node_tree = inner
        self.item.modifiers.new("Nodes", "NODES").node_group = outer
        row = self.body(self.item, "COLLIDER")
        self.assertEqual(motion.collider_kind(row), "STATIC")
        inner.nodes.new("GeometryNodeInputSceneTime")
        self.assertEqual(motion.collider_kind(row), "DEFORMING")

    def test_a_collider_in_a_lattice_that_bends(self):
        lattice = bpy.data.objects.new("Cage", bpy.data.lattices.new("Cage"))
        self.scene.collection.objects.link(lattice)
        self.item.modifiers.new("Lattice", "LATTICE").object = lattice
        row = self.body(self.item, "COLLIDER")
        self.assertEqual(motion.collider_kind(row), "STATIC")
        lattice.shape_key_add(name="Basis")
        bent = lattice.shape_key_add(name="Bent")
        for frame, value in ((1, 0.0), (6, 1.0)):
            bent.value = value
            bent.keyframe_insert("value", frame=frame)
        self.assertEqual(motion.collider_kind(row), "DEFORMING")

    def test_a_curve_that_thickens(self):
        curve = bpy.data.curves.new("Rope", "CURVE")
        rope = bpy.data.objects.new("Rope", curve)
        self.scene.collection.objects.link(rope)
        row = self.body(rope, "COLLIDER")
        self.assertEqual(motion.collider_kind(row), "STATIC")
        for frame, depth in ((1, 0.1), (6, 0.2)):
            curve.bevel_depth = depth
            curve.keyframe_insert("bevel_depth", frame=frame)
        self.assertEqual(motion.collider_kind(row), "DEFORMING")
