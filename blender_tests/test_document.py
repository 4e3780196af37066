# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene as a job document: what is written, what is sampled."""

import json
import math
import os

import bpy
import numpy
from matterfit.io import files, job_captures, job_document
from matterfit.jobs import JobError
from support import SceneCase, read, select, tree


def load(folder, relative):
    with numpy.load(os.path.join(folder, relative), allow_pickle=False) as arrays:
        return {name: arrays[name] for name in arrays.files}


class BodyTest(SceneCase):
    def test_a_cube(self):
        """Vertices about the object's origin in metres, the pose as placement."""
        item = self.cube(size=2.0, location=(1.0, 2.0, 3.0))
        item.scale = (0.1, 0.2, 0.3)
        item.rotation_euler = (0.0, 0.0, math.pi / 2)
        self.body(item)
        bpy.context.view_layer.update()
        document, folder = self.document()
        body = document["scene"]["bodies"][0]
        self.assertEqual(body["name"], "Cube")
        self.assertEqual(body["placement"]["position"], [1, 2, 3])
        self.assertAlmostEqual(body["placement"]["rotation"][0], math.sqrt(0.5), places=6)
        self.assertAlmostEqual(body["placement"]["rotation"][3], math.sqrt(0.5), places=6)
        arrays = load(folder, body["source"]["mesh"])
        numpy.testing.assert_allclose(arrays["vertices"].max(axis=0), (0.1, 0.2, 0.3), rtol=1e-5)
        self.assertEqual(arrays["face_sizes"].tolist(), [4] * 6)
        self.assertEqual(len(arrays["face_vertices"]), 24)
        self.assertEqual(document["scene"]["frames"], [1, 7])
        self.assertEqual(document["output"]["folder"], ".")

    def test_faces_stay_outside_when_mirrored(self):
        """The signed volume is positive whatever the object's scale."""
        item = self.cube()
        item.scale = (-1.0, 1.0, 1.0)
        self.body(item)
        bpy.context.view_layer.update()
        document, folder = self.document()
        arrays = load(folder, document["scene"]["bodies"][0]["source"]["mesh"])
        volume, start = 0.0, 0
        for size in arrays["face_sizes"]:
            a, *rest = arrays["vertices"][arrays["face_vertices"][start:start + size]]
            for b, c in zip(rest, rest[1:], strict=False):
                volume += float(numpy.dot(a, numpy.cross(b, c))) / 6.0
            start += size
        self.assertAlmostEqual(volume, 0.2**3, places=6)

    def test_scale_length(self):
        """With .01 m a unit, everything with a length shrinks; gravity does not."""
        self.scene.unit_settings.scale_length = 0.01
        body = self.body(self.cube(size=20.0, location=(0.0, 0.0, 50.0)))
        body.velocity = (100.0, 0.0, 0.0)
        self.settings.solver.particle_separation = 2.0
        self.settings.solver.ground_height = -5.0
        document, folder = self.document()
        scene = document["scene"]
        self.assertEqual(scene["particle_separation"], 0.02)
        self.assertEqual(scene["bodies"][0]["velocity"], [1, 0, 0])
        self.assertEqual(scene["bodies"][0]["placement"]["position"], [0, 0, 0.5])
        self.assertEqual(scene["colliders"][0]["height"], -0.05)
        self.assertEqual(scene["gravity"], [0, 0, -9.81])
        arrays = load(folder, scene["bodies"][0]["source"]["mesh"])
        numpy.testing.assert_allclose(arrays["vertices"].max(axis=0), (0.1, 0.1, 0.1), rtol=1e-5)
        mesh = document["output"]["mesh"][0]
        self.assertEqual(mesh["transform"]["scale"], 0.01)
        arrays = load(folder, mesh["mesh"])
        numpy.testing.assert_allclose(arrays["vertices"].max(axis=0), (10, 10, 10), rtol=1e-5)

    def test_cage_with_creases(self):
        """Before a Subdivision modifier the cage is used; sharpness is 10 c²."""
        item = self.cube()
        self.body(item)
        self.settings.solver.particle_separation = 0.07  # edges of .2 m bend with that
        item.modifiers.new("Subdivision", "SUBSURF").levels = 2
        if "crease" in item.data.edges[0].bl_rna.properties:
            item.data.edges[3].crease = 0.5
        else:
            crease = item.data.attributes.new("crease_edge", "FLOAT", "EDGE")
            crease.data[3].value = 0.5
        document, folder = self.document()
        source = document["scene"]["bodies"][0]["source"]
        self.assertEqual(source["level"], 2)
        arrays = load(folder, source["cage"])
        self.assertEqual(len(arrays["vertices"]), 8)
        self.assertEqual(arrays["crease_edges"].tolist(), [list(item.data.edges[3].vertices)])
        numpy.testing.assert_allclose(arrays["crease_sharpness"], [2.5])
        self.assertIn("cage", document["output"]["mesh"][0])

    def test_deformed_and_hidden(self):
        """Deformers count, our own cache modifier does not, and hidden objects are evaluated."""
        item = self.cube()
        self.body(item)
        modifier = item.modifiers.new("Cast", "CAST")
        modifier.factor = 1.0
        own = item.modifiers.new("Matterfit Cache", "SIMPLE_DEFORM")
        own.deform_method = "TAPER"
        own.factor = 5.0
        item.hide_viewport = True
        document, folder = self.document()
        arrays = load(folder, document["scene"]["bodies"][0]["source"]["mesh"])
        radii = numpy.linalg.norm(arrays["vertices"], axis=1)
        self.assertLess(radii.max() - radii.min(), 1e-5)
        self.assertTrue(item.hide_viewport)
        self.assertTrue(own.show_viewport)

    def test_material_and_damping(self):
        body = self.body(self.cube())
        body.material.preset = "CREAM"
        body.material.damping_shear = 3.0
        document, _folder = self.document()
        self.assertEqual(document["scene"]["bodies"][0]["material"], {
            "law": "herschel_bulkley", "E": 29900, "nu": 0.495, "yield_stress": 3000,
            "viscosity": 5, "exponent": 1, "damping_shear": 3})

    def test_same_scene_same_bytes(self):
        """Two writings differ in no byte, and leave the scene's frame as it was."""
        self.body(self.cube())
        self.scene.frame_set(4)
        document, folder = self.document()
        path = job_document.write(document, folder)
        before = tree(folder)
        document, folder = self.document()
        job_document.write(document, folder)
        self.assertEqual(before, tree(folder))
        self.assertIn("job.json", before)
        self.assertEqual(self.scene.frame_current, 4)
        self.assertTrue(os.path.basename(os.path.dirname(path)).startswith("cache_matterfit_"))
        json.loads(before["job.json"])


