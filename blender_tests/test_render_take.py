# SPDX-License-Identifier: GPL-3.0-or-later
"""Render Take: the simulation's pictures behind the camera's view."""

import os

import bpy
import numpy
from matterfit.io import blender_cameras, files
from support import needs_library, run_cli
from test_images import HEIGHT, WIDTH, ImagesCase


class RenderTakeTest(ImagesCase):
    def setUp(self):
        super().setUp()
        self.jelly()
        self.scene.frame_start, self.scene.frame_end = 1, 4
        self.scene.camera = self.camera()

    @needs_library
    def test_pictures_behind_the_camera(self):
        self.assertEqual(bpy.ops.matterfit.render_take(), {"FINISHED"})
        photographs, drawn = blender_cameras.backgrounds(self.scene.camera)
        self.assertEqual((photographs, len(drawn)), ([], 1))
        user, image = drawn[0].image_user, drawn[0].image
        self.assertEqual((image.source, user.frame_start, user.frame_duration), ("SEQUENCE", 1, 4))
        path = files.absolute(image.filepath)
        self.assertEqual(os.path.basename(path), "0001.png")
        self.assertEqual(len(os.listdir(os.path.dirname(path))), 4)
        seen = [self.height(os.path.join(os.path.dirname(path), f"{frame:04d}.png")) for frame in (1, 4)]
        self.assertLess(seen[1], seen[0], "it falls")
        # Again after a bake, and in place of the first.
        bpy.ops.matterfit.bake(onto="REPLACE")
        self.assertEqual(bpy.ops.matterfit.render_take(), {"FINISHED"})
        self.assertEqual(len(blender_cameras.backgrounds(self.scene.camera)[1]), 1)

    def height(self, path):
        """Of what is seen, in rows from below."""
        image = bpy.data.images.load(path)
        self.assertEqual(tuple(image.size), (WIDTH, HEIGHT))
        alpha = numpy.array(image.pixels[:]).reshape(HEIGHT, WIDTH, 4)[:, :, 3]
        rows = numpy.arange(HEIGHT) @ alpha.sum(axis=1)
        self.assertGreater(alpha.sum(), 10.0)
        return rows / alpha.sum()

    @needs_library
    def test_without_a_window(self):
        """What is saved shows the artist's object still, and the pictures behind the camera."""
        if not bpy.app.binary_path:
            self.skipTest("a bpy wheel opens no .blend from the command line")
        bpy.ops.wm.save_mainfile()
        path = bpy.data.filepath
        done = run_cli("render", "--save", "--quiet", blend=path)
        self.assertEqual(done.returncode, 0, done.stderr)
        bpy.ops.wm.open_mainfile(filepath=path)
        scene = bpy.context.scene
        self.assertFalse(scene.objects["Cube"].hide_render)
        self.assertFalse(scene.matterfit.takes[0].baked)
        self.assertEqual(len(blender_cameras.backgrounds(scene.camera)[1]), 1)

    @needs_library
    def test_a_camera_that_moves_is_refused(self):
        self.scene.camera.keyframe_insert("location", frame=1)
        self.scene.camera.location.x += 1.0
        self.scene.camera.keyframe_insert("location", frame=4)
        self.fails(bpy.ops.matterfit.render_take, ["moves: at frame"])

    @needs_library
    def test_as_a_capture_has_its_camera(self):
        bpy.ops.matterfit.import_images(filepath=self.clip())
        self.scene.camera = blender_cameras.of_capture(self.scene, "clip")[0]
        document, _folder = self.document(task="render")
        self.assertEqual(document["render"], {"capture": "clip", "camera": 0})
        self.settings.captures[0].enabled = False
        document, folder = self.document(task="render")
        self.assertIn("cameras", document["render"])
        self.settings.captures[0].enabled = True
        self.scene.camera.location.z += 0.1  # it is another camera now
        bpy.context.view_layer.update()
        document, folder = self.document(task="render")
        self.assertTrue(os.path.isfile(os.path.join(folder, document["render"]["cameras"])))
