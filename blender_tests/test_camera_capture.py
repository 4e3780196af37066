# SPDX-License-Identifier: GPL-3.0-or-later
"""Cameras of the scene, with sequences of images behind their views, as a capture."""

import json
import math
import os

import bpy
import numpy
from matterfit.io import blender_cameras
from support import needs_library, select
from test_images import ImagesCase, write_image


class CameraCaptureTest(ImagesCase):
    def filmed(self, name, location, first=1, count=3):
        """A camera with a sequence of that many images from that scene frame on."""
        camera = self.camera(location=location)
        camera.name = name
        for k in range(count):
            write_image(os.path.join(self.folder, f"{name}_{k + 7:03d}.png"), 8 + k, 20 + k)
        image = bpy.data.images.load(os.path.join(self.folder, f"{name}_007.png"))
        image.source = "SEQUENCE"
        shown = blender_cameras.set_background(camera, image)
        user = shown.image_user
        user.frame_start, user.frame_offset, user.frame_duration = first, 6, count
        return camera

    def capture(self, **options):
        bpy.context.view_layer.update()
        self.assertEqual(bpy.ops.matterfit.capture_cameras(**options), {"FINISHED"}, self.error())
        return self.settings.captures[-1]

    @needs_library
    def test_two_cameras(self):
        self.scene.unit_settings.scale_length = 0.5
        left = self.filmed("left", (0.0, -2.0, 0.5), first=2)
        right = self.filmed("right", (0.5, -2.0, 0.5), first=3)
        select(self.cube())
        capture = self.capture(name="Take One")
        self.assertEqual((capture.name, capture.source), ("Take One", "IMAGES"))
        self.assertIn("2 cameras, 6 images of 4 times", capture.summary)
        self.assertEqual((capture.use_start_frame, capture.start_frame), (True, 2))
        self.assertEqual(blender_cameras.of_capture(self.scene, "Take One"), {0: left, 1: right})
        with open(bpy.path.abspath(capture.filepath), encoding="utf-8") as file:
            shots = json.load(file)["frames"]
        self.assertEqual(shots[0]["file_path"], "../left_007.png")
        self.assertEqual(shots[3]["time"], 1.0 / 24.0)
        given = blender_cameras.shot(self.scene, left, "", None, 0.5)
        numpy.testing.assert_allclose(shots[0]["transform_matrix"], given["transform_matrix"], atol=1e-6)
        self.assertAlmostEqual(shots[0]["transform_matrix"][1][3], -1.0, places=6)
        self.assertAlmostEqual(shots[0]["fl_x"], given["fl_x"], places=3)

    @needs_library
    def test_the_selected_ones(self):
        self.filmed("left", (0.0, -2.0, 0.5))
        right = self.filmed("right", (0.5, -2.0, 0.5))
        select(right)
        self.assertIn("1 cameras, 3 images", self.capture().summary)

    def test_one_that_moves_is_refused(self):
        camera = self.filmed("left", (0.0, -2.0, 0.5))
        camera.keyframe_insert("location", frame=1)
        bpy.context.view_layer.update()
        camera.location.x = 0.5
        camera.keyframe_insert("location", frame=4)
        self.fails(bpy.ops.matterfit.capture_cameras, ["Camera 'left' moves: at frame 2", "stands still"])
        self.assertEqual(len(self.settings.captures), 0)
        camera.animation_data_clear()
        camera.data.keyframe_insert("lens", frame=1)
        camera.data.lens = 60.0
        camera.data.keyframe_insert("lens", frame=6)
        self.fails(bpy.ops.matterfit.capture_cameras, ["Camera 'left' moves"])

    @needs_library
    def test_keys_that_hold_still_are_no_motion(self):
        camera = self.filmed("left", (0.0, -2.0, 0.5))
        camera.keyframe_insert("location", frame=1)
        self.assertIn("3 images", self.capture().summary)

    def test_what_is_shown_otherwise_is_refused(self):
        self.assertFalse(bpy.ops.matterfit.capture_cameras.poll())
        camera = self.filmed("left", (0.0, -2.0, 0.5))
        shown = camera.data.background_images[0]
        for name, value, words in (("scale", 1.5, "is shifted, scaled"),
                                   ("rotation", math.pi, "is shifted, scaled")):
            before = getattr(shown, name)
            setattr(shown, name, value)
            self.fails(bpy.ops.matterfit.capture_cameras, [words])
            setattr(shown, name, before)
        self.scene.render.resolution_x *= 2
        self.fails(bpy.ops.matterfit.capture_cameras, ["its images are 32 × 24, the scene renders 64 × 24"])
        self.scene.render.resolution_x //= 2
        shown.image_user.frame_offset = 50
        self.fails(bpy.ops.matterfit.capture_cameras, ["none of the images"])
        shown.image.source = "FILE"
        self.fails(bpy.ops.matterfit.capture_cameras, ["is no image sequence"])