class PinTest(SceneCase):
    def test_vertex_group(self):
        """World places of the vertices that weigh at least one half, released at a frame."""
        item = self.cube(location=(0.0, 0.0, 0.5))
        body = self.body(item)
        group = item.vertex_groups.new(name="top")
        top = [vertex.index for vertex in item.data.vertices if vertex.co.z > 0.0]
        group.add(top, 1.0, "REPLACE")
        group.add([vertex.index for vertex in item.data.vertices if vertex.co.z < 0.0], 0.2,
                  "REPLACE")
        pin = body.pins.add()
        pin.kind, pin.vertex_group = "VERTEX_GROUP", "top"
        pin.radius, pin.use_release, pin.release = 0.03, True, 4
        document, folder = self.document()
        written = document["scene"]["bodies"][0]["pins"][0]
        self.assertEqual(written["release"], 4)
        self.assertEqual(written["region"]["radius"], 0.03)
        points = load(folder, written["region"]["file"])["positions"]
        self.assertEqual(len(points), 4)
        numpy.testing.assert_allclose(points[:, 2], 0.6, rtol=1e-6)

    def test_plane_that_follows(self):
        """The plane of an empty, moved by a keyed object about its place at the first frame."""
        body = self.body(self.cube())
        bpy.ops.object.empty_add(location=(0.0, 0.0, 0.55), rotation=(math.pi, 0.0, 0.0))
        plane = bpy.context.active_object
        bpy.ops.object.empty_add(location=(1.0, 0.0, 0.0))
        mover = bpy.context.active_object
        mover.keyframe_insert("location", frame=1)
        mover.location.x = 1.5
        mover.keyframe_insert("location", frame=6)
        pin = body.pins.add()
        pin.kind, pin.object, pin.follow = "PLANE", plane, mover
        document, _folder = self.document()
        written = document["scene"]["bodies"][0]["pins"][0]
        numpy.testing.assert_allclose(written["region"]["normal"], (0, 0, -1), atol=1e-6)
        self.assertEqual(written["region"]["point"], [0, 0, 0.55])
        self.assertEqual(written["pivot"], [1, 0, 0])
        self.assertEqual(written["motion"]["frames"], [1, 2, 3, 4, 5, 6])
        self.assertEqual(written["motion"]["values"][0]["position"], [0, 0, 0])
        self.assertAlmostEqual(written["motion"]["values"][-1]["position"][0], 0.5, places=5)

    def test_mass(self):
        body = self.body(self.cube())
        bpy.ops.object.empty_add(location=(0.0, 0.1, 0.6))
        mass = body.masses.add()
        mass.object, mass.mass = bpy.context.active_object, 0.052
        document, _folder = self.document()
        self.assertEqual(document["scene"]["bodies"][0]["masses"],
                         [{"position": [0, 0.1, 0.6], "mass": 0.052}])

    def test_mass_at_another_scale(self):
        """Kilograms as typed: a property with a unit would be shown and typed times scale³."""
        self.scene.unit_settings.scale_length = 0.01
        body = self.body(self.cube())
        mass = body.masses.add()
        mass.object, mass.mass = body.object, 0.052
        document, _folder = self.document()
        self.assertEqual(document["scene"]["bodies"][0]["masses"][0]["mass"], 0.052)
        self.assertEqual(mass.bl_rna.properties["mass"].unit, "NONE")


