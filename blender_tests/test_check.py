# SPDX-License-Identifier: GPL-3.0-or-later
"""Check: what a recording will identify, in the panel's words."""

import json
import os
import unittest

import bpy
import numpy
from fake_check import enough, parameter, result
from matterfit import ui
from matterfit.io import check, files, fit_rows
from matterfit.ui import check as panel
from panel_recorder import _stand_in, faults_of, text_width
from support import SceneCase, needs_library, tree
from test_diagnose import Recorder
from test_fit import FakeFitCase
from test_operators import Backend


class CheckCase(FakeFitCase):
    def setUp(self):
        super().setUp()
        fit_rows.refresh(self.settings)

    def checked(self, **other):
        self.backend = Backend(frames=(0, 0), result=result(**other))
        self.assertEqual(bpy.ops.matterfit.check_fit(), {"FINISHED"}, self.error())
        self.backend = None
        return check.read(self.fit.check)

    def texts(self):
        recorder = Recorder()
        panel.MATTERFIT_PT_fit_check.draw(_stand_in(panel.MATTERFIT_PT_fit_check, recorder),
                                          bpy.context)
        return [item for item in recorder.drawn if isinstance(item, str)]

    def said(self):
        return " ".join(self.texts())


class RunTest(CheckCase):
    def test_touches_no_cache(self):
        """Neither the fit's, with its result, nor a take's; the temporary files are gone."""
        self.fitted()
        before = tree(self.folder)
        self.checked()
        self.assertEqual(tree(self.folder), before)
        self.assertTrue(self.fit.done)
        document, options = self.started[-1]
        self.assertEqual(options["task"], "check")
        self.assertEqual(document["fit"], self.started[0][0]["fit"])

    def test_refused(self):
        self.fit.loss = "CHAMFER"
        self.greyed(bpy.ops.matterfit.check_fit, "the same points.*Set Loss in Fit to Tracks")
        self.fit.loss = "TRACKS"
        self.capture.enabled = False
        self.fails(bpy.ops.matterfit.check_fit, ["no capture to fit to"])
        self.assertEqual((self.started, self.fit.check), ([], ""))

    def test_cancelled_keeps_what_was_checked_before(self):
        self.checked()
        before = self.fit.check
        self.cancelled(operator="check_fit")
        self.assertEqual(self.fit.check, before)

    def test_a_result_of_another_version(self):
        self.backend = Backend(frames=(0, 0), result={"schema": "matterfit.check/9"})
        self.fails(bpy.ops.matterfit.check_fit, ["none that this version reads"])
        self.assertEqual(self.fit.check, "")

    def test_is_saved_with_the_file(self):
        self.checked()
        bpy.ops.wm.save_mainfile()
        self.reopen()
        self.assertEqual(len(check.read(self.settings.fit.check).parameters), 8)
        self.assertIn("6 of 8", self.said())
        bpy.ops.matterfit.clear_check()
        self.assertFalse(panel.MATTERFIT_PT_fit_check.poll(bpy.context))


