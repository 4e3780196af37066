# SPDX-License-Identifier: GPL-3.0-or-later
"""Sand as grains: several about each particle, which stay the same from frame to frame."""

import os

import bpy
import numpy
from attach_case import FRAMES, AttachCase
from fake_cache import write_exr, write_pc2
from matterfit import native
from support import needs_library

CORNERS = 6  # of a grain


def grains(item, depsgraph):
    """(middles (N, 3), velocities (N, 3), volumes (N,)) of the octahedra of a cloud."""
    evaluated = item.evaluated_get(depsgraph)
    mesh = evaluated.to_mesh()
    places = numpy.empty(3 * len(mesh.vertices), dtype=numpy.float32)
    mesh.vertices.foreach_get("co", places)
    velocity = numpy.empty_like(places)
    mesh.attributes["velocity"].data.foreach_get("vector", velocity)
    evaluated.to_mesh_clear()
    corners = places.reshape(-1, CORNERS, 3)
    middles = corners.mean(axis=1)
    radius = numpy.linalg.norm(corners - middles[:, None], axis=2)
    numpy.testing.assert_allclose(radius, radius[:, :1].repeat(CORNERS, axis=1), rtol=1e-2)
    return middles, velocity.reshape(-1, CORNERS, 3)[:, 0], 4.0 / 3.0 * radius[:, 0] ** 3


class GrainsTest(AttachCase):
    def setUp(self):
        super().setUp()
        self.body_row.material.preset = "SAND"

    def write_files(self, document):
        """Four particles a metre apart that move along y, a metre a frame."""
        folder = self.folder_of_cache
        self.particles = numpy.array([(float(k), 0.0, 0.0) for k in range(4)])
        write_pc2(os.path.join(folder, "points", "Cube.pc2"),
                  [self.particles + (0.0, float(k), 0.0) for k in range(len(FRAMES))])
        for frame in FRAMES:
            write_exr(os.path.join(folder, "attributes", f"Cube_velocity_{frame:04d}.exr"),
                      numpy.array([(float(k), 24.0, 0.0) for k in range(4)]), 2)

    def shown(self):
        item = self.attach(points=True, attributes=["velocity"])["points:Cube"]
        self.assertFalse(item.hide_render or item.hide_viewport)
        return item

    def in_viewport(self, item, frame):
        self.scene.frame_set(frame)
        return grains(item, bpy.context.evaluated_depsgraph_get())

    def test_about_their_particles(self):
        """Each has its particle's velocity and keeps its place beside it; together they are as large as
        the particles, whatever their number."""
        item = self.shown()
        separation = self.settings.solver.particle_separation
        volumes = []
        for count in (16, 400):
            self.settings.output.grains = count
            places, velocity, volume = self.in_viewport(item, FRAMES[0])
            self.assertEqual(len(places), 4 * count // 4)
            own = numpy.rint(velocity[:, 0]).astype(int)
            self.assertEqual(numpy.bincount(own).tolist(), [count // 4] * 4)
            away = places - self.particles[own]
            self.assertLess(numpy.abs(away).max(), 2.0 * separation)
            volumes.append(volume.sum())
            later, moving, _volume = self.in_viewport(item, FRAMES[2])
            numpy.testing.assert_allclose(later - places, [(0.0, 2.0, 0.0)] * len(places), atol=1e-5)
            numpy.testing.assert_allclose(moving, velocity, atol=1e-5)
        self.assertEqual(len(numpy.unique(places, axis=0)), 400)
        numpy.testing.assert_allclose(away.mean(axis=0), 0.0, atol=0.15 * separation)
        self.assertGreater(away.std(), 0.4 * separation)
        self.assertAlmostEqual(volumes[1] / volumes[0], 1.0, delta=0.35)
        filled = volumes[1] / (4.0 * separation ** 3)
        self.assertAlmostEqual(filled, 0.6, delta=0.1)

    def test_a_render_has_all_of_them(self):
        item = self.shown()
        counts = []

        def look(scene, depsgraph):
            if depsgraph.mode == "RENDER":
                counts.append(len(grains(scene.objects[item.name], depsgraph)[0]))

        camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
        self.scene.collection.objects.link(camera)
        self.scene.camera = camera
        render = self.scene.render
        render.engine, render.resolution_x, render.resolution_y = "CYCLES", 8, 8
        self.scene.cycles.samples, self.scene.cycles.use_denoising = 1, False
        render.filepath = os.path.join(self.folder, "one.png")
        bpy.app.handlers.frame_change_post.append(look)
        self.addCleanup(bpy.app.handlers.frame_change_post.remove, look)
        bpy.ops.render.render(write_still=True)
        self.assertEqual(set(counts), {4 * 16})

    def test_of_another_law(self):
        """Its particles are points."""
        self.body_row.material.preset = "WATER"
        item = self.attach(points=True, attributes=["velocity"])["points:Cube"]
        item.hide_viewport = False
        tree = item.modifiers["Matterfit Particles"].node_group
        self.assertIsNone(tree.nodes.get("Grains"))

    @needs_library
    def test_baked(self):
        """While it bakes and afterwards."""
        self.assertTrue(native.load())
        self.settings.solver.particle_separation = 0.1
        bpy.ops.matterfit.bake()
        items = {item["matterfit"]: item for item in self.take.collection.objects}
        self.assertEqual({tag for tag, item in items.items() if not item.hide_render}, {"points:Cube"})
        self.assertIsNotNone(items["surface:Cube"])
        item = items["points:Cube"]
        particles = len(item.data.vertices)
        self.assertEqual(len(self.in_viewport(item, FRAMES[1])[0]), 4 * particles)
