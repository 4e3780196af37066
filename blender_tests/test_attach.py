# SPDX-License-Identifier: GPL-3.0-or-later
"""Attached caches play natively: here, in a second Blender that does not know us, and rendered."""

import json
import os

import bpy
import numpy
from attach_case import FRAMES, AttachCase, evaluated_points
from fake_cache import write_exr, write_pc2
from matterfit.io import attach, attached, cache, shapes, takes
from matterfit.jobs import JobError
from support import second_process, select


class MeshTest(AttachCase):
    """A render mesh whose cache lifts it by .1 m a frame."""

    def write_files(self, document):
        local = numpy.array([vertex.co for vertex in self.item.data.vertices])
        samples = [local + (0.0, 0.0, 0.1 * k) for k in range(len(FRAMES))]
        write_pc2(os.path.join(self.folder_of_cache, "mesh", "Cube.pc2"), samples)

    def test_moves_and_gives_way(self):
        """The result moves with the cache; the artist's object hides and comes back."""
        items = self.attach()
        result = items["mesh:Cube"]
        for k, frame in enumerate(FRAMES):
            points = evaluated_points(result, frame)
            numpy.testing.assert_allclose(points.mean(axis=0), (0, 0, 1 + 0.1 * k), atol=1e-5)
        self.assertEqual(self.frames_done, len(FRAMES))
        self.assertTrue(self.item.hide_render)
        self.assertIs(result.data, self.item.data)
        attached.detach(self.scene, self.take)
        self.assertFalse(self.item.hide_render)
        self.assertNotIn("matterfit_hidden", self.item)
        self.assertIsNone(self.take.collection)
        self.assertEqual([item.name for item in self.scene.objects], ["Cube"])

    def test_outputs_that_are_gone_leave(self):
        """After a bake with other outputs no object points to files that are not written."""
        self.attach()
        document, folder = self.document()
        document["output"]["mesh"] = []
        attach.Attachment(self.scene, self.take, folder, document).update(final=True)
        self.assertEqual(list(self.take.collection.objects), [])
        self.assertGreater(len(self.item.data.vertices), 0)

    def test_before_subdivision_after_deformers(self):
        self.item.modifiers.new("Cast", "CAST").factor = 0.0
        self.item.modifiers.new("Subdivision", "SUBSURF").levels = 2
        result = self.attach()["mesh:Cube"]
        self.assertEqual([modifier.name for modifier in result.modifiers],
                         ["Cast", "Matterfit Cache", "Subdivision"])
        self.assertGreater(len(evaluated_points(result, FRAMES[0])), 8)

    def test_before_a_subdivision_of_the_render(self):
        """Behind it the cache would meet another number of vertices in the render."""
        self.item.modifiers.new("Cast", "CAST").factor = 0.0
        self.item.modifiers.new("Subdivision", "SUBSURF").show_viewport = False
        result = self.attach()["mesh:Cube"]
        self.assertEqual([modifier.name for modifier in result.modifiers],
                         ["Cast", "Matterfit Cache", "Subdivision"])

    def test_the_mesh_stays_as_it_is(self):
        """The result shows the artist's own mesh, which gets no material of ours."""
        result = self.attach()["mesh:Cube"]
        self.assertIs(result.data, self.item.data)
        self.assertEqual(len(self.item.data.materials), 0)
        self.assertEqual(len(self.item.material_slots), 0)

    def test_scaled_turned_and_animated(self):
        """The result stands where the cache says, whatever the object's own transform does."""
        self.item.scale = (1.0, 2.0, 0.5)
        self.item.rotation_euler = (0.3, 0.2, 0.1)
        self.item.keyframe_insert("location", frame=FRAMES[0])
        self.item.location.x = 9.0
        self.item.keyframe_insert("location", frame=FRAMES[-1])
        self.scene.frame_set(FRAMES[0])
        start = evaluated_points(self.item, FRAMES[0])
        document, folder = self.document()
        with numpy.load(os.path.join(folder, document["output"]["mesh"][0]["mesh"])) as arrays:
            local = arrays["vertices"]
        write_pc2(os.path.join(folder, "mesh", "Cube.pc2"), [local] * len(FRAMES))
        attach.Attachment(self.scene, self.take, folder, document).update()
        result = next(item for item in self.take.collection.objects)
        for frame in (FRAMES[0], FRAMES[-1]):
            numpy.testing.assert_allclose(evaluated_points(result, frame), start, atol=1e-5)

    def test_hair_grows_on_the_result(self):
        """It follows the cache; other particles would be emitted once more."""
        settings = self.item.modifiers.new("Fur", "PARTICLE_SYSTEM").particle_system.settings
        settings.type, settings.count = "HAIR", 10
        self.item.modifiers.new("Sparks", "PARTICLE_SYSTEM")
        self.item.modifiers.new("Subdivision", "SUBSURF").levels = 1
        result = self.attach()["mesh:Cube"]
        self.assertEqual([modifier.name for modifier in result.modifiers],
                         ["Matterfit Cache", "Fur", "Subdivision"])
        roots = []
        for frame in FRAMES:
            self.scene.frame_set(frame)
            evaluated = result.evaluated_get(bpy.context.evaluated_depsgraph_get())
            roots.append(evaluated.particle_systems[0].co_hair(evaluated, particle_no=0, step=0).z)
        numpy.testing.assert_allclose(numpy.diff(roots), 0.1, atol=1e-4)
        self.assertFalse(shapes.loses_hair(self.item))
        self.item.modifiers.new("Mirror", "MIRROR")
        self.assertTrue(shapes.loses_hair(self.item))

    def test_changed_mesh_is_said(self):
        """Blender would show the undeformed mesh and say nothing."""
        self.attach()
        document, folder = self.document()
        self.item.data = self.item.data.copy()
        self.item.data.vertices.add(1)
        with self.assertRaisesRegex(JobError, "holds 8 points.*9 vertices.*bake again"):
            attach.Attachment(self.scene, self.take, folder, document).update()

    def test_a_result_as_a_capture(self):
        """It is recorded as it plays, not as the mesh that it shows at rest."""
        result = self.attach()["mesh:Cube"]
        capture = self.settings.captures.add()
        capture.name, capture.source, capture.object = "take", "OBJECT", result
        document, folder = self.document("compare")
        with numpy.load(os.path.join(folder, document["captures"][0]["tracks"])) as arrays:
            heights = arrays["positions"].mean(axis=1)[:, 2]
        numpy.testing.assert_allclose(heights, 1.0 + 0.1 * numpy.arange(len(FRAMES)), atol=1e-5)
        result["matterfit"] = "points:Cube"
        with self.assertRaisesRegex(JobError, "'take'.*Choose the take's mesh"):
            self.document("compare")
        self.settings.captures.clear()
        select(result)
        self.fails(bpy.ops.matterfit.add_capture_object, ["Choose the take's mesh"])
        self.assertEqual(len(self.settings.captures), 0)

    def test_a_result_is_no_body(self):
        """It is refused when it is added, and where it was chosen in a row; a copy that holds the
        shape alone is an object as any other."""
        result = self.attach()["mesh:Cube"]
        for role in ("BODY", "COLLIDER"):
            result.hide_set(False)
            select(result)
            self.fails(bpy.ops.matterfit.add_body, [f"'{result.name}' shows what was simulated"],
                       role=role)
            self.assertEqual(len(self.settings.bodies), 1)
            row = self.settings.bodies.add()
            row.name, row.role, row.object = "Again", role, result
            with self.assertRaisesRegex(JobError, "'Again': .* shows what was simulated"):
                self.document()
            self.settings.bodies.remove(1)
        result.modifiers.clear()
        self.body(result)
        self.assertEqual(len(self.document()[0]["scene"]["bodies"]), 2)

    def test_after_what_makes_the_shape(self):
        """A mirrored mesh moves as one: the result shows what Mirror made, and refines that."""
        self.item.location.x = 0.3
        mirror = self.item.modifiers.new("Mirror", "MIRROR")
        mirror.mirror_object = bpy.data.objects.new("Middle", None)
        self.scene.collection.objects.link(mirror.mirror_object)
        self.item.modifiers.new("Subdivision", "SUBSURF").levels = 1
        document, folder = self.document()
        with numpy.load(os.path.join(folder, document["output"]["mesh"][0]["cage"])) as arrays:
            local = arrays["vertices"]
        self.assertEqual(len(local), 16)
        write_pc2(os.path.join(folder, "mesh", "Cube.pc2"),
                  [local + (0.0, 0.0, 0.1 * k) for k in range(len(FRAMES))])
        attach.Attachment(self.scene, self.take, folder, document).update()
        result = next(iter(self.take.collection.objects))
        self.assertEqual([modifier.name for modifier in result.modifiers],
                         ["Matterfit Cache", "Subdivision"])
        self.assertIsNot(result.data, self.item.data)
        self.assertEqual(len(result.data.vertices), 16)
        for k, frame in enumerate(FRAMES):
            points = evaluated_points(result, frame)
            self.assertEqual(len(points), 52)
            numpy.testing.assert_allclose(points.mean(axis=0), (0, 0, 1 + 0.1 * k), atol=1e-4)
        attach.Attachment(self.scene, self.take, folder, document).update(final=True)
        self.assertEqual([mesh.name for mesh in bpy.data.meshes if "matterfit" in mesh],
                         [result.data.name])
        attached.detach(self.scene, self.take)
        self.assertEqual([mesh.name for mesh in bpy.data.meshes if "matterfit" in mesh], [])
        self.assertFalse(self.item.hide_viewport)

    def test_plays_without_us(self):
        """Saved, opened in another process that has no add-on: the same places."""
        self.attach()
        self.save("scene.blend")
        found = second_process("""
assert not hasattr(bpy.types.Scene, "matterfit")
heights = {}
item = next(item for item in bpy.context.scene.objects if item.get("matterfit") == "mesh:Cube")
for frame in (3, 5, 7):
    bpy.context.scene.frame_set(frame)
    mesh = item.evaluated_get(bpy.context.evaluated_depsgraph_get()).to_mesh()
    heights[frame] = sum(vertex.co.z for vertex in mesh.vertices) / len(mesh.vertices)
print(json.dumps(heights))
""", blend=os.path.join(self.folder, "scene.blend"))
        for frame, height in found.items():
            self.assertAlmostEqual(height, 0.1 * (int(frame) - 3), places=5)


