# SPDX-License-Identifier: GPL-3.0-or-later
"""Outlines of a take against the mattes of images: compared, listed, laid over the cameras' views;
cameras of the scene that stand as a fit has found them."""

import json
import os

import bpy
import numpy
from matterfit import jobs, native
from matterfit.io import blender_cameras, comparison, image_comparison, job_captures, takes
from matterfit.ops import compare as compare_operator
from matterfit.props.compare import store
from matterfit.ui import compare as compare_panel
from panel_recorder import faults_of, text_width
from support import needs_library
from test_camera_poses import POSES
from test_images import HEIGHT, WIDTH, ImagesCase
from test_latent import texts


def write_square(path, rows, columns):
    image = bpy.data.images.new("matte", WIDTH, HEIGHT, alpha=True)
    pixels = numpy.zeros((HEIGHT, WIDTH, 4), dtype=numpy.float32)
    pixels[rows[0]:rows[1], columns[0]:columns[1]] = 1.0
    image.pixels.foreach_set(pixels.ravel())
    image.filepath_raw, image.file_format = path, "PNG"
    image.save()
    bpy.data.images.remove(image)


class CompareImagesTest(ImagesCase):
    def still(self, count):
        """A film of a cube that does not fall: its camera's file."""
        path = self.clip(count)
        for k in range(count):
            write_square(os.path.join(self.folder, "clip", f"c0_{k}.png"), (10, 15), (14, 19))
        return path

    def compared(self):
        self.jelly()
        self.scene.frame_end = 5
        self.settings.solver.use_ground = False
        bpy.ops.matterfit.import_images(filepath=self.still(5))
        self.assertEqual(bpy.ops.matterfit.compare(), {"FINISHED"}, self.error())
        return self.settings.compare

    @needs_library
    def test_what_falls_leaves_its_outline(self):
        compare = self.compared()
        self.assertTrue(compare.images_done)
        self.assertFalse(compare.done, "no points were compared")
        self.assertEqual(compare.capture, "clip")
        self.assertGreater(compare.iou, 0.3)
        self.assertLess(compare.iou, 0.9)
        self.assertGreater(compare.contour_px, 0.2)
        worst = compare.worst_images[0]
        self.assertEqual((worst.frame, worst.camera, worst.name), (5, 0, "c0_4.png"))
        self.assertGreater(worst.outside, 3)
        self.assertGreater(worst.missing, 3)
        compare.worst_image = 1
        self.assertEqual(self.scene.frame_current, compare.worst_images[1].frame)
        self.assertIn(f"{100.0 * compare.iou:.1f} %", texts(compare_panel.MATTERFIT_PT_compare))
        # What was compared is of other captures than there are now.
        self.settings.captures[0].enabled = False
        self.assertFalse(compare.images_done)

    @needs_library
    def test_overlays_follow_the_frames(self):
        self.compared()
        camera = bpy.data.collections["clip"].objects[0]
        other = self.scene.camera
        self.assertNotEqual(camera, other)
        self.assertEqual(bpy.ops.matterfit.show_overlays(), {"FINISHED"}, self.error())
        self.assertEqual(self.scene.camera, camera)
        photograph, shown = camera.data.background_images
        self.assertEqual(photograph.display_depth, "BACK")
        self.assertEqual((shown.image.source, shown.display_depth), ("SEQUENCE", "FRONT"))
        user = shown.image_user
        for frame in range(1, 6):
            self.assertEqual(frame - user.frame_start + 1 + user.frame_offset, frame)
        bpy.ops.matterfit.show_overlays()
        self.assertEqual(len(camera.data.background_images), 2, "in place of the one before")
        # They are of this take.
        bpy.ops.matterfit.add_take()
        self.assertEqual([shown.show_background_image for shown in camera.data.background_images], [True, False])
        self.settings.take_index = 0
        self.assertTrue(all(shown.show_background_image for shown in camera.data.background_images))

        folder = takes.locate(takes.ensure_active(self.settings)).folder
        found = image_comparison.overlays(folder, "clip")
        self.assertEqual(sorted(found[0]), [1, 2, 3, 4, 5])
        report = image_comparison.load(folder, "clip")
        image = bpy.data.images.load(found[0][5])
        pixels = numpy.array(image.pixels[:]).reshape(HEIGHT, WIDTH, 4)[7:]  # above the number
        marked = pixels[..., 3] > 0.5
        self.assertEqual((marked & (pixels[..., 2] > 0.5)).sum(), report.frames[-1]["missing_px"])

        bpy.data.objects.remove(camera)
        self.fails(bpy.ops.matterfit.show_overlays, ["no cameras of 'clip'", "Add Cameras"])

    def test_what_is_held_out_stands_apart(self):
        images = {"name": "clip", "images": 4, "iou": 0.9, "contour_px": 1.0, "frames": [],
                  "held_out": {"iou": 0.8, "contour_px": 2.0, "psnr_db": 21.25, "ssim": 0.5},
                  "not_held_out": {"iou": 0.95, "contour_px": 0.5, "psnr_db": 30.5, "ssim": 0.875}}
        compare = self.settings.compare
        shown = {}
        for name in ("both", "one", "none"):
            if name == "one":
                images = {**images, "psnr_db": 25.0, "ssim": 0.7}
                del images["held_out"], images["not_held_out"]
            elif name == "none":
                del images["psnr_db"]
            with open(os.path.join(self.folder, "report.json"), "w", encoding="utf-8") as file:
                json.dump({"compare": {"images": [images]}}, file)
            found = image_comparison.load(self.folder, "clip")
            store(compare, None, found)
            shown[name] = texts(compare_panel.MATTERFIT_PT_compare).partition(" Worst Images")[0]
            said = compare_operator.image_summary(found, jobs.Job("", None))
            self.assertIn({"both": "by 95.0 %, held-out ones by 80.0 %, in"}.get(name, "by 90.0 %, in"), said)
            if bpy.app.version < (4, 0) and text_width(said) > 0.0:  # where the room of labels was read off
                self.assertEqual(faults_of(compare_panel.MATTERFIT_PT_compare, bpy.context), [])
        self.assertEqual(shown, {
            "both": "Not Held Out Overlap 95.0 % Outlines Off 0.50 px Colours 30.5 dB SSIM 0.875 "
                    "Held Out Overlap 80.0 % Outlines Off 2.00 px Colours 21.2 dB SSIM 0.500",
            "one": "Overlap 90.0 % Outlines Off 1.00 px Colours 25.0 dB SSIM 0.700",
            "none": "Overlap 90.0 % Outlines Off 1.00 px"})

    def test_images_that_show_nothing(self):
        seen = {"frame": 2.0, "camera": 0, "image": "c0_2.png", "iou": 0.4, "outside_px": 3, "missing_px": 5}
        nothing = {**seen, "frame": 1.0, "image": "c0_1.png", "iou": None, "outside_px": 0, "missing_px": 0}
        images = {"name": "clip", "images": 1, "empty": 1, "iou": 0.4, "contour_px": 1.0, "frames": [nothing, seen]}
        none = {"name": "clip", "images": 0, "empty": 1, "frames": [nothing]}
        for found, iou, worst in ((images, 0.4, ["c0_2.png"]), (none, -1.0, [])):
            with open(os.path.join(self.folder, "report.json"), "w", encoding="utf-8") as file:
                json.dump({"compare": {"images": [found]}}, file)
            compare = self.settings.compare
            store(compare, None, image_comparison.load(self.folder, "clip"))
            self.assertAlmostEqual(compare.iou, iou, places=6)
            self.assertEqual([row.name for row in compare.worst_images], worst)
        self.assertIn("–", texts(compare_panel.MATTERFIT_PT_compare))

    def test_a_recording_by_images_beside_tracks(self):
        """The library numbers the files of captures by tracks alone."""
        document = {"captures": [{"name": "marks", "tracks": "a.npz"}, {"name": "clip", "cameras": "b.json"}]}
        self.assertEqual(comparison._files(document, "marks")[:2], ("compare.npz", "simulated.npz"))

    def test_nothing_is_shown_before_a_comparison(self):
        self.assertFalse(bpy.ops.matterfit.show_overlays.poll())
        self.assertIsNone(image_comparison.load(self.folder))
        with open(os.path.join(self.folder, "report.json"), "w", encoding="utf-8") as file:
            json.dump({"compare": {"captures": []}}, file)
        self.assertIsNone(image_comparison.load(self.folder))
        self.assertEqual(image_comparison.overlays(self.folder, "clip"), {})


