# SPDX-License-Identifier: GPL-3.0-or-later
"""What a job document samples: at the scene's first frame wherever the playhead is, hidden or not,
and whichever outputs are on."""

import math
import os

import bpy
import numpy
from matterfit import compat
from matterfit.io import files, motion, shapes
from matterfit.jobs import JobError
from support import SceneCase, read

AWAY = 5  # where the playhead stands


def load(folder, relative):
    with numpy.load(os.path.join(folder, relative), allow_pickle=False) as arrays:
        return {name: arrays[name] for name in arrays.files}


def curves_of(item):
    action = item.animation_data.action
    if hasattr(action, "fcurves"):
        return action.fcurves
    return action.layers[0].strips[0].channelbags[0].fcurves


class SamplingCase(SceneCase):
    def setUp(self):
        super().setUp()
        self.item = self.cube(location=(0.0, 0.0, 1.0))
        self.row = self.body(self.item)
        self.settings.solver.particle_separation = 0.1  # the cube's faces are short enough

    def empty(self, name, location, first=1, last=6, step=(1.0, 0.0, 0.0), **arguments):
        """An empty at `location` in the first frame, which has moved by `step` in the last."""
        bpy.ops.object.empty_add(location=location, **arguments)
        item = bpy.context.active_object
        item.name = name
        self.animate(item, first, last, step)
        return item

    def animate(self, item, first, last, step):
        item.keyframe_insert("location", frame=first)
        item.location = [a + b for a, b in zip(item.location, step, strict=True)]
        item.keyframe_insert("location", frame=last)
        for curve in curves_of(item):
            for key in curve.keyframe_points:
                key.interpolation = "LINEAR"
        self.scene.frame_set(AWAY)

    def first_body(self):
        document, self.cache = self.document()
        self.assertEqual(self.scene.frame_current, AWAY)
        return document["scene"]["bodies"][0]


class FirstFrameTest(SamplingCase):
    """Animated markers, the playhead elsewhere, each marker hidden in another way."""

    def test_pin_plane(self):
        pin = self.row.pins.add()
        pin.kind = "PLANE"
        pin.object = self.empty("Plane", (0.0, 0.0, 0.9), step=(0.0, 0.0, 3.0),
                                rotation=(math.pi, 0.0, 0.0))
        pin.object.hide_viewport = True
        region = self.first_body()["pins"][0]["region"]
        numpy.testing.assert_allclose(region["point"], (0.0, 0.0, 0.9), atol=1e-6)
        numpy.testing.assert_allclose(region["normal"], (0.0, 0.0, -1.0), atol=1e-6)
        self.assertTrue(pin.object.hide_viewport)

    def test_pin_box(self):
        """An empty's box, and the box of a mesh after its modifiers."""
        pin = self.row.pins.add()
        pin.kind = "BOX"
        pin.object = self.empty("Box", (0.0, 0.0, 1.0), radius=0.5)
        region = self.first_body()["pins"][0]["region"]
        numpy.testing.assert_allclose(region["low"], (-0.5, -0.5, 0.5), atol=1e-6)
        numpy.testing.assert_allclose(region["high"], (0.5, 0.5, 1.5), atol=1e-6)
        mesh = self.cube("Mesh", size=1.0, location=(0.0, 0.0, 0.0))
        array = mesh.modifiers.new("Array", "ARRAY")
        array.count = 2
        self.animate(mesh, 1, 6, (0.0, 5.0, 0.0))
        mesh.hide_viewport = True
        pin.object = mesh
        region = self.first_body()["pins"][0]["region"]
        numpy.testing.assert_allclose(region["low"], (-0.5, -0.5, -0.5), atol=1e-6)
        numpy.testing.assert_allclose(region["high"], (1.5, 0.5, 0.5), atol=1e-6)

    def test_mass(self):
        mass = self.row.masses.add()
        mass.object = self.empty("Mass", (0.0, 0.1, 1.1))
        mass.object.hide_set(True)
        written = self.first_body()["masses"][0]
        numpy.testing.assert_allclose(written["position"], (0.0, 0.1, 1.1), atol=1e-6)
        self.assertTrue(mass.object.hide_get())

    def test_container(self):
        solver = self.settings.solver
        solver.use_walls, solver.open_top = True, False
        solver.container = self.empty("Container", (0.0, 0.0, 2.0), radius=2.0)
        solver.container.hide_viewport = True
        document, _folder = self.document()
        numpy.testing.assert_allclose(document["scene"]["walls"]["low"], (-2, -2, 0), atol=1e-6)
        numpy.testing.assert_allclose(document["scene"]["walls"]["high"], (2, 2, 4), atol=1e-6)
        self.assertEqual(self.scene.frame_current, AWAY)
        self.assertTrue(solver.container.hide_viewport)

    def test_align_empties(self):
        files.write_npz(os.path.join(self.folder, "clip.npz"),
                        {"positions": numpy.zeros((3, 3, 3)), "times": numpy.arange(3.0)})
        capture = self.settings.captures.add()
        capture.name, capture.filepath = "clip", "//clip.npz"
        capture.align = bpy.data.collections.new("Markers")
        self.scene.collection.children.link(capture.align)
        places = {"A": (0, 0, 0), "B": (1, 0, 0), "C": (0, 1, 0)}
        for name, place in places.items():
            capture.align.objects.link(self.empty(name, place))
        document, _folder = self.document("compare")
        written = document["captures"][0]["align"]
        self.assertEqual(written["markers"], list(places))
        numpy.testing.assert_allclose(written["positions"], list(places.values()), atol=1e-6)


