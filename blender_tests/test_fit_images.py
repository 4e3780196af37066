# SPDX-License-Identifier: GPL-3.0-or-later
"""Fits to images: what the panel offers and the document says of them, and what their results show."""

import math
import os
from unittest import mock

import bpy
import fake_fit
from matterfit import jobs, native, ui
from matterfit.io import fit_outlines, takes
from matterfit.jobs import JobError
from matterfit.ui import capture as capture_panel
from matterfit.ui import drawing, fit_overlay, fit_result
from matterfit.ui import fit as fit_panel
from panel_recorder import faults_of_all, text_width
from support import needs_library
from test_compare_images import write_square
from test_correction import properties
from test_fit import FakeFitCase
from test_images import ImagesCase
from test_latent import texts
from test_operators import Backend


class ImageFitCase(FakeFitCase, ImagesCase):
    """The cube of FitCase with a film of it beside its points."""

    def setUp(self):
        super().setUp()
        self.film = self.settings.captures.add()
        self.film.name, self.film.source, self.film.filepath = "film", "IMAGES", self.clip()

    def use(self, points, film):
        self.capture.enabled, self.film.enabled = points, film


class OfferTest(ImageFitCase):
    BY_POINTS = ("windows", "levels", "correction_steps")

    def setUp(self):
        super().setUp()
        self.fit.loss, self.fit.levels, self.fit.correction_steps = "CHAMFER", 2, 8

    def test_the_document_has_what_means_something(self):
        always = {"parameters", "huber", "iterations"}
        for points, film, more in ((True, False, {"loss", "windows", "levels", "correction"}),
                                   (True, True, {"loss"}), (False, True, set())):
            self.use(points, film)
            self.assertEqual(set(self.written()), always | more)
        self.fit.loss = "TRACKS"
        self.assertNotIn("draws", self.written())
        self.use(True, False)
        self.assertIn("draws", self.written())

    @needs_library
    def test_the_library_reads_it(self):
        for points in (True, False):
            self.use(points, True)
            document, folder = self.document("fit")
            native.validate(document, folder)

    def test_the_panel_offers_what_means_something(self):
        for points, film in ((True, False), (True, True), (False, True)):
            self.use(points, film)
            offered = properties(fit_panel.MATTERFIT_PT_fit) + properties(fit_panel.MATTERFIT_PT_fit_advanced)
            self.assertEqual("loss" in offered, points)
            for name in (*self.BY_POINTS, "law"):
                self.assertEqual(name in offered, not film, (name, points, film))
            for name in ("huber", "iterations", "threads", "show_history"):
                self.assertIn(name, offered)

    def test_another_law_is_refused(self):
        """What was chosen for points can be set back."""
        for law in ("FIND", "UNKNOWN"):
            self.fit.law = law
            for points in (True, False):
                self.use(points, True)
                with self.assertRaisesRegex(JobError, "'film' is by images. Set Law to"):
                    self.written()
                self.assertIn("law", properties(fit_panel.MATTERFIT_PT_fit))
                self.assertIn("Laws are compared by points only", texts(fit_panel.MATTERFIT_PT_fit))
                self.assertNotIn("laws", properties(fit_panel.MATTERFIT_PT_fit))
            self.use(True, False)
            self.assertIn("laws", self.written())
            self.assertNotIn("compared by points only", texts(fit_panel.MATTERFIT_PT_fit))

    def test_what_follows_points_is_greyed(self):
        self.fit.loss = "TRACKS"
        for operator in (bpy.ops.matterfit.check_fit, bpy.ops.matterfit.diagnose):
            for points in (True, False):
                self.use(points, True)
                self.greyed(operator, "follow the same points.*disable captures by images")
            self.use(True, False)
            self.assertTrue(operator.poll())