class MovedTest(AttachCase):
    """What the artist has moved in the outliner is found where it is."""

    def write_files(self, document):
        local = numpy.array([vertex.co for vertex in self.item.data.vertices])
        for kind in ("mesh", "points"):
            write_pc2(os.path.join(self.folder_of_cache, kind, "Cube.pc2"), [local] * len(FRAMES))

    def shelf(self, *items, below=None):
        """A collection of the artist's, with these objects in it and nowhere else."""
        collection = bpy.data.collections.new("Shelf")
        (below or self.scene.collection).children.link(collection)
        for item in items:
            for other in item.users_collection:
                other.objects.unlink(item)
            collection.objects.link(item)
        return collection

    def tagged(self):
        return sorted(item["matterfit"] for item in self.scene.objects if "matterfit" in item)

    def test_object(self):
        result = self.attach()["mesh:Cube"]
        shelf = self.shelf(result)
        self.attach()
        self.assertEqual(self.tagged(), ["mesh:Cube", "points:Cube"])
        self.assertEqual(result.users_collection, (shelf,))
        attached.detach(self.scene, self.take)
        self.assertEqual([item.name for item in self.scene.objects], ["Cube"])
        self.assertFalse(self.item.hide_render)

    def test_collection_below_another(self):
        self.attach()
        shelf = self.shelf()
        shelf.children.link(self.take.collection)
        self.scene.collection.children.unlink(self.take.collection)
        self.attach()
        self.assertEqual(list(self.scene.collection.children), [shelf])
        self.assertEqual(self.tagged(), ["mesh:Cube", "points:Cube"])

    def test_object_in_a_collection_of_the_take(self):
        """The collection is not removed with what the artist keeps in it."""
        result = self.attach()["points:Cube"]
        shelf = self.shelf(result, below=self.take.collection)
        lamp = bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "SUN"))
        shelf.objects.link(lamp)
        self.attach()
        self.assertEqual(self.tagged(), ["mesh:Cube", "points:Cube"])
        attached.detach(self.scene, self.take)
        self.assertEqual(sorted(item.name for item in self.scene.objects), ["Cube", "Lamp"])

    def test_without_its_collection(self):
        """Deleted in the outliner, a collection leaves its objects to the one above."""
        items = self.attach()
        for item in items.values():
            self.scene.collection.objects.link(item)
        bpy.data.collections.remove(self.take.collection)
        self.assertIsNone(self.take.collection)
        self.attach()
        self.assertEqual(self.tagged(), ["mesh:Cube", "points:Cube"])
        attached.detach_kind(self.take, "points")
        self.assertEqual(self.tagged(), ["mesh:Cube"])

    def test_of_another_take(self):
        """Both takes' objects have the same tags; each finds its own, also side by side."""
        first = self.attach()["mesh:Cube"]
        bpy.ops.matterfit.add_take()
        first_take, self.take = self.settings.takes[0], self.settings.takes[1]
        second = self.attach()["mesh:Cube"]
        self.assertNotEqual(first, second)
        self.shelf(first, second)
        self.attach()
        self.assertEqual(self.tagged(), ["mesh:Cube"] * 2 + ["points:Cube"] * 2)
        attached.detach(self.scene, self.take)
        self.assertEqual(self.tagged(), ["mesh:Cube", "points:Cube"])
        self.assertIn(first, attached.objects_of(self.scene, first_take))

    def test_of_an_older_version(self):
        """Without the folder's name on them objects are found in the take's collection."""
        items = self.attach()
        for item in items.values():
            del item["matterfit_cache"]
        self.attach()
        self.assertEqual(self.tagged(), ["mesh:Cube", "points:Cube"])
        self.assertEqual({item["matterfit_cache"] for item in items.values()},
                         {os.path.basename(self.folder_of_cache)})

    def test_a_linked_take_keeps_its_objects(self):
        """Save As, then a bake into a folder of its own: what is shown is brought up to date."""
        result = self.attach()["mesh:Cube"]
        self.shelf(result)
        self.save("scene.blend")
        self.save("copy.blend")
        self.take = self.settings.takes[0]
        self.attach()
        self.assertEqual(self.tagged(), ["mesh:Cube", "points:Cube"])
        self.assertIn(os.path.basename(self.folder_of_cache),
                      result.modifiers["Matterfit Cache"].filepath)