class HiddenTest(SamplingCase):
    def test_follow(self):
        """A hidden object still moves what follows it."""
        pin = self.row.pins.add()
        pin.kind = "ALL"
        pin.follow = self.empty("Mover", (1.0, 0.0, 0.0), step=(0.5, 0.0, 0.0))
        for hide in ("hide_viewport", "eye"):
            pin.follow.hide_viewport = hide == "hide_viewport"
            pin.follow.hide_set(hide == "eye")
            written = self.first_body()["pins"][0]
            values = [value["position"][0] for value in written["motion"]["values"]]
            numpy.testing.assert_allclose(values, numpy.linspace(0.0, 0.5, 6), atol=1e-5)
            self.assertEqual(pin.follow.hide_viewport, hide == "hide_viewport")
            self.assertEqual(pin.follow.hide_get(), hide == "eye")

    def test_by_its_collection(self):
        """Hidden with a collection, by the eye or the monitor, itself or that around it; also where
        the object is in another collection that is hidden too."""
        rig, inner = bpy.data.collections.new("Rig"), bpy.data.collections.new("Inner")
        self.scene.collection.children.link(rig)
        rig.children.link(inner)
        pin = self.row.pins.add()
        pin.kind = "ALL"
        pin.follow = self.empty("Mover", (1.0, 0.0, 0.0), step=(0.5, 0.0, 0.0))
        self.scene.collection.objects.unlink(pin.follow)
        inner.objects.link(pin.follow)
        outer = bpy.context.view_layer.layer_collection.children["Rig"]
        for layer in (outer, outer.children["Inner"]):
            for item in (layer, layer.collection):
                item.hide_viewport = True
                self.scene.frame_set(AWAY)
                written = self.first_body()["pins"][0]
                values = [value["position"][0] for value in written["motion"]["values"]]
                numpy.testing.assert_allclose(values, numpy.linspace(0.0, 0.5, 6), atol=1e-5)
                self.assertTrue(item.hide_viewport)
                item.hide_viewport = False
        outer.exclude = True
        with self.assertRaisesRegex(JobError, "'Mover': is not in this view layer"):
            self.document()

    def test_a_body_in_a_hidden_collection(self):
        """With its modifiers."""
        rig = bpy.data.collections.new("Rig")
        self.scene.collection.children.link(rig)
        self.scene.collection.objects.unlink(self.item)
        rig.objects.link(self.item)
        self.item.modifiers.new("Array", "ARRAY").count = 2
        self.scene.frame_set(AWAY)
        wanted = self.first_body()
        _document, folder = self.document()
        path = os.path.join(folder, "input", f"body_{self.item.name}.npz")
        before = read(path)
        rig.hide_viewport = True
        self.scene.frame_set(AWAY)
        self.assertEqual(self.first_body(), wanted)
        self.document()
        self.assertEqual(read(path), before)

    def test_shown_for_two_reasons(self):
        """One object that is body, mass and what a pin follows is hidden again afterwards."""
        pin = self.row.pins.add()
        pin.kind, pin.follow = "ALL", self.item
        self.row.masses.add().object = self.item
        self.scene.frame_set(AWAY)
        self.item.hide_viewport = True
        self.first_body()
        self.assertTrue(self.item.hide_viewport)

    def test_velocity_of_the_animation(self):
        """A bake hides the object; its next take still starts with the velocity that it has."""
        self.animate(self.item, 1, 2, (0.1, 0.0, 0.0))
        bpy.ops.matterfit.add_take()
        bpy.ops.matterfit.add_throw()
        self.settings.takes[0].throws[0].velocity_from = "ANIMATION"
        self.item.hide_viewport = True
        numpy.testing.assert_allclose(self.first_body()["velocity"], (2.4, 0.0, 0.0), atol=2e-3)
        self.assertTrue(self.item.hide_viewport)