class HoldOutTest(ImageFitCase):
    def shown(self, name):
        return name in properties(capture_panel.MATTERFIT_PT_capture)

    def test_cameras_by_their_name(self):
        self.settings.capture_index = 1
        film = self.film
        for choice, value in (("BOTH", 4), ("TRACKS", 3), ("FRAMES", 1), ("NONE", 0)):
            film.holdout_of_images = choice
            self.assertEqual((film.holdout, film.holdout_of_images), (choice, choice))
            film.holdout = "NONE"
            film.holdout = choice
            self.assertEqual(film.holdout_of_images, choice)
            # Files hold the number.
            self.assertEqual(film.bl_rna.properties["holdout"].enum_items[choice].value, value)
            self.assertTrue(self.shown("holdout_of_images") and not self.shown("holdout"))
        items = {item.identifier: item.name for item in film.bl_rna.properties["holdout_of_images"].enum_items}
        self.assertEqual(items, {"NONE": "Nothing", "FRAMES": "Last Frames", "TRACKS": "Cameras", "BOTH": "Both"})
        film.holdout, film.holdout_tracks = "TRACKS", "0"
        self.assertEqual(self.document("fit")[0]["captures"][1]["holdout"], {"cameras": [0]})
        self.settings.capture_index = 0
        self.assertTrue(self.shown("holdout") and not self.shown("holdout_of_images"))

    @needs_library
    def test_frames_and_cameras(self):
        """Each alone shows its own field."""
        self.settings.capture_index = 1
        film = self.film
        film.holdout_tracks, film.holdout_start = "0", 5
        for choice, frames, cameras in (("FRAMES", True, False), ("TRACKS", False, True), ("BOTH", True, True)):
            film.holdout_of_images = choice
            self.assertEqual((self.shown("holdout_start"), self.shown("holdout_tracks")), (frames, cameras))
        document, folder = self.document("fit")
        self.assertEqual(document["captures"][1]["holdout"], {"frames": [5, 7], "cameras": [0]})
        native.validate(document, folder)
        film.holdout_tracks = ""
        with self.assertRaisesRegex(JobError, "no camera is named"):
            self.written()

    def test_held_out_whole(self):
        """As it was chosen for another source: it is shown, and refused."""
        self.settings.capture_index = 1
        self.film.holdout = "CAPTURE"
        self.assertTrue(self.shown("holdout"))
        self.assertIn("Images are held out by frames or by cameras", texts(capture_panel.MATTERFIT_PT_capture))
        with self.assertRaisesRegex(JobError, "Choose Last Frames, or Cameras and name them"):
            self.written()


class CurveTest(ImageFitCase):
    """Three searches for the throw, of which the first is told to end, and one for all, which ends by another cost
    than that of its last step, as its plan was refined."""

    STEPS = (("throw", 1, 400.0), ("throw", 2, 100.0), ("throw", 2, 100.0), ("throw", 1, 900.0),
             ("throw", 1, 400.0), ("wide", 1, 50.0), ("wide", 2, 2.5), ("wide", 2, 2.0))

    def setUp(self):
        super().setUp()
        self.use(False, True)

    def running(self):
        """Such a fit; the folder of it."""
        self.fitted()
        folder = self.run_folder
        fake_fit.write_history(folder, [{"stage": stage, "iteration": iteration, "cost": cost, "values": []}
                                        for stage, iteration, cost in self.STEPS])
        jobs.registry.add(jobs.Job("Fit", lambda: Backend(frames=[1] * 1000), folder=folder)).start()
        return folder

    def test_each_search_is_compared_with_its_own_first_step(self):
        found = fit_overlay.live_curve(self.running())
        self.assertEqual([(segment.stage, segment.places, segment.errors) for segment in found],
                         [("throw", [0, 1, 2], [1.0, 0.5, 0.5]), ("throw", [3], [1.0]), ("throw", [4], [1.0]),
                          ("wide", [5, 6, 7], [1.0, math.sqrt(0.05), 0.2])])

    def test_what_the_panel_and_the_viewport_say(self):
        self.running()
        self.assertIn("wide: misfit 20 % of the search's first step", texts(fit_panel.MATTERFIT_PT_fit))
        with mock.patch.object(drawing, "Graph") as graph:
            self.assertEqual(fit_overlay.draw(bpy.context, False), 1)
        self.assertEqual(graph.return_value.curve.call_count, 4)
        graph.return_value.labels.assert_called_once_with(
            "Fit: wide", "100 %", "20 %", "misfit 20 % of the search's first step")
        self.fit.show_history = False
        self.assertEqual(fit_overlay.draw(bpy.context, False), 0)