class CopiedSceneTest(AttachCase):
    """A scene copied with its takes: none of them writes or deletes what another one shows."""

    def write_files(self, document):
        local = numpy.array([vertex.co for vertex in self.item.data.vertices])
        write_pc2(os.path.join(self.folder_of_cache, "mesh", "Cube.pc2"), [local] * len(FRAMES))
        with open(os.path.join(self.folder_of_cache, "manifest.json"), "w") as stream:
            json.dump({"files": {"mesh/Cube.pc2": {"size": 1, "hash": ""}}}, stream)

    def copied(self, kind):
        self.attach()
        self.take.baked = True
        bpy.ops.scene.new(type=kind)
        copy = bpy.context.scene
        self.assertNotEqual(copy, self.scene)
        self.assertEqual(copy.matterfit.takes[0].folder, self.take.folder)
        self.results = {scene: [item for item in scene.objects if "matterfit" in item]
                        for scene in (self.scene, copy)}
        self.assertEqual([len(items) for items in self.results.values()], [1, 1])
        return copy

    def test_bake(self):
        """Whichever scene bakes first gets a folder of its own, the other keeps the cache."""
        for kind in ("FULL_COPY", "LINK_COPY"):
            with self.subTest(kind):
                self.setUp()
                copy = self.copied(kind)
                take = copy.matterfit.takes[0]
                self.assertTrue(takes.locate(take).linked and takes.locate(take).shared)
                folder = takes.claim(take)
                self.assertNotEqual(folder, self.folder_of_cache)
                self.assertFalse(take.baked)
                self.assertIsNone(take.collection)
                self.assertEqual([item for item in copy.objects if "matterfit" in item], [])
                self.assertFalse(takes.locate(take).linked)
                self.assertEqual(takes.claim(take), folder)
                # The original is as it was, and again alone with its cache.
                self.assertTrue(self.take.baked)
                self.assertEqual(attached.objects_of(self.scene, self.take),
                                 self.results[self.scene])
                self.assertIsNotNone(self.take.collection)
                self.assertFalse(takes.locate(self.take).linked)
                self.assertEqual(takes.claim(self.take), self.folder_of_cache)

    def test_free(self):
        """Free in one scene leaves the files to the other, Free in that one deletes them."""
        for kind in ("FULL_COPY", "LINK_COPY"):
            with self.subTest(kind):
                self.setUp()
                copy = self.copied(kind)
                bpy.ops.matterfit.free()
                self.assertEqual(copy.matterfit.takes[0].folder, "")
                self.assertFalse(copy.matterfit.takes[0].baked)
                self.assertEqual([item for item in copy.objects if "matterfit" in item], [])
                self.assertTrue(os.path.isdir(self.folder_of_cache))
                self.assertEqual(attached.objects_of(self.scene, self.take),
                                 self.results[self.scene])
                bpy.context.window.scene = self.scene
                bpy.ops.matterfit.free()
                self.assertFalse(os.path.exists(self.folder_of_cache))
                self.assertEqual([item.name for item in self.scene.objects], ["Cube"])