class ColliderTest(SceneCase):
    def setUp(self):
        super().setUp()
        self.body(self.cube())
        self.wall = self.cube("Wall", size=1.0, location=(2.0, 0.0, 0.0))
        self.row = self.body(self.wall, role="COLLIDER")

    def written(self):
        document, folder = self.document()
        return next(item for item in document["scene"]["colliders"]
                    if item["name"] == "Wall"), folder

    def test_static(self):
        self.row.contact.kind = "GLUE"
        collider, folder = self.written()
        self.assertEqual(collider["transform"], {"position": [2, 0, 0], "rotation": [1, 0, 0, 0]})
        self.assertEqual(collider["contact"], {"kind": "glue"})
        self.assertEqual(len(load(folder, collider["mesh"])["vertices"]), 8)

    def test_rigid_is_keyed_every_frame(self):
        self.row.collider_kind = "RIGID"
        self.wall.keyframe_insert("rotation_euler", frame=1)
        self.wall.rotation_euler.z = math.pi / 2
        self.wall.keyframe_insert("rotation_euler", frame=6)
        collider, _folder = self.written()
        self.assertEqual(collider["transform"]["frames"], [1, 2, 3, 4, 5, 6])
        self.assertAlmostEqual(collider["transform"]["values"][-1]["rotation"][0],
                               math.cos(math.pi / 4), places=6)

    def test_animated_scale_is_refused(self):
        self.row.collider_kind = "RIGID"
        self.wall.keyframe_insert("scale", frame=1)
        self.wall.scale = (2.0, 2.0, 2.0)
        self.wall.keyframe_insert("scale", frame=6)
        with self.assertRaisesRegex(JobError, "Set Motion to Deforming"):
            self.document()

    def test_deforming(self):
        """World meshes, one a frame, numbered by the scene's frames."""
        self.row.collider_kind = "DEFORMING"
        self.wall.keyframe_insert("scale", frame=1)
        self.wall.scale = (2.0, 1.0, 1.0)
        self.wall.keyframe_insert("scale", frame=6)
        collider, folder = self.written()
        self.assertEqual(collider["first_frame"], 1)
        self.assertEqual(len(collider["meshes"]), 6)
        self.assertTrue(collider["meshes"][5].endswith("_0006.npz"))
        numpy.testing.assert_allclose(
            load(folder, collider["meshes"][5])["vertices"].max(axis=0), (3.0, 0.5, 0.5), rtol=1e-5)

    def test_exact_shapes(self):
        self.row.collider_shape = "BOX"
        collider, _folder = self.written()
        self.assertEqual(collider["half_extents"], [0.5, 0.5, 0.5])
        self.wall.scale = (1.0, 1.0, 3.0)
        self.row.collider_shape = "CAPSULE"
        collider, _folder = self.written()
        self.assertEqual((collider["radius"], collider["half_length"]), (0.5, 1))
        self.row.collider_shape = "PLANE"
        collider, _folder = self.written()
        self.assertEqual(collider["normal"], [0, 0, 1])

    def test_container(self):
        box = self.cube("Box", size=4.0, location=(0.0, 0.0, 1.0))
        self.settings.solver.use_walls = True
        with self.assertRaisesRegex(JobError, "Container: no object"):
            self.document()
        self.settings.solver.container = box
        document, _folder = self.document()
        self.assertEqual(document["scene"]["walls"]["low"], [-2, -2, -1])
        self.assertEqual(document["scene"]["walls"]["high"], [2, 2, None])