class WordsTest(CheckCase):
    def test_parameters(self):
        report = self.checked()
        shown = [(label, check.error_text(self.settings, each), each.known)
                 for each, label in check.rows(self.settings, report)]
        self.assertEqual(shown, [
            ("Young's Modulus", "± 440 Pa (0.44 %)", True),
            ("Poisson's Ratio", "nothing recorded shows it", False),
            ("Velocity", "± 0.00050 m/s", True),
            ("Spin X", "± 0.0020 rad/s", True),
            ("Spin Z", "± 0.0020 rad/s", True),
            ("Spin Y", "unknown: ± 12 rad/s", False)])

    def test_people_read_it(self):
        """No path of the document, no NaN, no power of ten; all that the brief of a check holds."""
        self.checked()
        said = self.said()
        for words in ("identifies 6 of 8 values", "Tied: Young's Modulus and Poisson's Ratio",
                      "at half of it Poisson's Ratio would be 3.3 times as uncertain",
                      "second half identifies Young's Modulus the most", "The noise hides Spin Y: it is "
                      "0.5 mm, and would have to be 0.12 mm",
                      "Record instead: Throw it fast and sideways."):
            self.assertIn(words, said)
        for word in ("bodies", "material", "[1]", "nan", "None", "inf", "e+", "library's words"):
            self.assertNotIn(word, said)

    def test_a_recording_that_identifies_all(self):
        self.checked(parameters=[parameter("bodies.Cube.material.E", 1e5, 442.5, "Pa")], ties=[],
                     enough=[enough("frame rate"), enough("duration"), enough("noise")],
                     record_instead="")
        said = self.said()
        for words in ("identifies all of it", "The frame rate suffices.", "long enough",
                      "noise is small enough"):
            self.assertIn(words, said)
        self.assertNotIn("Record instead", said)

    def test_several_bodies_are_named(self):
        self.body(self.cube("Second"))
        self.checked(parameters=[parameter("bodies.Second.material.E", 1e5, 442.5, "Pa"),
                                 parameter("gravity[2]", -9.8, 0.1, "m/s²")])
        self.assertIn("Second: Young's Modulus ±", self.said())
        self.assertIn("Gravity Z ±", self.said())

    def test_what_is_no_number(self):
        """Null, and what Python's JSON takes for a number."""
        report = self.checked(parameters=[parameter("bodies.Cube.material.E", None, float("nan"),
                                                    "Pa", False)], noise={"sigma": None})
        self.assertEqual((report.parameters[0].error, report.parameters[0].start, report.sigma),
                         (None, None, None))
        self.assertNotIn("nan", self.said().lower())
        self.assertIn("The noise hides Spin Y.", self.said())

    def test_stale(self):
        self.checked()
        self.assertNotIn("Check again", self.said())
        row = self.row("material.E")
        row.enabled = False
        self.assertIn("Check again", self.said())
        row.enabled = True
        self.assertNotIn("Check again", self.said())
        self.scene.frame_end += 1
        self.assertIn("Check again", self.said())

    def test_damaged(self):
        for text in ("{", "[]", json.dumps({"schema": check.SCHEMA}),
                     json.dumps({"schema": check.SCHEMA, "parameters": [{}]})):
            self.fit.check = text
            self.assertIsNone(check.read(text))
            self.assertIn("Check again", self.said())

    @unittest.skipUnless(text_width("Young's") > 0.0, "this Blender has no fonts in the background")
    @unittest.skipIf(bpy.app.version >= (4, 0), "the room of labels was read off Blender 3.4")
    def test_nothing_is_cut(self):
        self.checked()
        self.assertIn(panel.MATTERFIT_PT_fit_check, ui.CLASSES)
        for cls in (panel.MATTERFIT_PT_fit_check, ui.fit.MATTERFIT_PT_fit):
            self.assertEqual(faults_of(cls, bpy.context), [])
        # What is not translated is not measured there: it is wrapped, as far as it has spaces.
        for text in self.texts():
            for word in text.split():
                self.assertLess(text_width(word), 120.0, text)


@needs_library
class NativeTest(SceneCase):
    """A cube that is thrown and lands: its corners tell the throw, whatever its stiffness."""

    def test_a_throw(self):
        self.jelly(separation=0.05, location=(0.0, 0.0, 3.0))
        self.scene.frame_end = 8
        corners = numpy.array([[x, y, z] for x in (-0.08, 0.08) for y in (-0.08, 0.08)
                               for z in (2.92, 3.08)])
        times = numpy.arange(8) / 24.0
        fall = numpy.outer(times, (1.0, 0.0, 1.0)) + numpy.outer(times**2, (0.0, 0.0, -4.905))
        files.write_npz(os.path.join(self.folder, "clip.npz"),
                        {"positions": corners + fall[:, None], "times": times})
        capture = self.settings.captures.add()
        capture.name, capture.filepath = "clip", "//clip.npz"
        capture.use_noise, capture.noise = True, 5e-4
        fit_rows.refresh(self.settings)
        before = sorted(os.listdir(self.folder))
        self.assertEqual(bpy.ops.matterfit.check_fit(), {"FINISHED"}, self.error())
        self.assertEqual(sorted(os.listdir(self.folder)), before)
        report = check.read(self.settings.fit.check)
        found = {label: each for each, label in check.rows(self.settings, report)}
        self.assertTrue(found["Velocity"].known)
        self.assertLess(found["Velocity"].error, 5e-3)
        self.assertFalse(found["Young's Modulus"].known, "in free flight nothing squeezes it")
        self.assertEqual({each.what for each in report.enough},
                         {"frame rate", "duration", "noise"})
