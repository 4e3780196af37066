# SPDX-License-Identifier: GPL-3.0-or-later
"""A mesh with faces too long to bend is refined before it is bound."""

import os
from unittest import mock

import bpy
import numpy
from attach_case import FRAMES, AttachCase, evaluated_points
from fake_cache import write_pc2
from matterfit.io import attach, cache, job_writer, refinement, shapes, takes
from matterfit.jobs import JobError
from support import SceneCase, needs_library, select


class RefinementCase(AttachCase):
    def setUp(self):
        super().setUp()
        self.settings.solver.particle_separation = 0.02

    def write_files(self, document):
        """Sampled vertices, which rise by .1 a frame."""
        entry = document["output"]["mesh"][0]
        path = os.path.join(self.folder_of_cache, entry.get("mesh") or entry["cage"])
        with numpy.load(path) as arrays:
            self.arrays = dict(arrays)
        rise = numpy.array((0.0, 0.0, 0.1))
        write_pc2(os.path.join(self.folder_of_cache, "mesh", f"{entry['name']}.pc2"),
                  [self.arrays["vertices"] + rise * k for k in range(len(FRAMES))])


class RefinementTest(RefinementCase):
    def edges(self):
        """(E,) lengths of the edges of the sampled mesh's faces."""
        found, first = [], 0
        for size in self.arrays["face_sizes"]:
            corners = self.arrays["vertices"][self.arrays["face_vertices"][first:first + size]]
            found.append(numpy.linalg.norm(corners - numpy.roll(corners, 1, axis=0), axis=1))
            first += size
        return numpy.concatenate(found)

    def area(self, mesh):
        return sum(polygon.area for polygon in mesh.polygons)

    def test_a_cube(self):
        """Its faces stay in their planes, with their UVs, and the artist's mesh as it was."""
        result = self.attach()["mesh:Cube"]
        self.assertLessEqual(self.edges().max(), 0.04 + 1e-6)
        self.assertGreater(self.edges().min(), 0.019)
        self.assertIsNot(result.data, self.item.data)
        self.assertEqual(len(self.item.data.vertices), 8)
        self.assertAlmostEqual(self.area(result.data), 6 * 0.2 ** 2, places=5)
        self.assertTrue((numpy.abs(self.arrays["vertices"]).max(axis=1) > 0.0999).all())
        layer = result.data.uv_layers[0].data
        self.assertGreater(len({tuple(round(value, 4) for value in entry.uv) for entry in layer}), 100)
        last = evaluated_points(result, FRAMES[-1])
        numpy.testing.assert_allclose(last - evaluated_points(result, FRAMES[0]),
                                      [(0.0, 0.0, 0.1 * (len(FRAMES) - 1))] * len(last), atol=1e-5)

    def test_fine_enough(self):
        self.settings.solver.particle_separation = 0.2 / 3.0 + 1e-4
        self.assertIs(self.attach()["mesh:Cube"].data, self.item.data)

    def test_a_cage(self):
        """What refines it is applied, as fine as the render has it and whatever Simplify says; the
        object keeps what it had."""
        modifier = self.item.modifiers.new("Subdivision", "SUBSURF")
        modifier.levels, modifier.render_levels = 1, 3
        self.scene.render.use_simplify, self.scene.render.simplify_subdivision = True, 0
        result = self.attach()["mesh:Cube"]
        self.assertEqual(len(result.data.vertices), 386)
        self.assertEqual([modifier.name for modifier in result.modifiers], ["Matterfit Cache"])
        self.assertEqual((modifier.levels, modifier.render_levels), (1, 3))
        self.assertTrue(self.scene.render.use_simplify)
        self.assertEqual(len(evaluated_points(result, FRAMES[-1])), 386)

    def test_a_smooth_cage(self):
        """It is subdivided on, so that its outline is round: all vertices lie as far out as the limit
        surface, none on a straight line between two of its points."""
        self.item.modifiers.new("Subdivision", "SUBSURF").levels = 1
        self.item.modifiers["Subdivision"].render_levels = 1
        for polygon in self.item.data.polygons:
            polygon.use_smooth = True
        result = self.attach()["mesh:Cube"]
        self.assertEqual(len(result.data.vertices), 386)
        self.assertEqual(self.item.modifiers["Subdivision"].levels, 1)
        ring = self.arrays["vertices"][numpy.abs(self.arrays["vertices"][:, 2]) < 1e-4]
        self.assertLess(numpy.ptp(numpy.linalg.norm(ring, axis=1)), 0.01)

    def test_another_separation_binds_another_mesh(self):
        """With the modifiers of its kind."""
        modifier = self.item.modifiers.new("Subdivision", "SUBSURF")
        modifier.levels = modifier.render_levels = 2
        for separation, names in ((0.02, ["Matterfit Cache"]),
                                  (0.2, ["Matterfit Cache", "Subdivision"]),
                                  (0.02, ["Matterfit Cache"])):
            self.settings.solver.particle_separation = separation
            shown = self.attach()
            self.assertEqual(list(shown), ["mesh:Cube"])
            self.assertEqual([other.name for other in shown["mesh:Cube"].modifiers], names)

    def test_a_scaled_object(self):
        """Lengths are those of the world, and those of the bake also where it was scaled later."""
        self.item.scale = (3.0, 1.0, 1.0)
        document = self.attach() and self.document()[0]
        self.assertLessEqual(self.edges().max(), 0.04 + 1e-6)
        count = len(self.arrays["vertices"])
        self.item.scale = (1.0, 1.0, 1.0)
        attach.Attachment(self.scene, self.take, self.folder_of_cache, document).update(final=True)
        self.assertEqual(len(next(iter(self.take.collection.objects)).data.vertices), count)

    def test_faces_of_many_corners(self):
        """The middle of a cylinder's end has vertices too."""
        bpy.ops.mesh.primitive_cylinder_add(vertices=48, radius=0.1, depth=0.2)
        self.item = bpy.context.active_object
        self.body_row.object = self.item
        self.attach()
        self.assertLessEqual(self.edges().max(), 0.04 + 1e-6)
        inside = numpy.linalg.norm(self.arrays["vertices"][:, :2], axis=1) < 0.08
        self.assertGreater(inside.sum(), 20)

    def test_only_where_it_is_written(self):
        """A preview and a fit bake no mesh, and read none."""
        with mock.patch.object(refinement, "read", side_effect=AssertionError("read")):
            self.assertNotIn("mesh", self.document(outputs=False)[0]["output"])
            writer = job_writer.JobWriter(self.scene, self.take, self.folder)
            self.assertTrue(writer.bakes_meshes)
            with self.assertRaisesRegex(JobError, "no capture to fit to"):
                self.document("fit")

    def test_hair_keeps_the_mesh(self):
        settings = self.item.modifiers.new("Fur", "PARTICLE_SYSTEM").particle_system.settings
        settings.type = "HAIR"
        self.assertIs(self.attach()["mesh:Cube"].data, self.item.data)

    def test_text(self):
        """What is no mesh is bound as the one that it looks like."""
        bpy.ops.object.text_add(location=(0.0, 0.0, 0.5))
        text = bpy.context.active_object
        text.data.extrude, text.data.size = 0.05, 0.4
        text.data.materials.append(bpy.data.materials.new("Ink"))
        self.body_row.object = text
        result = self.attach()["mesh:Cube"]
        self.assertEqual(result.type, "MESH")
        self.assertEqual([slot.name for slot in result.material_slots], ["Ink"])
        self.assertLessEqual(self.edges().max(), 0.04 + 1e-6)
        self.assertEqual(len(evaluated_points(result, FRAMES[-1])), len(self.arrays["vertices"]))
        self.assertEqual(shapes.bound_shape(text).kind, "mesh")


class FirstJellyTest(SceneCase):
    @needs_library
    def test_stands_on_the_floor(self):
        """The cage of eight corners, subdivided: what is seen sinks in no farther than what was
        simulated."""
        item = self.cube(size=2.0, location=(0.0, 0.0, 1.3))
        select(item)
        bpy.ops.object.subdivision_set(level=2)
        row = self.body(item)
        row.velocity = (0.0, 0.0, -5.0)
        self.settings.solver.particle_separation = 0.2
        self.scene.frame_end = 8
        bpy.ops.matterfit.bake()
        take = self.settings.takes[0]
        shown = next(other for other in take.collection.objects if other["matterfit"] == "mesh:Cube")
        points = cache.read_pc2(os.path.join(takes.locate(take).folder, "points", "Cube.pc2"))
        simulated = [cache.read_pc2_frame(points, k)[:, 2].min() for k in range(points.samples)]
        seen = [evaluated_points(shown, 1 + k)[:, 2].min() for k in range(points.samples)]
        self.assertLess(min(seen), 0.05)
        self.assertGreater(min(seen), min(simulated) - 0.1)
