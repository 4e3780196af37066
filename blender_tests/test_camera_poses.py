# SPDX-License-Identifier: GPL-3.0-or-later
"""Colours of images, and cameras that a fit refines: asked for, shown, applied, forgotten."""

import json

import bpy
import fake_fit
from matterfit import native, quantities
from matterfit.io import camera_poses, files, job_document, words
from matterfit.ui import capture as capture_panel
from matterfit.ui import fit_result
from support import needs_library
from test_fit import FakeFitCase
from test_images import ImagesCase
from test_latent import texts

POSES = [{"shift": [0.003, 0.0, -0.004], "turn": [0.0, 0.01, 0.0], "focal": 0.0},
         {"shift": [0.012, 0.0, 0.0], "turn": [0.0, 0.0, 0.0], "focal": 0.02}]


class PosesCase(ImagesCase):
    def setUp(self):
        super().setUp()
        self.jelly()
        self.film = self.settings.captures.add()
        self.film.name, self.film.source, self.film.filepath = "clip", "IMAGES", self.clip()

    def written(self):
        return self.document(task="fit")[0]["captures"][0]


class DocumentTest(PosesCase):
    def test_nothing_is_asked_for_by_itself(self):
        written = self.written()
        for key in ("colours", "refine", "poses"):
            self.assertNotIn(key, written)

    def test_colours_and_refine(self):
        self.film.use_colours = self.film.refine_cameras = True
        written = self.written()
        self.assertEqual(written["colours"], {"noise": 0.1})
        self.assertEqual(written["refine"], {"shift": 0.02, "turn": 0.02, "focal": 0})
        self.film.colour_noise, self.film.pose_focal = 0.25, 0.01
        self.scene.unit_settings.scale_length = 0.5
        written = self.written()
        self.assertEqual(written["colours"], {"noise": 0.25})
        self.assertEqual(written["refine"], {"shift": 0.01, "turn": 0.02, "focal": 0.01})

    def test_found_poses_are_metres_whatever_the_scale(self):
        self.film.poses = camera_poses.text_of(POSES)
        self.scene.unit_settings.scale_length = 0.5
        self.assertEqual(self.written()["poses"], POSES)

    @needs_library
    def test_the_library_reads_it(self):
        self.film.use_colours = self.film.refine_cameras = True
        for poses in ([], POSES[:1]):
            self.film.poses = camera_poses.text_of(poses)
            document, folder = self.document(task="fit")
            native.validate(json.dumps(document), folder)

    def test_points_have_neither(self):
        self.film.use_colours = self.film.refine_cameras = True
        self.film.poses = camera_poses.text_of(POSES)
        self.film.source = "FILE"
        for key in ("colours", "refine", "poses"):
            self.assertNotIn(key, self.written())


class KeptTest(PosesCase):
    def test_are_saved_with_the_file(self):
        self.film.poses = camera_poses.text_of(POSES)
        self.save("again.blend")
        self.reopen("again.blend")
        self.assertEqual(self.written()["poses"], POSES)

    def test_another_file_forgets_them(self):
        self.film.poses = camera_poses.text_of(POSES)
        self.film.filepath = "//other.json"
        self.assertEqual(self.film.poses, "")

    def test_forget(self):
        self.assertFalse(bpy.ops.matterfit.forget_poses.poll())
        self.film.poses = camera_poses.text_of(POSES)
        self.settings.compare.done = True
        bpy.ops.matterfit.forget_poses()
        self.assertEqual(self.film.poses, "")
        self.assertFalse(self.settings.compare.done)
        self.assertNotIn("poses", self.written())

    def test_the_panel_says_how_far(self):
        self.assertNotIn("moved", texts(capture_panel.MATTERFIT_PT_capture))
        self.film.poses = camera_poses.text_of(POSES)
        text = texts(capture_panel.MATTERFIT_PT_capture)
        for part in ("A fit moved the cameras: up to 12 mm and 0.57°.", "up to 2 % off"):
            self.assertIn(part, text)
        self.film.poses = camera_poses.text_of(POSES[:1])
        self.assertIn("up to 5 mm and 0.57°", texts(capture_panel.MATTERFIT_PT_capture))
        self.assertNotIn("Focal lengths", texts(capture_panel.MATTERFIT_PT_capture))

    def test_damaged(self):
        for text in ("{", "5", "{}", "null", '[{"shift": 1}]', '[{"focal": "a"}]', "[1]"):
            self.film.poses = text
            self.assertNotIn("poses", self.written(), text)
            self.assertNotIn("moved", texts(capture_panel.MATTERFIT_PT_capture), text)