class KeyedTest(SamplingCase):
    """What Blender animates moves in the simulation too, without a word."""

    def collider(self, item):
        row = self.body(item, "COLLIDER")
        document, self.cache = self.document()
        return row, next(collider for collider in document["scene"]["colliders"]
                         if collider["name"] == row.name)

    def test_a_collider_that_stands(self):
        _row, written = self.collider(self.cube("Ramp", location=(1.0, 0.0, 0.0)))
        self.assertEqual(written["transform"]["position"], [1, 0, 0])

    def test_a_keyed_collider(self):
        item = self.cube("Ramp", location=(0.0, 0.0, 0.0))
        self.animate(item, 1, 6, (1.0, 0.0, 0.0))
        row, written = self.collider(item)
        self.assertEqual(motion.collider_kind(row), "RIGID")
        xs = [value["position"][0] for value in written["transform"]["values"]]
        numpy.testing.assert_allclose(xs, numpy.linspace(0.0, 1.0, 6), atol=1e-5)

    def test_a_parent_moves_it(self):
        item = self.cube("Ramp")
        item.parent = self.empty("Mover", (0.0, 0.0, 0.0))
        row, written = self.collider(item)
        self.assertEqual(motion.collider_kind(row), "RIGID")
        self.assertEqual(len(written["transform"]["values"]), 6)

    def test_a_mesh_that_deforms(self):
        item = self.cube("Ramp")
        item.shape_key_add(name="Basis")
        item.shape_key_add(name="Tall").data[0].co.z += 1.0
        key = item.data.shape_keys.key_blocks["Tall"]
        for frame, value in ((1, 0.0), (6, 1.0)):
            key.value = value
            key.keyframe_insert("value", frame=frame)
        row, written = self.collider(item)
        self.assertEqual(motion.collider_kind(row), "DEFORMING")
        self.assertEqual(len(written["meshes"]), 6)

    def test_a_keyed_modifier(self):
        item = self.cube("Ramp")
        modifier = item.modifiers.new("Cast", "CAST")
        for frame, value in ((1, 0.0), (6, 1.0)):
            modifier.factor = value
            modifier.keyframe_insert("factor", frame=frame)
        self.assertEqual(motion.collider_kind(self.body(item, "COLLIDER")), "DEFORMING")

    def test_a_body_flies_as_it_is_keyed(self):
        """2 m in x over 5 frames at 24 a second, offered when the body is added."""
        item = self.cube("Thrown", location=(0.0, 0.0, 1.0))
        self.animate(item, 1, 6, (2.0, 0.0, 0.0))
        row = self.body(item)
        self.assertEqual(row.velocity_from, "ANIMATION")
        document, _folder = self.document()
        written = next(body for body in document["scene"]["bodies"] if body["name"] == "Thrown")
        numpy.testing.assert_allclose(written["velocity"], (2.0 * 24 / 5, 0, 0), atol=1e-3)
        row.velocity_from = "VALUE"
        document, _folder = self.document()
        written = next(body for body in document["scene"]["bodies"] if body["name"] == "Thrown")
        self.assertEqual(written["velocity"], [0, 0, 0])

    def test_a_body_without_keys_has_typed_values(self):
        self.assertEqual(self.row.velocity_from, "VALUE")


class RenderOnlyTest(SamplingCase):
    def test_subdivision_of_the_render(self):
        """The cache moves the cage also where only the render subdivides it."""
        self.item.modifiers.new("Cast", "CAST").factor = 0.0
        modifier = self.item.modifiers.new("Subdivision", "SUBSURF")
        modifier.levels, modifier.render_levels = 1, 3
        modifier.show_viewport = False
        self.assertEqual(shapes.bound_shape(self.item).stop, 1)
        self.assertEqual(shapes.bound_shape(self.item).stop, 1)
        shape = shapes.body_shape(self.item)
        self.assertEqual((shape.kind, shape.stop, shape.level), ("cage", 1, 3))
        document, folder = self.document()
        mesh = document["output"]["mesh"][0]
        self.assertEqual(mesh["level"], 3)
        self.assertEqual(len(load(folder, mesh["cage"])["vertices"]), 8)
        modifier.show_render = False
        self.assertEqual(shapes.bound_shape(self.item).stop, 2)
        self.assertEqual(shapes.body_shape(self.item).kind, "mesh")

    def test_what_makes_the_shape_in_the_render(self):
        """An Array that only the render evaluates is simulated as well."""
        modifier = self.item.modifiers.new("Array", "ARRAY")
        modifier.show_viewport = False
        document, folder = self.document()
        source = document["scene"]["bodies"][0]["source"]["mesh"]
        self.assertEqual(len(load(folder, source)["vertices"]), 16)
        self.assertFalse(modifier.show_viewport)