class NativeTest(ImagesCase):
    @needs_library
    def test_a_fit_of_the_library_has_a_curve(self):
        self.jelly()
        self.scene.frame_end = 3
        bpy.ops.matterfit.import_images(filepath=self.clip(), cameras=False)
        for k in range(3):
            write_square(os.path.join(self.folder, "clip", f"c0_{k}.png"), (10, 15), (14, 19))
        fit = self.settings.fit
        for row in fit.parameters:
            row.enabled = row.key == "velocity"
        fit.iterations = 2
        self.assertEqual(bpy.ops.matterfit.fit(), {"FINISHED"}, self.error())
        found = fit_overlay.curve(takes.locate(fit.run).folder)
        self.assertEqual({segment.of_images for segment in found}, {True})
        self.assertTrue(all(segment.errors[0] == 1.0 for segment in found))


class ResultTest(ImageFitCase):
    CAMERAS = [("film", 0, 0.96, 0.81), ("film", 1, None, 0.87), ("film", 2, 0.98, None)]

    def setUp(self):
        super().setUp()
        self.use(False, True)

    def shown(self):
        return texts(fit_result.MATTERFIT_PT_fit_result)

    def check(self):
        """Nothing is cut, where that can be measured."""
        if bpy.app.version < (4, 0) and text_width("Young's") > 0.0:
            self.assertEqual(faults_of_all(ui.CLASSES, bpy.context), [])

    def test_of_what_was_fitted_and_what_was_held_out(self):
        self.fitted(images=fake_fit.outlines((0.5, 0.4), (0.97, 0.84), self.CAMERAS))
        self.assertIn("Fitted outlines overlap by 50.0 → 97.0 %, held-out ones by 40.0 → 84.0 %", self.report())
        shown = self.shown()
        self.assertIn("Overlap of Outlines [%]  Before After Fitted 50.0 97.0 Held Out 40.0 84.0", shown)
        self.assertIn("Overlap by Camera [%] Camera Fitted Held Out 0 96.0 81.0 1 – 87.0 2 98.0 –", shown)
        self.assertNotIn(" mm ", shown)
        self.assertNotIn("show_error", properties(fit_result.MATTERFIT_PT_fit_result))
        self.assertIn("show_curves", properties(fit_result.MATTERFIT_PT_fit_result))
        self.check()

    def test_nothing_held_out(self):
        self.fitted(images=fake_fit.outlines(
            (0.5, None), (0.97, None), [("film", 0, 0.96, None), ("film", 1, 0.98, None)]))
        self.assertIn("Fitted outlines overlap by 50.0 → 97.0 %, in", self.report())
        shown = self.shown()
        self.assertNotIn("Held Out", shown)
        self.assertIn("Camera Fitted 0 96.0 1 98.0", shown)
        self.check()

    def test_nothing_is_seen_at_the_start(self):
        self.fitted(images=fake_fit.outlines((0.5, "empty"), (0.97, 0.84), self.CAMERAS[:1]))
        self.assertIn("held-out ones by – → 84.0 %", self.report())
        self.assertIn("Held Out – 84.0", self.shown())
        self.assertNotIn("by Camera", self.shown())

    def test_beside_points(self):
        self.use(True, True)
        images = fake_fit.outlines((0.5, 0.4), (0.97, 0.84), self.CAMERAS)
        del images["before"], images["after"]
        self.fitted(images=images)
        self.assertIn("Held-out error 16 → 0.75 mm", self.report())
        self.assertIn("mm Before After Fitted 8 0.5 Held Out 16 0.75", self.shown())
        self.assertIn("Held Out 40.0 84.0", self.shown())
        self.assertIn("show_error", properties(fit_result.MATTERFIT_PT_fit_result))
        self.check()

    def test_many_cameras(self):
        """Those that agree least, of two recordings."""
        cameras = [(name, number, 0.99 - 0.01 * number, None) for name in ("film", "other film")
                   for number in range(9)]
        cameras[2] = ("film", 2, 0.99, 0.5)
        self.fitted(images=fake_fit.outlines((0.5, 0.4), (0.97, 0.84), cameras))
        shown = self.shown()
        self.assertIn("Worst Cameras, Overlap [%] film Camera Fitted Held Out 2 99.0 50.0 5 94.0 –", shown)
        self.assertIn("other film Camera Fitted Held Out 6 93.0 – 7 92.0 – 8 91.0 –", shown)
        self.assertEqual(shown.count(" –"), 7)
        self.check()

    def test_points_alone(self):
        self.use(True, False)
        self.fitted()
        self.assertNotIn("Overlap", self.shown())
        self.assertIsNone(fit_outlines.read({}))
