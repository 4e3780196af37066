# SPDX-License-Identifier: GPL-3.0-or-later
"""What is seen of a take: one picture of each body; volumes, surfaces and what they carry."""

import os
import unittest

import bpy
import numpy
from attach_case import FRAMES, AttachCase, evaluated_points
from fake_cache import openvdb_module, write_exr, write_pc2, write_vdb
from matterfit.io import attach
from support import second_process


@unittest.skipUnless(openvdb_module(), "this Blender has no pyopenvdb")
class PictureTest(AttachCase):
    """Each body has one picture, in the viewport and in renders."""

    def write_files(self, document):
        local = numpy.array([vertex.co for vertex in self.item.data.vertices])
        # The document calls a mesh, the library calls the other files by the body's own name.
        name = self.body_row.name
        meshes = [entry["name"] for entry in document["output"].get("mesh", [])]
        for path in (f"points/{name}.pc2", *(f"mesh/{mesh}.pc2" for mesh in meshes)):
            write_pc2(os.path.join(self.folder_of_cache, path), [local] * len(FRAMES))
        for frame in FRAMES:
            write_vdb(os.path.join(self.folder_of_cache, "volume", f"{name}_{frame:04d}.vdb"), 0.2)

    def seen(self, items, where="hide_render"):
        return {tag.split(":")[0] for tag, item in items.items() if not getattr(item, where)}

    def update(self, **arguments):
        document, folder = self.document()
        document["output"].update(volume=["density", "surface"])
        attach.Attachment(self.scene, self.take, folder, document).update(**arguments)

    def test_of_a_solid(self):
        items = self.attach(volume=["density", "surface"])
        self.assertEqual(set(items), {"level:Cube", "mesh:Cube", "points:Cube", "surface:Cube",
                                      "volume:Cube"})
        self.assertEqual(self.seen(items), {"mesh"})
        self.assertEqual(self.seen(items, "hide_viewport") - {"level", "volume"}, {"mesh"})
        self.assertTrue(self.item.hide_render and self.item.hide_viewport)

    def test_of_any_name(self):
        """Files of one body are called by two names where its own has a space or a dot."""
        for name in ("Cube.001", "Sand Pile", "a  b"):
            for preset, wanted in (("JELLY", "mesh"), ("WATER", "surface"), ("SAND", "points")):
                with self.subTest(name, preset=preset):
                    self.setUp()
                    self.body_row.name = name
                    self.body_row.material.preset = preset
                    items = self.attach(volume=["density", "surface"])
                    self.assertEqual(self.seen(items), {wanted})
                    self.assertEqual(self.seen(items, "hide_viewport") - {"level", "volume"}, {wanted})

    def test_of_what_pours(self):
        """Fluids are their surface, sand its grains; the mesh is neither asked for nor seen."""
        for preset, wanted in (("WATER", "surface"), ("SAND", "points"), ("HONEY", "surface")):
            with self.subTest(preset):
                self.body_row.material.preset = preset
                document, _folder = self.document()
                self.assertNotIn("mesh", document["output"])
                items = self.attach(volume=["density", "surface"])
                self.assertEqual(self.seen(items), {wanted})
                self.assertEqual(self.seen(items, "hide_viewport") - {"level", "volume"}, {wanted})
                self.assertTrue(self.item.hide_render)

    def test_the_level_set_does_not_glow(self):
        """Its volume has to stay in the viewport, and shows nothing there."""
        volume = self.attach(volume=["surface"])["volume:Cube"]
        self.assertFalse(volume.hide_viewport)
        self.assertLess(volume.data.display.density, 1e-4)  # Blender's least
        self.assertEqual(volume.data.display.wireframe_type, "NONE")

    def test_fog_does_not_lie_over_the_surface(self):
        """With the grid that it would be made of: Material Preview shows what the viewport has, so the
        volume has a material that shows nothing, until the artist renders it."""
        self.body_row.material.preset = "WATER"
        items = self.attach(volume=["density", "surface"])
        self.assertEqual(self.seen(items), {"surface"})
        volume = items["volume:Cube"]
        self.assertEqual(len(volume.material_slots[0].material.node_tree.nodes), 0)
        volume.hide_render = False
        self.update(final=True)
        self.assertIs(volume.material_slots[0].material, volume.data.materials[0])

    def test_fog_where_there_is_nothing_better(self):
        document, folder = self.document()
        self.folder_of_cache = folder
        self.write_files(document)
        document["output"].update(mesh=[], volume=["density"])
        attach.Attachment(self.scene, self.take, folder, document).update()
        items = {item["matterfit"]: item for item in self.take.collection.objects}
        self.assertEqual(self.seen(items), {"volume"})
        self.assertEqual(items["volume:Cube"].data.display.density, 1.0)
        self.assertIs(items["volume:Cube"].material_slots[0].material,
                      items["volume:Cube"].data.materials[0])

    def test_while_it_bakes(self):
        """Particles are of the newest frame; nothing of another frame stands beside them."""
        items = self.attach(volume=["density", "surface"])
        self.update(live=True)
        self.assertEqual(self.seen(items), {"points"})
        self.update(final=True)
        self.assertEqual(self.seen(items), {"mesh"})

    def test_what_the_artist_has_chosen_stays(self):
        items = self.attach(volume=["density", "surface"])
        items["surface:Cube"].hide_render = False
        self.update(final=True)
        self.assertEqual(self.seen(items), {"mesh", "surface"})

    def test_another_picture_after_another_bake(self):
        """Without render meshes the surface takes their place."""
        items = self.attach(volume=["density", "surface"])
        document, folder = self.document()
        document["output"].update(mesh=[], volume=["surface"])
        attach.Attachment(self.scene, self.take, folder, document).update()
        self.assertEqual(self.seen(items), {"surface"})