class ModifierTest(SamplingCase):
    """Sampled after what makes the shape, bound before what only refines it."""

    def sampled(self):
        """(arrays of the body, arrays of the render mesh, its entry)."""
        document, folder = self.document()
        source = document["scene"]["bodies"][0]["source"]
        entry = document["output"]["mesh"][0]
        return (load(folder, source.get("mesh") or source["cage"]),
                load(folder, entry.get("mesh") or entry["cage"]), entry)

    def test_makers(self):
        """Mirror, Array, Solidify, Boolean: both have the vertices that the modifier makes."""
        other = self.cube("Other", size=0.2, location=(0.1, 0.1, 1.1))
        for kind, values in (("MIRROR", {}), ("ARRAY", {"count": 3}), ("SOLIDIFY", {}),
                             ("BOOLEAN", {"object": other, "solver": "EXACT"}), ("WELD", {}),
                             ("REMESH", {"voxel_size": 0.05})):
            with self.subTest(kind):
                self.item.modifiers.clear()
                self.item.location.x = 0.3
                modifier = self.item.modifiers.new("Maker", kind)
                for name, value in values.items():
                    setattr(modifier, name, value)
                self.item.modifiers.new("Subdivision", "SUBSURF")
                self.assertEqual(shapes.bound_shape(self.item).stop, 1)
                self.assertEqual((shapes.body_shape(self.item).kind,
                                  shapes.body_shape(self.item).stop), ("cage", 1))
                modifier_off = self.item.modifiers["Subdivision"]
                modifier_off.show_viewport = False
                bpy.context.view_layer.update()
                depsgraph = bpy.context.evaluated_depsgraph_get()
                count = len(self.item.evaluated_get(depsgraph).data.vertices)
                modifier_off.show_viewport = True
                body, render, entry = self.sampled()
                self.assertEqual(len(body["vertices"]), count)
                self.assertEqual(len(render["vertices"]), count)
                self.assertIn("cage", entry)

    def test_bevel_before_subdivision(self):
        """The body has both, the cache moves the mesh before either."""
        self.item.modifiers.new("Bevel", "BEVEL").width = 0.01
        self.item.modifiers.new("Subdivision", "SUBSURF")
        body, render, entry = self.sampled()
        self.assertEqual(len(body["vertices"]), 24)
        self.assertEqual(len(render["vertices"]), 8)
        self.assertIn("mesh", entry)
        self.assertIn("cage before 'Subdivision'", shapes.body_shape(self.item).text)

    def test_a_maker_after_a_refiner(self):
        """Then the finer mesh is part of what is made."""
        self.item.modifiers.new("Subdivision", "SUBSURF").levels = 1
        self.item.modifiers.new("Array", "ARRAY")
        body, render, _entry = self.sampled()
        self.assertEqual(len(body["vertices"]), 2 * 26)
        self.assertEqual(len(render["vertices"]), 2 * 26)

    def test_a_deformer_after_a_refiner(self):
        """What is refined and then deformed is the shape: deforming a moved mesh would distort it."""
        self.settings.solver.particle_separation = 1.0  # the displaced faces are short, too
        for kind in ("SIMPLE_DEFORM", "CAST", "DISPLACE", "WAVE", "SMOOTH"):
            for refiner in ("SUBSURF", "BEVEL"):
                with self.subTest(kind, refiner=refiner):
                    self.item.modifiers.clear()
                    self.item.modifiers.new("Finer", refiner)
                    self.item.modifiers.new("Moves", kind)
                    bound, body = shapes.bound_shape(self.item), shapes.body_shape(self.item)
                    self.assertEqual((bound.stop, bound.made), (2, True))
                    self.assertEqual((body.kind, body.text), ("mesh", "the mesh after 'Moves'"))
                    shape, render, _entry = self.sampled()
                    self.assertEqual(len(render["vertices"]), len(shape["vertices"]))
                    self.assertGreater(len(render["vertices"]), 8)
                    # What refines at the end stays with the result.
                    self.item.modifiers.new("Last", "SUBSURF")
                    self.assertEqual(shapes.bound_shape(self.item).stop, 2)
                    self.assertEqual((shapes.body_shape(self.item).kind,
                                      shapes.body_shape(self.item).stop), ("cage", 2))

    def test_what_the_shape_is_called(self):
        self.assertEqual(shapes.body_shape(self.item).text, "the object's own mesh")
        self.item.modifiers.new("Normals", "WEIGHTED_NORMAL")
        self.assertEqual(shapes.body_shape(self.item).text, "the object's own mesh")
        self.item.modifiers.new("Bend", "SIMPLE_DEFORM")
        self.assertEqual(shapes.body_shape(self.item).text, "the mesh after 'Bend'")

    def test_nothing_left_is_said_by_name(self):
        self.item.modifiers.new("Mirror", "MIRROR")
        group = self.item.vertex_groups.new(name="none")
        self.item.modifiers.new("Away", "MASK").vertex_group = group.name
        with self.assertRaisesRegex(JobError, "'Cube'.*modifier 'Away' leaves no surface"):
            self.document()

    def nodes(self, realized=True):
        """A node group that gives the object on every vertex a cube, as instances or not."""
        tree = bpy.data.node_groups.new("Cubes", "GeometryNodeTree")
        compat.add_group_socket(tree, "Geometry", "INPUT", "NodeSocketGeometry")
        compat.add_group_socket(tree, "Geometry", "OUTPUT", "NodeSocketGeometry")
        nodes = [tree.nodes.new(name) for name in (
            "NodeGroupInput", "GeometryNodeMeshToPoints", "GeometryNodeInstanceOnPoints",
            "GeometryNodeRealizeInstances", "NodeGroupOutput")]
        entry, points, place, realize, leave = nodes
        cube = tree.nodes.new("GeometryNodeMeshCube")
        cube.inputs["Size"].default_value = (0.05, 0.05, 0.05)
        tree.links.new(entry.outputs[0], points.inputs[0])
        tree.links.new(points.outputs[0], place.inputs["Points"])
        tree.links.new(cube.outputs["Mesh"], place.inputs["Instance"])
        tree.links.new(place.outputs[0], realize.inputs[0])
        tree.links.new((realize if realized else place).outputs[0], leave.inputs[0])
        self.item.modifiers.new("Scatter", "NODES").node_group = tree

    def test_geometry_nodes(self):
        self.nodes()
        body, render, _entry = self.sampled()
        self.assertEqual(len(body["vertices"]), 64)
        self.assertEqual(len(render["vertices"]), 64)
        self.assertIn("'Scatter'", shapes.body_shape(self.item).text)

    def test_instances_are_refused(self):
        self.nodes(realized=False)
        with self.assertRaisesRegex(JobError, "'Cube'.*'Scatter'.*Realize Instances"):
            self.document()

    def test_what_nothing_can_follow_is_refused(self):
        self.item.modifiers.new("Grow", "BUILD")
        with self.assertRaisesRegex(JobError, "'Cube'.*'Grow'.*Apply the modifier"):
            self.document()

    def test_shading_nodes_make_nothing(self):
        """Blender 4.1 shades smooth by a modifier, which says nothing of the shape."""
        tree = bpy.data.node_groups.new("Smooth by Angle", "GeometryNodeTree")
        compat.add_group_socket(tree, "Geometry", "INPUT", "NodeSocketGeometry")
        compat.add_group_socket(tree, "Geometry", "OUTPUT", "NodeSocketGeometry")
        tree.links.new(tree.nodes.new("NodeGroupInput").outputs[0],
                       tree.nodes.new("NodeGroupOutput").inputs[0])
        self.item.modifiers.new("Subdivision", "SUBSURF")
        self.item.modifiers.new("Smooth by Angle", "NODES").node_group = tree
        self.assertEqual(shapes.body_shape(self.item).kind, "cage")
        self.assertEqual(shapes.bound_shape(self.item).stop, 0)

    def test_pins_of_a_mirrored_group(self):
        """The mirrored half of a vertex group is held too."""
        self.item.location.x = 0.3
        group = self.item.vertex_groups.new(name="top")
        group.add([vertex.index for vertex in self.item.data.vertices if vertex.co.z > 0.0], 1.0,
                  "REPLACE")
        mirror = self.item.modifiers.new("Mirror", "MIRROR")
        mirror.mirror_object = self.cube("Middle", location=(0.0, 0.0, 5.0))
        mirror.use_clip = False
        pin = self.row.pins.add()
        pin.kind, pin.vertex_group = "VERTEX_GROUP", "top"
        document, folder = self.document()
        region = document["scene"]["bodies"][0]["pins"][0]["region"]
        self.assertEqual(len(load(folder, region["file"])["positions"]), 8)