class CaptureTest(SceneCase):
    def test_animated_object(self):
        """Evaluated vertices in the world, at every frame of the range."""
        self.body(self.cube())
        item = self.cube("Recorded", size=0.2, location=(0.0, 0.0, 0.5))
        item.keyframe_insert("location", frame=1)
        item.location.x = 1.0
        item.keyframe_insert("location", frame=6)
        for curve in item.animation_data.action.fcurves if hasattr(
                item.animation_data.action, "fcurves") else []:
            for key in curve.keyframe_points:
                key.interpolation = "LINEAR"
        select(item)
        bpy.ops.matterfit.add_capture_object()
        document, folder = self.document("compare")
        capture = document["captures"][0]
        self.assertEqual(capture["body"], "Cube")
        arrays = load(folder, capture["tracks"])
        self.assertEqual(arrays["positions"].shape, (6, 8, 3))
        numpy.testing.assert_allclose(arrays["times"], numpy.arange(6) / 24.0)
        middle = arrays["positions"].mean(axis=1)
        numpy.testing.assert_allclose(middle[0], (0.0, 0.0, 0.5), atol=1e-6)
        numpy.testing.assert_allclose(middle[5], (1.0, 0.0, 0.5), atol=1e-6)

    def test_file_options(self):
        self.body(self.cube())
        path = os.path.join(self.folder, "clip.npz")
        files.write_npz(path, {"positions": numpy.zeros((3, 2, 3)), "times": numpy.arange(3.0)})
        capture = self.settings.captures.add()
        capture.name, capture.filepath = "clip", "//clip.npz"
        capture.unit, capture.up = "MM", "Y"
        capture.use_noise, capture.noise = True, 0.001
        capture.holdout, capture.holdout_start = "FRAMES", 5
        capture.markers = "Tip-1, 2"
        capture.location = (0.0, 0.0, 1.0)
        document, _folder = self.document("compare")
        written = document["captures"][0]
        self.assertEqual(written["tracks"], "../clip.npz")
        self.assertEqual((written["unit"], written["up"]), ("mm", "y"))
        self.assertEqual(written["markers"], ["Tip-1", 2])
        self.assertEqual(written["holdout"], {"frames": [5, 7]})
        self.assertEqual(written["transform"]["position"], [0, 0, 1])
        self.assertEqual(written["noise"], 0.001)

    def test_align_to_empties(self):
        self.body(self.cube())
        path = os.path.join(self.folder, "clip.npz")
        files.write_npz(path, {"positions": numpy.zeros((3, 3, 3)), "times": numpy.arange(3.0)})
        capture = self.settings.captures.add()
        capture.name, capture.filepath = "clip", "//clip.npz"
        capture.use_release, capture.release = True, 3
        collection = bpy.data.collections.new("Markers")
        self.scene.collection.children.link(collection)
        for name, place in (("A", (0, 0, 0)), ("B", (1, 0, 0)), ("C", (0, 1, 0))):
            item = bpy.data.objects.new(name, None)
            item.location = place
            collection.objects.link(item)
        capture.align = collection
        bpy.context.view_layer.update()
        document, _folder = self.document("compare")
        self.assertEqual(document["captures"][0]["align"], {
            "markers": ["A", "B", "C"], "positions": [[0, 0, 0], [1, 0, 0], [0, 1, 0]],
            "frames": [1, 3]})
        self.assertEqual(document["captures"][0]["release"], 3)
        self.assertNotIn("transform", document["captures"][0])

    def test_pattern(self):
        self.assertEqual(job_captures.numbered_pattern("/a/take2_0012.ply"), "/a/take2_####.ply")
        self.assertEqual(job_captures.numbered_pattern("/a/cloud.ply"), "/a/cloud.ply")