@unittest.skipUnless(openvdb_module(), "OpenVDB's module is not installed for Blender's Python")
class VolumeTest(AttachCase):
    """A sphere that grows."""

    def write_files(self, document):
        for k, frame in enumerate(FRAMES):
            write_vdb(os.path.join(self.folder_of_cache, "volume", f"Cube_{frame:04d}.vdb"),
                      0.2 + 0.05 * k)

    def test_sequence_and_surface(self):
        """Files carry the scene's frames; the level set becomes a mesh of the right size."""
        items = self.attach(volume=["density", "surface"])
        volume = items["volume:Cube"].data
        self.assertEqual((volume.frame_start, volume.frame_offset, volume.frame_duration),
                         (3, 2, 5))
        self.assertEqual(volume.velocity_unit, "SECOND")
        surface = items["surface:Cube"]
        surface.hide_viewport = False
        for k, frame in enumerate(FRAMES):
            points = evaluated_points(surface, frame)
            radius = numpy.linalg.norm(points - (0, 0, 1), axis=1).mean()
            self.assertAlmostEqual(radius, 0.2 + 0.05 * k, delta=0.004)

    def test_the_surface_is_where_the_level_set_is(self):
        """The middle of a sphere within a tenth of a voxel, at any scale of the scene."""
        for scale_length in (1.0, 0.01):
            self.scene.unit_settings.scale_length = scale_length
            items = self.attach(volume=["density", "surface"])
            surface = items["surface:Cube"]
            surface.hide_viewport = False
            for frame in (FRAMES[0], FRAMES[-1]):
                middle = evaluated_points(surface, frame) * scale_length
                middle = 0.5 * (middle.min(axis=0) + middle.max(axis=0))
                numpy.testing.assert_allclose(middle, (0, 0, 1), atol=0.1 * 0.02)

    def test_fog_is_where_the_surface_is(self):
        """Its voxels are twice as wide, and Blender shifts each grid by half a voxel of its own."""
        for scale_length in (1.0, 0.01):
            self.scene.unit_settings.scale_length = scale_length
            items = self.attach(volume=["density", "surface"])
            shape = bpy.data.objects.new("Fog", bpy.data.meshes.new("Fog"))
            self.scene.collection.objects.link(shape)
            modifier = shape.modifiers.new("Fog", "VOLUME_TO_MESH")
            modifier.object, modifier.grid_name = items["volume:Cube"], "density"
            modifier.resolution_mode, modifier.threshold = "GRID", 0.5
            for frame in (FRAMES[0], FRAMES[-1]):
                places = evaluated_points(shape, frame) * scale_length
                middle = 0.5 * (places.min(axis=0) + places.max(axis=0))
                numpy.testing.assert_allclose(middle, (0, 0, 1), atol=0.1 * 0.02)
            bpy.data.objects.remove(shape)

    def test_renders_without_us(self):
        """`-a` of the saved file in a bare Blender: pictures that differ from frame to frame."""
        self.attach(volume=["surface"])
        camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
        camera.location, camera.rotation_euler = (0.0, -3.0, 1.0), (1.5708, 0.0, 0.0)
        light = bpy.data.objects.new("Sun", bpy.data.lights.new("Sun", "SUN"))
        for item in (camera, light):
            self.scene.collection.objects.link(item)
        self.scene.camera = camera
        self.scene.render.engine = "CYCLES"
        self.scene.cycles.samples = 2
        self.scene.cycles.use_denoising = False
        self.scene.render.resolution_x = self.scene.render.resolution_y = 32
        self.scene.render.image_settings.file_format = "OPEN_EXR"
        self.scene.render.filepath = os.path.join(self.folder, "shot_")
        self.scene.frame_step = 4
        self.save("scene.blend")
        found = second_process(f"""
bpy.ops.render.render(animation=True)
sums = {{}}
for frame in (3, 7):
    image = bpy.data.images.load({self.folder!r} + "/shot_%04d.exr" % frame)
    pixels = list(image.pixels)
    sums[frame] = sum(1 for value in pixels[0::4] if value > 0.02)
print(json.dumps(sums))
""", blend=os.path.join(self.folder, "scene.blend"))
        small, large = found["3"], found["7"]
        self.assertGreater(small, 5)
        self.assertGreater(large, 2 * small)