class PosedCamerasTest(ImagesCase):
    @needs_library
    def test_cameras_stand_where_the_library_says(self):
        path = self.clip()
        self.scene.unit_settings.scale_length = 0.5
        bpy.ops.matterfit.import_images(filepath=path)
        camera = bpy.data.collections["clip"].objects[0]
        before, lens = camera.matrix_world.copy(), camera.data.lens
        pose = {"shift": [0.1, -0.2, 0.3], "turn": [0.1, 0.2, -0.3], "focal": 0.05}
        capture = self.settings.captures[0]
        capture.poses = json.dumps([pose])
        options = {"cameras": path, "poses": [pose]}

        def stands_as_told():
            bpy.context.view_layer.update()
            expected = numpy.array(native.capture_summary(path, options)["places"][0]["matrix"])
            expected[:3, 3] *= 2.0
            numpy.testing.assert_allclose(numpy.array(camera.matrix_world), expected, atol=1e-5)

        capture.location, capture.rotation = (0.2, 0.4, -0.6), (0.3, -0.2, 0.1)
        options["transform"] = job_captures.placement(capture, 0.5)
        stands_as_told()
        self.assertAlmostEqual(camera.data.lens, lens * 1.05, places=4)
        capture.unit, capture.up = "CM", "-Y"
        bpy.ops.matterfit.check_capture()
        options.update(unit="cm", up="-y")
        stands_as_told()
        capture.unit, capture.up, capture.location, capture.rotation = "AUTO", "AUTO", (0, 0, 0), (0, 0, 0)
        bpy.ops.matterfit.check_capture()

        capture.name = "Take One"
        copy = camera.copy()
        self.scene.collection.objects.link(copy)
        self.assertEqual(blender_cameras.of_capture(self.scene, "Take One"), {0: camera})
        capture.poses = json.dumps([POSES[1]])
        bpy.ops.matterfit.forget_poses()
        bpy.context.view_layer.update()
        numpy.testing.assert_allclose(numpy.array(camera.matrix_world), numpy.array(before), atol=1e-6)
        self.assertAlmostEqual(camera.data.lens, lens, places=5)
        self.assertTrue(blender_cameras.stands_as_told(capture, camera))
        camera.location.x += 0.01
        bpy.context.view_layer.update()
        self.assertFalse(blender_cameras.stands_as_told(capture, camera))
        bpy.ops.matterfit.remove_capture()
        self.assertEqual(blender_cameras.of_capture(self.scene, "Take One"), {})
