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


class DrawnTest(ImagesCase):
    """A film of one's own take."""

    def setUp(self):
        super().setUp()
        self.jelly()
        self.scene.frame_start, self.scene.frame_end = 2, 5
        self.cameras = []
        for name, location, turn in (("Front", (0.0, -2.0, 0.5), 0.0), ("Side", (2.0, 0.0, 0.5), math.pi / 2)):
            camera = self.camera(location=location, rotation=(math.pi / 2, 0.0, turn))
            camera.name = name
            bpy.context.view_layer.update()
            self.cameras.append(camera)
            self.assertEqual(bpy.ops.matterfit.render_take(), {"FINISHED"}, self.error())
        select(self.settings.bodies[0].object)

    def capture(self):
        self.assertEqual(bpy.ops.matterfit.capture_cameras(name="film"), {"FINISHED"}, self.error())
        return self.settings.captures[-1]

    @needs_library
    def test_pictures_of_a_take(self):
        self.assertTrue(bpy.ops.matterfit.capture_cameras.poll())
        capture = self.capture()
        self.assertIn("2 cameras, 8 images of 4 times", capture.summary)
        self.assertEqual(blender_cameras.of_capture(self.scene, "film"), dict(enumerate(self.cameras)))
        self.assertEqual((capture.use_start_frame, capture.start_frame), (False, capture.start_frame))
        # The take's own pictures may go: the recording is a copy of them.
        self.assertEqual(bpy.ops.matterfit.free(), {"FINISHED"}, self.error())
        self.assertEqual(bpy.ops.matterfit.check_capture(), {"FINISHED"}, self.error())
        for camera in self.cameras:
            photographs, drawn = blender_cameras.backgrounds(camera)
            self.assertEqual((len(photographs), drawn), (1, []))
            user, image = photographs[0].image_user, photographs[0].image
            self.assertEqual((image.source, user.frame_start, user.frame_duration, user.frame_offset),
                             ("SEQUENCE", 2, 4, 1))
            self.assertTrue(os.path.isfile(bpy.path.abspath(image.filepath)))
        # The next take is drawn as the recording's camera has it, and shown beside it.
        self.settings.bodies[0].velocity = (0.0, 0.0, 1.0)
        self.assertEqual(bpy.ops.matterfit.compare(), {"FINISHED"}, self.error())
        self.assertEqual(bpy.ops.matterfit.render_take(), {"FINISHED"}, self.error())
        photographs, drawn = blender_cameras.backgrounds(self.scene.camera)
        self.assertEqual((len(photographs), len(drawn)), (1, 1))
        self.assertIn("camera_1", drawn[0].image.filepath)

    @needs_library
    def test_photographs_win(self):
        image = bpy.data.images.load(bpy.path.abspath(
            self.cameras[0].data.background_images[0].image.filepath), check_existing=False)
        image.source = "SEQUENCE"
        shown = blender_cameras.set_background(self.cameras[0], image)
        shown.image_user.frame_start, shown.image_user.frame_offset, shown.image_user.frame_duration = 2, 1, 3
        select(self.cube())
        self.assertIn("1 cameras, 3 images", self.capture().summary)
        self.assertEqual(len(blender_cameras.backgrounds(self.cameras[0])[1]), 1)

    @needs_library
    def test_what_is_no_recording_is_refused(self):
        self.cameras[0].location.x += 0.1
        bpy.context.view_layer.update()
        self.fails(bpy.ops.matterfit.capture_cameras, ["Camera 'Front' was moved", "Press Render Take again"])
        self.cameras[0].location.x -= 0.1
        bpy.context.view_layer.update()
        self.settings.takes[0].folder = ""  # the pictures are nobody's
        bpy.ops.matterfit.add_take()
        bpy.ops.matterfit.render_take()
        self.fails(bpy.ops.matterfit.capture_cameras, ["Camera 'Side' shows pictures of another take"])
        self.assertEqual([name for name in os.listdir(self.folder) if name.startswith("cameras_")], [])
        select(self.cameras[1])
        self.assertIn("1 cameras, 4 images", self.capture().summary)