@unittest.skipUnless(openvdb_module(), "this Blender has no pyopenvdb")
class SurfaceTest(AttachCase):
    """What the surface of a body carries beside its shape."""

    def write_files(self, document):
        cloud = numpy.array([(x, y, 1.0) for x in (-0.2, 0.2) for y in (-0.2, 0.2)])
        write_pc2(os.path.join(self.folder_of_cache, "points", "Cube.pc2"), [cloud] * len(FRAMES))
        for k, frame in enumerate(FRAMES):
            write_vdb(os.path.join(self.folder_of_cache, "volume", f"Cube_{frame:04d}.vdb"), 0.2)
            write_exr(os.path.join(self.folder_of_cache, "attributes",
                                   f"Cube_velocity_{frame:04d}.exr"),
                      numpy.array([(1.0, 2.0, float(k))] * 2 + [(-1.0, 2.0, float(k))] * 2), 2)

    def surface(self, **output):
        self.settings.solver.particle_separation = 0.02  # typed: water asks for a finer one
        self.body_row.material.preset = "WATER"
        return self.attach(volume=["surface"], attributes=["velocity"], **output)["surface:Cube"]

    def radius(self, item):
        points = evaluated_points(item, FRAMES[0])
        return numpy.linalg.norm(points - (0, 0, 1), axis=1).mean()

    def test_velocity_for_motion_blur(self):
        """Each vertex moves as the particles about it do, in metres a second."""
        item = self.surface()
        for k, frame in enumerate(FRAMES):
            self.scene.frame_set(frame)
            evaluated = item.evaluated_get(bpy.context.evaluated_depsgraph_get())
            mesh = evaluated.to_mesh()
            values = numpy.empty(3 * len(mesh.vertices), dtype=numpy.float32)
            mesh.attributes["velocity"].data.foreach_get("vector", values)
            places = numpy.array([vertex.co for vertex in mesh.vertices])
            edges = numpy.empty(2 * len(mesh.edges), dtype=numpy.int32)
            mesh.edges.foreach_get("vertices", edges)
            edges = edges.reshape(-1, 2)
            evaluated.to_mesh_clear()
            values = values.reshape(-1, 3)
            self.assertGreater(len(values), 100)
            left, right = places[:, 0] < -0.1, places[:, 0] > 0.1
            numpy.testing.assert_allclose(values[left].mean(axis=0), (1.0, 2.0, k), atol=1e-3)
            numpy.testing.assert_allclose(values[right].mean(axis=0), (-1.0, 2.0, k), atol=1e-3)
            # Where the nearest particle is another one it goes over gradually: a jump would tear the mesh.
            steps = numpy.abs(values[edges[:, 0], 0] - values[edges[:, 1], 0])
            self.assertGreater(steps.max(), 0.05)
            self.assertLess(steps.max(), 0.8)

    def test_velocity_in_a_scene_of_centimetres(self):
        """The attribute is in Blender units a second: a hundred times as much."""
        self.scene.unit_settings.scale_length = 0.01
        item = self.surface()
        self.scene.frame_set(FRAMES[0])
        mesh = item.evaluated_get(bpy.context.evaluated_depsgraph_get()).to_mesh()
        self.assertAlmostEqual(mesh.attributes["velocity"].data[0].vector.y, 200.0, places=2)

    def test_blurred_in_a_render(self):
        """At 12 m/s and 24 frames a second half a frame's shutter draws out .25 m."""
        item = self.surface()
        for k in range(len(FRAMES)):
            write_exr(os.path.join(self.folder_of_cache, "attributes",
                                   f"Cube_velocity_{FRAMES[k]:04d}.exr"),
                      numpy.array([(12.0, 0.0, 0.0)] * 4), 2)
        for image in bpy.data.images:
            image.reload()
        self.scene.frame_set(FRAMES[2])
        camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
        camera.location, camera.rotation_euler = (0.0, -3.0, 1.0), (1.5708, 0.0, 0.0)
        camera.data.type, camera.data.ortho_scale = "ORTHO", 1.0
        self.scene.collection.objects.link(camera)
        self.scene.camera = camera
        glow = bpy.data.materials.new("Glow")
        glow.use_nodes = True
        nodes = glow.node_tree.nodes
        nodes.clear()
        glow.node_tree.links.new(nodes.new("ShaderNodeEmission").outputs[0],
                                 nodes.new("ShaderNodeOutputMaterial").inputs[0])
        item.active_material = glow
        render = self.scene.render
        render.engine, render.resolution_x, render.resolution_y = "CYCLES", 64, 64
        self.scene.cycles.samples, self.scene.cycles.use_denoising = 32, False
        render.image_settings.file_format = "OPEN_EXR"
        render.motion_blur_shutter = 0.5
        widths = {}
        for blur in (False, True):
            render.use_motion_blur = blur
            render.filepath = os.path.join(self.folder, f"blur_{blur}.exr")
            bpy.ops.render.render(write_still=True)
            image = bpy.data.images.load(render.filepath)
            pixels = numpy.array(image.pixels[:]).reshape(64, 64, 4)[..., 0]
            widths[blur] = int((pixels[28:36].max(axis=0) > 0.1).sum()) / 64.0
        self.assertAlmostEqual(widths[False], 0.4, delta=0.05)
        self.assertAlmostEqual(widths[True] - widths[False], 0.25, delta=0.07)

    def test_offset_and_smoothing(self):
        """They change what is shown at once; the offset counts in particle separations."""
        self.settings.output.surface_smoothing = 0
        item = self.surface()
        self.assertAlmostEqual(self.radius(item), 0.2, delta=0.003)
        separation = self.settings.solver.particle_separation
        self.settings.output.surface_offset = 0.02 / separation
        self.assertAlmostEqual(self.radius(item), 0.22, delta=0.003)
        self.settings.output.surface_smoothing = 40
        self.assertLess(self.radius(item), 0.218)
