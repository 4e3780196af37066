# SPDX-License-Identifier: GPL-3.0-or-later
"""Sand as grains: several about each particle, which stay the same from frame to frame."""

import os

import bpy
import numpy
from attach_case import FRAMES, AttachCase
from fake_cache import write_exr, write_pc2
from matterfit import compat, native
from support import needs_library


def tap(tree):
    """Points are no mesh: what leaves the tree is read as vertices."""
    output = next(node for node in tree.nodes if node.type == "GROUP_OUTPUT")
    size = tree.nodes.new("GeometryNodeStoreNamedAttribute")  # their radius does not go along
    compat.socket(size.inputs, "Name").default_value = "size"
    tree.links.new(output.inputs[0].links[0].from_socket, size.inputs[0])
    tree.links.new(tree.nodes.new("GeometryNodeInputRadius").outputs[0],
                   compat.socket(size.inputs, "Value", "VALUE"))
    back = tree.nodes.new("GeometryNodePointsToVertices")
    tree.links.new(size.outputs[0], back.inputs[0])
    tree.links.new(back.outputs[0], output.inputs[0])


def cloud(item, depsgraph):
    """(places (N, 3), velocities (N, 3), radii (N,)) of a tapped cloud."""
    evaluated = item.evaluated_get(depsgraph)
    mesh = evaluated.to_mesh()
    places = numpy.empty(3 * len(mesh.vertices), dtype=numpy.float32)
    mesh.vertices.foreach_get("co", places)
    velocity = numpy.empty_like(places)
    mesh.attributes["velocity"].data.foreach_get("vector", velocity)
    radius = numpy.empty(len(mesh.vertices), dtype=numpy.float32)
    mesh.attributes["size"].data.foreach_get("value", radius)
    evaluated.to_mesh_clear()
    return places.reshape(-1, 3), velocity.reshape(-1, 3), radius


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
        tap(item.modifiers["Matterfit Particles"].node_group)
        return item

    def in_viewport(self, item, frame):
        self.scene.frame_set(frame)
        return cloud(item, bpy.context.evaluated_depsgraph_get())

    def test_about_their_particles(self):
        """Each has its particle's velocity and keeps its place beside it; together they are as large as
        the particles, whatever their number."""
        item = self.shown()
        separation = self.settings.solver.particle_separation
        volumes = []
        for count in (16, 400):
            self.settings.output.grains = count
            places, velocity, radius = self.in_viewport(item, FRAMES[0])
            self.assertEqual(len(places), 4 * count // 4)
            own = numpy.rint(velocity[:, 0]).astype(int)
            self.assertEqual(numpy.bincount(own).tolist(), [count // 4] * 4)
            away = places - self.particles[own]
            self.assertLess(numpy.abs(away).max(), 2.0 * separation)
            volumes.append((radius ** 3).sum())
            later, moving, _radius = self.in_viewport(item, FRAMES[2])
            numpy.testing.assert_allclose(later - places, [(0.0, 2.0, 0.0)] * len(places), atol=1e-5)
            numpy.testing.assert_allclose(moving, velocity, atol=1e-5)
        self.assertEqual(len(numpy.unique(places, axis=0)), 400)
        numpy.testing.assert_allclose(away.mean(axis=0), 0.0, atol=0.15 * separation)
        self.assertGreater(away.std(), 0.4 * separation)
        self.assertAlmostEqual(volumes[1] / volumes[0], 1.0, delta=0.35)
        filled = 4.0 / 3.0 * numpy.pi * volumes[1] / (4.0 * separation ** 3)
        self.assertAlmostEqual(filled, 0.6, delta=0.1)

    def test_a_render_has_all_of_them(self):
        item = self.shown()
        counts = []

        def look(scene, depsgraph):
            if depsgraph.mode == "RENDER":
                counts.append(len(cloud(scene.objects[item.name], depsgraph)[0]))

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
        self.body_row.material.preset = "WATER"
        item = self.attach(points=True, attributes=["velocity"])["points:Cube"]
        tap(item.modifiers["Matterfit Particles"].node_group)
        item.hide_viewport = False
        self.assertEqual(len(self.in_viewport(item, FRAMES[0])[0]), 4)

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
        tap(item.modifiers["Matterfit Particles"].node_group)
        self.assertEqual(len(self.in_viewport(item, FRAMES[1])[0]), 4 * particles)
