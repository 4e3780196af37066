# SPDX-License-Identifier: GPL-3.0-or-later
"""Bodies made from files of Gaussian splats: what points up in them, their unit, what is kept of them."""

import glob
import math
import os
import struct

import bpy
import numpy
from matterfit.io import takes
from support import SceneCase, needs_library, read

BALL = 600  # splats on the ball; one more floats elsewhere


class SplatBodyTest(SceneCase):
    """A ball of ten centimetres half a metre above the ground, in a file of decimetres whose y points down."""

    def setUp(self):
        super().setUp()
        self.row = self.settings.bodies.add()
        self.row.name = "Ball"
        self.row.source = "GAUSSIANS"
        self.row.filepath = self.splats()
        self.row.file_up = "-Y"
        self.row.file_scale = 0.1
        self.settings.solver.particle_separation = 0.02
        bpy.ops.object.empty_add(type="CUBE", radius=0.15, location=(0.0, 0.0, 0.5))
        self.box = bpy.context.active_object
        self.row.crop = self.box
        bpy.context.view_layer.update()

    def splats(self):
        path = os.path.join(self.folder, "ball.splat")
        random = numpy.random.default_rng(3)
        places = random.normal(size=(BALL, 3))
        places /= numpy.linalg.norm(places, axis=1, keepdims=True)
        places += (0.0, -5.0, 0.0)
        with open(path, "wb") as file:
            for place in [*places, (30.0, -5.0, 0.0)]:
                file.write(struct.pack("<6f8B", *place, 0.1, 0.1, 0.1, 255, 0, 0, 255, 255, 128, 128, 128))
        return path

    def test_its_place_and_what_is_kept(self):
        self.settings.output.splats = True
        document, _folder = self.document()
        body = document["scene"]["bodies"][0]
        numpy.testing.assert_allclose(body["source"]["crop"]["low"], (-1.5, -6.5, -1.5), atol=1e-5)
        numpy.testing.assert_allclose(body["source"]["crop"]["high"], (1.5, -3.5, 1.5), atol=1e-5)
        self.assertEqual(body["placement"]["scale"], 0.1)
        numpy.testing.assert_allclose(body["placement"]["rotation"],
                                      (math.sqrt(0.5), -math.sqrt(0.5), 0.0, 0.0), atol=1e-6)
        entry = document["output"]["splats"][0]
        self.assertEqual((entry["body"], entry["crop"]), ("Ball", body["source"]["crop"]))
        self.assertEqual(entry["opacity_threshold"], 0.1)
        self.assertNotIn("format", entry)
        self.settings.output.splat_format, self.row.opacity_threshold = "SPLAT", 0.0
        entry = self.document()[0]["output"]["splats"][0]
        self.assertEqual(entry["format"], "splat")
        self.assertNotIn("opacity_threshold", entry)

    def test_as_it_is_without_any(self):
        self.row.file_up, self.row.file_scale, self.row.crop = "Z", 1.0, None
        document, _folder = self.document()
        body = document["scene"]["bodies"][0]
        self.assertNotIn("placement", body)
        self.assertNotIn("crop", body["source"])

    def test_a_throw_turns_it_as_it_stands_there(self):
        """The crop stays where the file is."""
        untouched = self.document()[0]["scene"]["bodies"][0]
        throw = takes.ensure_active(self.settings).throws.add()
        throw.name = "Ball"
        throw.use_placement = True
        throw.location, throw.rotation = (1.0, 2.0, 3.0), (0.0, 0.0, math.pi / 2)
        body = self.document()[0]["scene"]["bodies"][0]
        self.assertEqual(body["source"], untouched["source"])
        self.assertEqual(body["placement"]["position"], [1, 2, 3])
        numpy.testing.assert_allclose(body["placement"]["rotation"], (0.5, -0.5, -0.5, 0.5), atol=1e-6)

    def test_a_flat_crop(self):
        """Also where the turn to the file's axes gives it a thickness by rounding."""
        self.box.scale.z = 0.0
        for height, size in ((0.5, 1.0), (0.0, 1e4)):
            self.box.location.z, self.box.scale.x, self.box.scale.y = height, size, size
            bpy.context.view_layer.update()
            self.fails(bpy.ops.matterfit.bake, ["'Empty' is flat"])

    @needs_library
    def test_baked(self):
        """What floats elsewhere is neither simulated nor drawn."""
        self.settings.output.splats = True
        bpy.ops.matterfit.bake()
        folder = takes.locate(takes.ensure_active(self.settings)).folder
        first = sorted(glob.glob(os.path.join(folder, "splat", "*.ply")))[0]
        head, _, values = read(first).partition(b"end_header\n")
        self.assertIn(f"element vertex {BALL}".encode(), head)
        columns = head.count(b"property float")
        places = numpy.frombuffer(values, dtype="<f4").reshape(BALL, columns)[:, :3]
        numpy.testing.assert_allclose(places.mean(axis=0), (0.0, 0.0, 0.5), atol=0.01)
        self.assertAlmostEqual(places[:, 0].max(), 0.1, delta=0.005)

    @needs_library
    def test_baked_as_dot_splat(self):
        self.settings.output.splat_format = "SPLAT"
        bpy.ops.matterfit.bake()
        folder = takes.locate(takes.ensure_active(self.settings)).folder
        written = sorted(os.listdir(os.path.join(folder, "splat")))
        self.assertEqual(written[0], "Ball_0001.splat")
        self.assertEqual(len(read(folder, "splat", written[0])), 32 * BALL)

    @needs_library
    def test_nothing_in_the_crop(self):
        self.box.location = (5.0, 0.0, 0.0)
        bpy.context.view_layer.update()
        self.fails(bpy.ops.matterfit.bake, ["no splat lies in the crop box"])
