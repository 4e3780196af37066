# SPDX-License-Identifier: GPL-3.0-or-later
"""Recordings by images in formats that the library does not read: Blender reads them."""

import json
import os

import bpy
import numpy
from matterfit.io import blender_cameras, readable_images
from matterfit.jobs import JobError
from support import needs_library
from test_images import HEIGHT, WIDTH, ImagesCase

KINDS = {".tif": "TIFF", ".bmp": "BMP", ".tga": "TARGA", ".webp": "WEBP", ".png": "PNG"}


def write(path, low, high, alpha=True, rows=(0, HEIGHT)):
    """White, opaque in the columns from `low` to `high` of these rows, in the format of the name."""
    image = bpy.data.images.new("matte", WIDTH, HEIGHT, alpha=alpha)
    pixels = numpy.zeros((HEIGHT, WIDTH, 4), dtype=numpy.float32)
    pixels[rows[0]:rows[1], low:high] = 1.0
    if not alpha:
        pixels[..., 3] = 1.0
    image.pixels.foreach_set(pixels.ravel())
    image.filepath_raw, image.file_format = path, KINDS[os.path.splitext(path)[1]]
    image.save()
    bpy.data.images.remove(image)


class ReadableImagesTest(ImagesCase):
    def recording(self, ending, count=3, masks=False):
        """The cameras' file of one camera."""
        camera = self.camera()
        bpy.context.view_layer.update()
        folder = os.path.join(self.folder, "clip" + ending[1:])
        os.makedirs(folder)
        shots = []
        for k in range(count):
            name = f"c0_{k}{ending}"
            write(os.path.join(folder, name), 8 + k, 20 + k, alpha=not masks)
            shots.append(blender_cameras.shot(self.scene, camera, name))
            if masks:
                shots[-1]["mask_path"] = name
        path = os.path.join(folder, "transforms.json")
        with open(path, "w", encoding="utf-8") as file:
            json.dump({"frames": shots}, file)
        return path

    @needs_library
    def test_imported(self):
        for ending, masks in ((".tif", False), (".tga", False), (".bmp", True), (".webp", False)):
            with self.subTest(ending):
                path = self.recording(ending, masks=masks)
                bpy.ops.matterfit.import_images(filepath=path)
                capture = self.settings.captures[-1]
                self.assertIn("1 cameras, 3 images of 3 times", capture.summary)
                self.assertIn("covers 37.5 to 37.5 %", capture.summary)
                camera = blender_cameras.of_capture(self.scene, capture.name)[0]
                shown = camera.data.background_images[0].image
                self.assertEqual(os.path.basename(shown.filepath), "c0_0" + ending, "the artist's own file")

    @needs_library
    def test_the_job_has_files_that_the_library_reads(self):
        self.jelly()
        path = self.recording(".tif")
        for name in ("c0_0.tif", "c0_1.png", "c0_2.tif"):  # the cube, which stands still there
            write(os.path.join(os.path.dirname(path), name), 14, 19, rows=(10, 15))
        with open(path, encoding="utf-8") as file:
            document = json.load(file)
        document["frames"][1]["file_path"] = "c0_1.png"
        with open(path, "w", encoding="utf-8") as file:
            json.dump(document, file)
        bpy.ops.matterfit.import_images(filepath=path, cameras=False)
        found, folder = self.document(task="compare")
        cameras = found["captures"][0]["cameras"]
        self.assertTrue(cameras.startswith("input/"), cameras)
        with open(os.path.join(folder, cameras), encoding="utf-8") as file:
            names = [shot["file_path"] for shot in json.load(file)["frames"]]
        self.assertTrue(all(name.endswith(".png") for name in names), names)
        self.assertIn("c0_2", names[2])
        for name in names:
            self.assertTrue(os.path.isfile(os.path.join(folder, "input", name)), name)
        self.assertEqual(os.path.realpath(os.path.join(folder, "input", names[1])),
                         os.path.realpath(os.path.join(os.path.dirname(path), "c0_1.png")))
        self.scene.frame_end = 3
        self.settings.solver.use_ground = False
        self.assertEqual(bpy.ops.matterfit.compare(), {"FINISHED"}, self.error())
        self.assertTrue(self.settings.compare.images_done)

    @needs_library
    def test_what_is_broken_is_named(self):
        path = self.recording(".tif")
        broken = os.path.join(os.path.dirname(path), "c0_1.tif")
        with open(broken, "wb") as file:
            file.write(b"II*\0 this is no image")
        self.fails(bpy.ops.matterfit.import_images, ["c0_1.tif", "could not read it"], filepath=path)
        os.remove(broken)
        self.fails(bpy.ops.matterfit.import_images, ["c0_1.tif", "does not exist"], filepath=path)
        self.assertEqual(len(self.settings.captures), 0)

    def test_what_the_library_reads_is_left_alone(self):
        path = self.recording(".png")
        self.assertIsNone(readable_images.cameras(path, "", self.folder, None))
        self.assertIsNone(readable_images.cameras(os.path.join(self.folder, "sparse"), "", self.folder, None))
        self.assertFalse(readable_images.is_foreign("images/r_0"))

    def test_more_than_eight_bits_become_openexr(self):
        path = os.path.join(self.folder, "deep.tif")
        image = bpy.data.images.new("deep", 4, 4, alpha=False, float_buffer=True)
        image.pixels.foreach_set([0.25] * 64)
        self.scene.render.image_settings.file_format = "TIFF"
        self.scene.render.image_settings.color_depth = "16"
        image.save_render(path, scene=self.scene)
        self.assertTrue(readable_images.converted(path).endswith(".exr"))
        self.assertEqual(readable_images.converted(path), readable_images.converted(path), "made once")

    @needs_library
    def test_a_movie_is_all_its_frames(self):
        if not bpy.app.build_options.codec_ffmpeg:
            self.skipTest("this Blender was built without FFmpeg")
        camera = self.camera()
        bpy.context.view_layer.update()
        folder = os.path.join(self.folder, "film")
        os.makedirs(folder)
        for k in range(3):
            write(os.path.join(self.folder, f"m_{k}.png"), 8 + 4 * k, 20 + 4 * k, alpha=False)
        movie = self.movie(os.path.join(folder, "take.mkv"), [f"m_{k}.png" for k in range(3)])
        shot = blender_cameras.shot(self.scene, camera, "take.mkv")
        with open(os.path.join(folder, "transforms.json"), "w", encoding="utf-8") as file:
            json.dump({"frames": [shot]}, file)
        self.assertEqual(readable_images.movie_length(movie), (3, 24.0))
        bpy.ops.matterfit.import_images(filepath=os.path.join(folder, "transforms.json"), cameras=False,
                                        plate=self._black())
        self.assertIn("1 cameras, 3 images of 3 times, 0.0833 s", self.settings.captures[0].summary)

    def _black(self):
        path = os.path.join(self.folder, "plate.png")
        write(path, 0, 0, alpha=False)
        return path

    def movie(self, path, names):
        scene = bpy.data.scenes.new("Film")
        scene.render.resolution_x, scene.render.resolution_y = WIDTH, HEIGHT
        scene.render.resolution_percentage = 100
        scene.render.fps = 24
        scene.frame_start, scene.frame_end = 1, len(names)
        scene.view_settings.view_transform = "Standard"
        settings = scene.render.image_settings
        if hasattr(settings, "media_type"):  # from 5.0 on
            settings.media_type = "VIDEO"
        settings.file_format = "FFMPEG"
        scene.render.ffmpeg.format, scene.render.ffmpeg.codec = "MKV", "FFV1"
        scene.render.filepath, scene.render.use_file_extension = path, False
        editor = scene.sequence_editor_create()
        strips = editor.strips if hasattr(editor, "strips") else editor.sequences
        for k, name in enumerate(names):
            strip = strips.new_image(name=name, filepath=os.path.join(self.folder, name), channel=1,
                                     frame_start=1 + k)
            strip.frame_final_duration = 1
        bpy.ops.render.render(animation=True, scene=scene.name)
        bpy.data.scenes.remove(scene)
        return path

    def test_a_broken_movie_is_named(self):
        path = os.path.join(self.folder, "take.mp4")
        with open(path, "wb") as file:
            file.write(b"no movie")
        with self.assertRaises(JobError) as caught:
            readable_images.movie_length(path)
        self.assertIn("take.mp4", str(caught.exception))