class WordsTest(PosesCase):
    def test_paths_in_messages(self):
        for path, wanted in (
                ("captures.clip.poses[2].shift[0]", "'clip', Camera 2, Shift X"),
                ("captures.clip.poses[0].turn", "'clip', Camera 0, Turn"),
                ("captures[0].poses[1].focal", "'clip', Camera 1, Focal Length"),
                ("captures[0].refine.shift", "'clip', Refine Cameras"),
                ("captures[0].colours: gone", "'clip', Colours: gone")):
            self.assertEqual(words.in_panel(path, self.settings), wanted)

    def test_keys(self):
        row = quantities.find("poses[3].turn")
        self.assertEqual((row.key, row.label, row.size),
                         ("poses[3].turn", "Camera 3, Turn [rad]", 3))
        self.assertIsNone(quantities.find("poses[3].place"))


class ApplyTest(FakeFitCase, ImagesCase):
    def setUp(self):
        super().setUp()
        self.capture.source, self.capture.filepath = "IMAGES", self.clip()
        self.capture.refine_cameras = True

    def refined(self, poses=POSES):
        self.fitted(poses=poses, extra=[
            fake_fit.estimate("captures.clip.poses[1].shift[0]", "m", 0.0, 0.012, 0.001),
            fake_fit.estimate("captures.clip.poses[1].focal", "", 0.0, 0.02, 0.03, observable=False,
                              statement="The camera's focal length (captures.clip.poses[1].focal) is "
                                        "hardly observable.")])

    def document_of_fit(self):
        return job_document.build(self.scene, self.fit.run, self.run_folder, "fit")

    def test_the_result_in_words(self):
        self.refined()
        text = texts(fit_result.MATTERFIT_PT_fit_result)
        for part in ("clip: Camera 1, Shift X", "0.0120 ± 0.0010 m", "clip: Camera 1, Focal Length",
                     "focal length ('clip', Camera 1, Focal Length) is"):
            self.assertIn(part, text)
        self.assertNotIn("poses", text)

    def test_apply_keeps_them_with_the_capture(self):
        self.refined()
        bpy.ops.matterfit.apply_fit()
        self.assertEqual(camera_poses.read(self.capture.poses), POSES)
        written = self.document_of_fit()["captures"][0]
        self.assertEqual(written["poses"], POSES)
        self.assertIn("refine", written)
        self.refined(poses=POSES[1:])
        bpy.ops.matterfit.apply_fit()
        self.assertEqual(camera_poses.read(self.capture.poses), POSES[1:])

    def test_a_fit_without_them_leaves_them(self):
        self.capture.poses = camera_poses.text_of(POSES)
        self.fitted()
        self.assertEqual(files.read_json(f"{self.run_folder}/job.json")["captures"][0]["poses"], POSES)
        bpy.ops.matterfit.apply_fit()
        self.assertEqual(camera_poses.read(self.capture.poses), POSES)

    def test_a_capture_that_is_gone(self):
        self.refined()
        self.capture.name = "other"
        self.fails(bpy.ops.matterfit.apply_fit, ["'clip'", "not among the Captures"])
        self.assertEqual(self.capture.poses, "")