class TakeTest(SceneCase):
    def test_throw(self):
        """Another place and velocity; the same input file, so nothing is filled anew."""
        item = self.cube()
        body = self.body(item)
        body.velocity = (1.0, 0.0, 0.0)
        bpy.ops.matterfit.add_take()
        document, folder = self.document()
        mesh = read(folder, document["scene"]["bodies"][0]["source"]["mesh"])
        self.settings.body_index = 0
        bpy.ops.matterfit.add_throw()
        throw = self.settings.takes[0].throws[0]
        self.assertEqual(tuple(throw.velocity), (1.0, 0.0, 0.0))
        throw.use_placement = True
        throw.location, throw.rotation = (0.0, 3.0, 2.0), (0.0, 0.0, math.pi)
        throw.velocity, throw.spin = (0.0, 5.0, 0.0), (0.0, 0.0, 7.0)
        self.settings.takes[0].use_gravity = True
        self.settings.takes[0].gravity = (0.0, 0.0, -1.62)
        document, folder = self.document()
        written = document["scene"]["bodies"][0]
        self.assertEqual(written["placement"]["position"], [0, 3, 2])
        self.assertEqual(written["velocity"], [0, 5, 0])
        self.assertEqual(written["spin"], [0, 0, 7])
        self.assertEqual(document["scene"]["gravity"], [0, 0, -1.62])
        self.assertEqual(document["output"]["mesh"][0]["transform"]["position"], [0, 3, 2])
        self.assertEqual(mesh, read(folder, written["source"]["mesh"]))

    def test_velocity_of_the_animation(self):
        """A turning, flying cube: the velocity of its centre, and its spin, at the first frame."""
        item = self.cube(location=(0.0, 0.0, 1.0))
        for vertex in item.data.vertices:
            vertex.co.x += 0.5  # the centre of mass is .5 m from the origin
        for frame in (1, 2):
            item.location.x = 0.1 * (frame - 1)
            item.rotation_euler.z = 0.05 * (frame - 1)
            item.keyframe_insert("location", frame=frame)
            item.keyframe_insert("rotation_euler", frame=frame)
        action = item.animation_data.action
        curves = getattr(action, "fcurves", None)
        if curves is None:
            curves = action.layers[0].strips[0].channelbags[0].fcurves
        for curve in curves:
            for key in curve.keyframe_points:
                key.interpolation = "LINEAR"
        self.body(item)
        bpy.ops.matterfit.add_take()
        bpy.ops.matterfit.add_throw()
        self.settings.takes[0].throws[0].velocity_from = "ANIMATION"
        document, _folder = self.document()
        body = document["scene"]["bodies"][0]
        numpy.testing.assert_allclose(body["spin"], (0.0, 0.0, 1.2), atol=1e-3)
        numpy.testing.assert_allclose(body["velocity"], (2.4, 0.6, 0.0), atol=2e-3)

    def test_colliders_of_a_take(self):
        self.body(self.cube())
        self.body(self.cube("Wall", location=(1, 0, 0)), role="COLLIDER")
        bpy.ops.matterfit.add_take()
        bpy.ops.matterfit.list_colliders()
        self.settings.takes[0].colliders[0].enabled = False
        document, _folder = self.document()
        self.assertEqual([item["name"] for item in document["scene"]["colliders"]], ["ground"])

    def test_names_that_name_nothing(self):
        """A throw or a switch whose body was renamed is refused, not left out."""
        body = self.body(self.cube())
        wall = self.body(self.cube("Wall", location=(1, 0, 0)), role="COLLIDER")
        body = self.settings.bodies[0]
        bpy.ops.matterfit.add_take()
        bpy.ops.matterfit.list_colliders()
        self.settings.body_index = 0
        bpy.ops.matterfit.add_throw()
        self.document()
        body.name = "Box"
        with self.assertRaisesRegex(JobError, "take 'Take 1': throws 'Cube'.*remove the throw"):
            self.document()
        body.name = "Cube"
        wall = self.settings.bodies[1]
        wall.name = "Mauer"
        with self.assertRaisesRegex(JobError, "collider 'Wall'.*List Colliders"):
            self.document()
        bpy.ops.matterfit.list_colliders()
        self.document()
        body.role = "COLLIDER"
        self.body(self.cube("Other", location=(3, 0, 0)))
        with self.assertRaisesRegex(JobError, "throws 'Cube'"):
            self.document()

    def test_keyed_gravity(self):
        self.body(self.cube())
        solver = self.settings.solver
        solver.gravity = (0.0, 0.0, -9.0)
        self.scene.keyframe_insert("matterfit.solver.gravity", frame=1)
        solver.gravity = (0.0, 0.0, 0.0)
        self.scene.keyframe_insert("matterfit.solver.gravity", frame=6)
        document, _folder = self.document()
        gravity = document["scene"]["gravity"]
        self.assertEqual(gravity["frames"], [1, 2, 3, 4, 5, 6])
        self.assertEqual(gravity["values"][0], [0, 0, -9])
        self.assertEqual(gravity["values"][-1], [0, 0, 0])
