# SPDX-License-Identifier: GPL-3.0-or-later
"""Gaussian splats as ellipsoids in the viewport; drawn, cropped, and in turn with photographs."""

import gzip
import math
import os
import struct
from unittest import mock

import bpy
import numpy
from mathutils import Euler, Quaternion
from matterfit.io import blender_cameras, splat_nodes, splat_preview
from matterfit.props import reactions
from support import needs_library
from test_images import HEIGHT, WIDTH, ImagesCase, write_photo


def shown_points(item):
    """(N, 3) vertices in the world of what the object shows."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    seen = item.evaluated_get(depsgraph)
    mesh = seen.to_mesh()
    points = numpy.empty(3 * len(mesh.vertices), dtype=numpy.float32)
    mesh.vertices.foreach_get("co", points)
    colours = mesh.attributes.get(splat_nodes.COLOUR)
    told = None
    if colours is not None:
        told = numpy.empty(4 * len(colours.data), dtype=numpy.float32)
        colours.data.foreach_get("color", told)
        told = told.reshape(-1, 4)
    matrix = numpy.array(seen.matrix_world)
    points = points.reshape(-1, 3) @ matrix[:3, :3].T + matrix[:3, 3]
    seen.to_mesh_clear()
    return points, told


class SplatsCase(ImagesCase):
    def write(self, rows):
        """A .splat of (place, sizes, (r, g, b, opacity) of 255, turn)."""
        path = os.path.join(self.folder, "cloud.splat")
        with open(path, "wb") as file:
            for place, sizes, colour, turn in rows:
                turn = [max(0, min(255, int(round(128 + 128 * part)))) for part in turn]
                file.write(struct.pack("<6f8B", *place, *sizes, *colour, *turn))
        return path


class PreviewTest(SplatsCase):
    def setUp(self):
        super().setUp()
        half = math.sqrt(0.5)
        path = self.write((
            ((0.0, -5.0, 0.0), (4.0, 0.5, 0.5), (255, 0, 0, 255), (half, 0.0, 0.0, half)),
            ((10.0, -5.0, 0.0), (0.5, 0.5, 0.5), (0, 255, 0, 255), (1.0, 0.0, 0.0, 0.0)),
            ((20.0, -5.0, 0.0), (0.5, 0.5, 0.5), (0, 0, 255, 3), (1.0, 0.0, 0.0, 0.0))))
        self.row = self.settings.bodies.add()
        self.row.name, self.row.source, self.row.filepath = "Scan", "GAUSSIANS", path
        self.row.file_up, self.row.file_scale = "-Y", 0.1
        self.settings.body_index = 0

    def shown(self):
        item = splat_preview.shown(self.row)
        bpy.context.view_layer.update()
        return shown_points(item)

    @needs_library
    def test_where_the_file_lies(self):
        """Half a metre above the ground, decimetres, y down: the long one stands on end."""
        bpy.ops.matterfit.show_splats()
        item = splat_preview.shown(self.row)
        self.assertTrue(item.hide_render)
        self.assertEqual(list(item[splat_preview.TOLD]), [3, 3])
        points, colours = self.shown()
        long = points[colours[:, 0] > 0.5]
        numpy.testing.assert_allclose((long.min(axis=0) + long.max(axis=0)) / 2, (0.0, 0.0, 0.5), atol=2e-3)
        # Along the file's y after its turn about z, which is the scene's z.
        numpy.testing.assert_allclose(numpy.ptp(long, axis=0), (0.1, 0.1, 0.8), rtol=0.2)
        self.assertEqual((colours[:, 1] > 0.5).sum(), len(long), "one ball each")
        self.assertFalse((colours[:, 2] > 0.5).any(), "it has less than two per cent of opacity")

    def test_up_as_the_format_says(self):
        """y points up in .spz files, in others nobody knows; what was chosen stays."""
        row = self.settings.bodies.add()
        row.source = "GAUSSIANS"
        row.filepath = "//a.SPZ"
        self.assertEqual(row.file_up, "Y")
        row.filepath = "//a.ply"
        self.assertEqual(row.file_up, "Z")
        row.filepath = "//a.spz"
        row.file_up = "-Y"
        row.filepath = "//b.spz"
        self.assertEqual(row.file_up, "-Y")
        row.filepath = "//b.ply"
        self.assertEqual(row.file_up, "-Y")
        late = self.settings.bodies.add()
        late.filepath = "//a.spz"
        self.assertEqual(late.file_up, "Z", "it is no file of Gaussians yet")
        late.source = "GAUSSIANS"
        self.assertEqual(late.file_up, "Y")
        # Of files that others saved, where the axis was left at Z and the file is the same one.
        late.property_unset("file_up")
        with reactions.paths_rewritten():
            late.filepath = "/tmp/a.spz"
        self.assertEqual(late.file_up, "Z")

    @needs_library
    def test_it_follows_what_is_typed(self):
        bpy.ops.matterfit.show_splats()
        self.row.opacity_threshold = 0.0
        points, colours = self.shown()
        self.assertTrue((colours[:, 2] > 0.5).any())
        self.row.file_scale = 0.2
        numpy.testing.assert_allclose(self.shown()[0].mean(axis=0)[2], 1.0, atol=0.01)
        self.row.file_up = "Y"
        numpy.testing.assert_allclose(self.shown()[0].mean(axis=0)[2], -1.0, atol=0.01)

    @needs_library
    def test_a_crop_box_that_moves(self):
        for kind in ("CUBE", "MESH"):
            with self.subTest(kind):
                if kind == "MESH":
                    bpy.ops.mesh.primitive_cube_add(size=0.6, location=(0.0, 0.0, 0.5))
                else:
                    bpy.ops.object.empty_add(type="CUBE", radius=0.3, location=(0.0, 0.0, 0.5))
                box = bpy.context.active_object
                if splat_preview.shown(self.row) is None:
                    bpy.ops.matterfit.show_splats()
                self.row.crop = box
                points, _colours = self.shown()
                self.assertLess(points[:, 0].max(), 0.1)
                box.location.x = 1.0
                points, _colours = self.shown()
                self.assertGreater(points[:, 0].min(), 0.9)
                # The empty as a box of twice the size, along the world's axes: both are in it.
                box.location.x, box.scale = 0.5, (1.9, 1.0, 1.0)
                self.assertGreater(numpy.ptp(self.shown()[0][:, 0]), 0.9)
                box.location.x, box.scale = 30.0, (1.0, 1.0, 1.0)
                self.assertEqual(len(self.shown()[0]), 0)
        self.row.crop = None
        self.assertGreater(len(self.shown()[0]), 0)

    @needs_library
    def test_an_empty_that_grows(self):
        bpy.ops.object.empty_add(type="CUBE", radius=0.01, location=(0.0, 0.0, 0.7))
        box = self.row.crop = bpy.context.active_object
        bpy.ops.matterfit.show_splats()
        self.assertEqual(len(self.shown()[0]), 0)
        box.empty_display_size = 0.3
        self.assertGreater(len(self.shown()[0]), 0)

    @needs_library
    def test_pressed_again_and_other_files(self):
        bpy.ops.matterfit.show_splats()
        bpy.ops.matterfit.show_splats()
        self.assertIsNone(self.row.preview)
        self.assertEqual([len(kind) for kind in (self.scene.objects, bpy.data.meshes, bpy.data.node_groups)],
                         [0, 0, 0])
        for change in (lambda: setattr(self.row, "source", "OBJECT"), bpy.ops.matterfit.remove_body):
            bpy.ops.matterfit.show_splats()
            self.assertEqual(len(self.scene.objects), 1)
            change()
            self.assertEqual(len(self.scene.objects), 0)
            if len(self.settings.bodies):
                self.row.source = "GAUSSIANS"

    @needs_library
    def test_at_most_so_many(self):
        with mock.patch.object(splat_preview, "MOST", 2):
            bpy.ops.matterfit.show_splats()
        item = splat_preview.shown(self.row)
        self.assertEqual(list(item[splat_preview.TOLD]), [3, 2])
        self.assertEqual(len(item.data.vertices), 2)

    @needs_library
    def test_what_cannot_be_read_is_said(self):
        with open(os.path.join(self.folder, "broken.splat"), "wb") as file:
            file.write(b"1234567")
        self.row.filepath = os.path.join(self.folder, "broken.splat")
        self.fails(bpy.ops.matterfit.show_splats, ["broken.splat"])
        self.row.filepath = ""
        self.fails(bpy.ops.matterfit.show_splats, ["no file is chosen"])
        self.assertEqual(len(self.scene.objects), 0)

    def test_turns_as_blender_has_them(self):
        random = numpy.random.default_rng(1)
        turns = random.normal(size=(50, 4))
        turns /= numpy.linalg.norm(turns, axis=1, keepdims=True)
        for turn, angles in zip(turns, splat_preview.euler_angles(turns), strict=True):
            ours, theirs = Euler(angles).to_matrix(), Quaternion(turn).to_matrix()
            numpy.testing.assert_allclose(numpy.array(ours), numpy.array(theirs), atol=1e-6)


class DrawnTest(SplatsCase):
    def setUp(self):
        super().setUp()
        # A red ball in front of the camera, a faint blue one beside it.
        self.path = self.write((
            ((0.0, -0.5, 0.0), (0.05,) * 3, (255, 0, 0, 255), (1.0, 0.0, 0.0, 0.0)),
            ((0.5, -0.5, 0.0), (0.05,) * 3, (0, 0, 255, 100), (1.0, 0.0, 0.0, 0.0))))
        self.view = self.camera()
        bpy.context.view_layer.update()

    def drawn(self, **options):
        self.assertEqual(bpy.ops.matterfit.render_splats(filepath=self.path, up="-Y", **options),
                         {"FINISHED"}, self.error())
        image = blender_cameras.backgrounds(self.view)[1][0].image
        return numpy.array(image.pixels[:]).reshape(HEIGHT, WIDTH, 4)

    @needs_library
    def test_up_as_the_format_says(self):
        """y points up in a .spz, unless another axis was chosen; of other files as in most trained scenes."""
        kind = bpy.ops.matterfit.render_splats.get_rna_type().properties["up"]
        self.assertEqual((kind.default, kind.is_skip_save), ("AUTO", True))
        spz = self.spz((0.0, 0.5, 0.0))
        for path, options, seen in ((self.path, {}, True), (spz, {}, True), (spz, {"up": "-Y"}, False)):
            self.assertEqual(bpy.ops.matterfit.render_splats(filepath=path, **options), {"FINISHED"}, self.error())
            image = blender_cameras.backgrounds(self.view)[1][0].image
            pixels = numpy.array(image.pixels[:]).reshape(HEIGHT, WIDTH, 4)
            self.assertEqual(pixels[HEIGHT // 2, WIDTH // 2, 0] > 0.5, seen, (path, options))

    def spz(self, place):
        """A file of that format with one red ball."""
        path = os.path.join(self.folder, "ball.spz")
        parts = b"".join(int(round(4096 * value)).to_bytes(3, "little", signed=True) for value in place)
        with gzip.open(path, "wb") as file:  # opacity, colour, sizes, turn
            file.write(struct.pack("<IIIBBBB", 0x5053474e, 2, 1, 0, 12, 0, 0) + parts
                       + bytes((255, 255, 0, 0, 112, 112, 112, 128, 128, 128)))
        return path

    @needs_library
    def test_opacity_and_crop(self):
        self.assertGreater(self.drawn()[..., 2].max(), 0.2)
        self.assertEqual(self.drawn(opacity_threshold=0.5)[..., 2].max(), 0.0)
        bpy.ops.object.empty_add(type="CUBE", radius=0.2, location=(0.5, 0.0, 0.5))
        bpy.context.active_object.name = "Box"
        bpy.context.view_layer.update()
        pixels = self.drawn(crop="Box")
        self.assertEqual(pixels[..., 0].max(), 0.0)
        self.assertGreater(pixels[..., 2].max(), 0.2)
        self.fails(bpy.ops.matterfit.render_splats, ["no object 'None' to crop by"], filepath=self.path,
                   crop="None")
        self.assertEqual(len(self.view.data.background_images), 1, "each in place of the one before")

    @needs_library
    def test_in_turn_with_the_photograph(self):
        self.assertFalse(bpy.ops.matterfit.flip_photograph.poll())
        photo = os.path.join(self.folder, "photo.png")
        write_photo(photo)
        blender_cameras.set_background(self.view, bpy.data.images.load(photo))
        self.assertFalse(bpy.ops.matterfit.flip_photograph.poll())
        self.drawn()
        seen = []
        for _time in range(3):
            self.assertEqual(bpy.ops.matterfit.flip_photograph(), {"FINISHED"})
            photographs, drawn = blender_cameras.backgrounds(self.view)
            seen.append((photographs[0].show_background_image, drawn[0].show_background_image))
        self.assertEqual(seen, [(True, False), (False, True), (True, False)])