class ParticleTest(AttachCase):
    """Seven particles in textures of three columns, so that rows are not full."""

    COUNT = 7

    def write_files(self, document):
        folder = self.folder_of_cache
        k = numpy.arange(self.COUNT, dtype=float)
        self.places = numpy.stack((k, 0.0 * k, 0.0 * k), axis=1)
        write_pc2(os.path.join(folder, "points", "Cube.pc2"),
                  [self.places + (0.0, float(step), 0.0) for step in range(len(FRAMES))])
        for step, frame in enumerate(FRAMES):
            values = numpy.stack((k + 1.0, 10.0 * k, 100.0 * step + 0.0 * k), axis=1)
            write_exr(os.path.join(folder, "attributes", f"Cube_velocity_{frame:04d}.exr"),
                      values, 3)

    def test_points_and_attributes(self):
        """The vertices move; the texture's pixel of each particle arrives, clamped past the end."""
        item = self.attach(points=True, attributes=["velocity"])["points:Cube"]
        item.hide_viewport = False
        modifier = item.modifiers["Matterfit Particles"]
        # Points are no mesh: their attributes are read through Points to Vertices.
        tree = modifier.node_group
        output = next(node for node in tree.nodes if node.type == "GROUP_OUTPUT")
        source = output.inputs[0].links[0].from_socket
        back = tree.nodes.new("GeometryNodePointsToVertices")
        tree.links.new(source, back.inputs[0])
        tree.links.new(back.outputs[0], output.inputs[0])
        k = numpy.arange(self.COUNT)
        for frame, step in ((3, 0), (5, 2), (7, 4), (40, 4), (1, 0)):
            self.scene.frame_set(frame)
            evaluated = item.evaluated_get(bpy.context.evaluated_depsgraph_get())
            mesh = evaluated.to_mesh()
            attribute = mesh.attributes["velocity"]
            values = numpy.empty(self.COUNT * 3, dtype=numpy.float32)
            attribute.data.foreach_get("vector", values)
            places = numpy.empty(self.COUNT * 3, dtype=numpy.float32)
            mesh.vertices.foreach_get("co", places)
            evaluated.to_mesh_clear()
            expected = numpy.stack((k + 1.0, 10.0 * k, 100.0 * step + 0.0 * k), axis=1)
            numpy.testing.assert_allclose(values.reshape(-1, 3), expected, err_msg=str(frame))
            numpy.testing.assert_allclose(places.reshape(-1, 3),
                                          self.places + (0.0, step, 0.0), atol=1e-6)

    def test_scale_length(self):
        """The cache is in metres: the object that shows it is 1 / scale_length as large."""
        self.scene.unit_settings.scale_length = 0.01
        item = self.attach(points=True)["points:Cube"]
        numpy.testing.assert_allclose(tuple(item.scale), (100.0,) * 3, rtol=1e-6)

    def test_truncated(self):
        self.attach(points=True)
        path = os.path.join(self.folder_of_cache, "points", "Cube.pc2")
        with open(path, "r+b") as stream:
            stream.truncate(os.path.getsize(path) - 5)
        with self.assertRaisesRegex(JobError, "Cube.pc2: has .* truncated"):
            cache.read_pc2(path)
        with open(path, "wb") as stream:
            stream.write(b"x" * 40)
        with self.assertRaisesRegex(JobError, "is not a PC2 file"):
            cache.read_pc2(path)

    def test_unfinished_shows_its_newest_frame(self):
        """While baking the PC2 has another name; what it holds by now is seen."""
        document, folder = self.document()
        document["output"].update(points=True)
        path = os.path.join(folder, "points", "Cube.pc2.partial")
        write_pc2(path, numpy.zeros((2, 4, 3)) + [[[1.0]], [[2.0]]])
        done = attach.Attachment(self.scene, self.take, folder, document).update()
        item = next(item for item in self.take.collection.objects)
        self.assertEqual(done, 2)
        self.assertEqual([vertex.co.x for vertex in item.data.vertices], [2.0] * 4)


class FreeTest(AttachCase):
    def write_files(self, document):
        local = numpy.array([vertex.co for vertex in self.item.data.vertices])
        write_pc2(os.path.join(self.folder_of_cache, "mesh", "Cube.pc2"), [local] * 5)
        with open(os.path.join(self.folder_of_cache, "manifest.json"), "w") as stream:
            json.dump({"files": {"mesh/Cube.pc2": {"size": 1, "hash": ""}}}, stream)
        with open(os.path.join(self.folder_of_cache, "job.json"), "w") as stream:
            json.dump(document, stream)

    def test_only_what_is_listed(self):
        """Ours goes, a stranger's file stays and is named; the folder stays with it."""
        self.attach()
        stranger = os.path.join(self.folder_of_cache, "mesh", "notes.txt")
        with open(stranger, "w") as stream:
            stream.write("mine")
        left = cache.free(self.folder_of_cache)
        self.assertEqual(left, [os.path.join("mesh", "notes.txt")])
        self.assertEqual(sorted(os.listdir(self.folder_of_cache)), ["mesh"])
        os.remove(stranger)
        self.assertEqual(cache.free(self.folder_of_cache), [])
        self.assertFalse(os.path.exists(self.folder_of_cache))

    def test_a_manifest_cannot_point_outside(self):
        self.attach()
        outside = os.path.join(self.folder, "precious.txt")
        with open(outside, "w") as stream:
            stream.write("mine")
        with open(os.path.join(self.folder_of_cache, "manifest.json"), "w") as stream:
            json.dump({"files": {"../precious.txt": {}, outside: {}}}, stream)
        cache.free(self.folder_of_cache)
        self.assertTrue(os.path.isfile(outside))
