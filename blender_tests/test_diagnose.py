# SPDX-License-Identifier: GPL-3.0-or-later
"""Diagnose: the report as the panel reads it, the table, jumping to the worst frames."""

import json
import os
from unittest import mock

import bpy
import fake_diagnosis
import fake_fit
import numpy
from fake_diagnosis import cause, number
from matterfit import jobs, ui
from matterfit.io import diagnosis, files, fit_results, fit_rows, takes
from matterfit.jobs import JobError
from matterfit.ui import diagnose as panel
from panel_recorder import Layout, _stand_in, faults_of, text_width
from support import SceneCase, needs_library
from test_fit import FakeFitCase
from test_operators import Backend


class Recorder(Layout):
    """Keeps every text and operator that is drawn."""

    def __init__(self, *arguments, drawn=None, **options):
        super().__init__([], *arguments, **options)
        self.drawn = [] if drawn is None else drawn

    def _part(self, across, shrink=0.0, heading=""):
        return Recorder(across=across, drawn=self.drawn)

    def label(self, text="", icon="NONE", translate=True):
        self.drawn.append(text)

    def operator(self, name, text=None, icon="NONE"):
        properties = super().operator(name, text=text, icon=icon)
        self.drawn.append((name, text, properties))
        return properties


class DiagnoseCase(FakeFitCase):
    DRAG = cause("drag_quadratic", {"drag_coefficient": number(0.47, "", 0.012)})
    OTHER = cause("time_offset", {"offset": number(0.004, "s", 0.001)}, probability=0.002,
                  accepted=False, gain=None, gain_interval=None)

    def diagnosed(self, causes, change=None, **other):
        def work():
            fake_fit.write(self.run_folder)
            fake_diagnosis.write(self.run_folder, causes, change, **other)
        self.backend = Backend(frames=(0, 0), work=work)
        self.assertEqual(bpy.ops.matterfit.diagnose(), {"FINISHED"}, self.error())
        self.scene = bpy.context.scene
        self.settings = self.scene.matterfit

    def extended(self, *causes, change, index=0):
        self.diagnosed(list(causes), change)
        self.settings.diagnosis.cause_index = index
        self.assertEqual(bpy.ops.matterfit.extend_model(), {"FINISHED"}, self.error())

    def drawn(self):
        recorder = Recorder()
        panel.MATTERFIT_PT_diagnose.draw(_stand_in(panel.MATTERFIT_PT_diagnose, recorder),
                                         bpy.context)
        return recorder.drawn

    def texts(self):
        return [item for item in self.drawn() if isinstance(item, str)]

    def buttons(self, name):
        return [item[1:] for item in self.drawn() if isinstance(item, tuple) and item[0] == name]


class JobTest(DiagnoseCase):
    def test_runs_in_the_folder_of_the_fit(self):
        self.fitted()
        folder = self.run_folder
        self.diagnosed([self.DRAG])
        document, options = self.started[-1]
        self.assertEqual(self.run_folder, folder)
        self.assertEqual((document["task"], options["task"]), ("diagnose", "diagnose"))
        self.assertEqual(document["fit"], self.started[0][0]["fit"])
        self.assertEqual(document["output"], {"folder": "."})
        self.assertTrue(self.settings.fit.done)
        self.assertIn("best of 24 causes", bpy.context.window_manager.matterfit.last_report)

    def test_without_a_report_it_says_so(self):
        self.backend = Backend(frames=(0, 0), work=lambda: fake_fit.write(self.run_folder))
        self.fails(bpy.ops.matterfit.diagnose, ["diagnosis.json does not exist", "Diagnose again"])

    def test_cancelled_before_anything_was_written(self):
        self.fitted()
        before = files.read_json(os.path.join(self.run_folder, "job.json"))
        self.backend = Backend(frames=(0, 0), status=jobs.EXIT_CANCELLED)
        self.assertEqual(bpy.ops.matterfit.diagnose(), {"CANCELLED"})
        self.assertEqual(files.read_json(os.path.join(self.run_folder, "job.json")), before)
        self.assertTrue(self.settings.fit.done)

    def test_free_takes_it_with_the_fit(self):
        self.diagnosed([self.DRAG])
        folder = self.run_folder
        self.assertEqual(bpy.ops.matterfit.free_fit(), {"FINISHED"})
        self.assertFalse(os.path.exists(folder))
        self.assertEqual(self.settings.fit.run.folder, "")
        self.assertEqual(self.drawn()[1:], [])

    def test_the_fit_stays_shown_when_its_job_is_written_again(self):
        self.diagnosed([self.DRAG])
        self.assertEqual(bpy.ops.matterfit.write_fit_job(), {"FINISHED"})
        self.assertTrue(self.settings.fit.done)
        self.assertEqual(files.read_json(os.path.join(self.run_folder, "job.json"))["task"], "fit")

    def test_clouds_are_refused(self):
        self.fit.loss = "CHAMFER"
        self.greyed(bpy.ops.matterfit.diagnose, "the same points.*Set Loss in Fit to Tracks")
        self.fit.loss = "TRACKS"
        self.assertTrue(bpy.ops.matterfit.diagnose.poll())


class ReportTest(DiagnoseCase):
    def test_read(self):
        self.diagnosed([self.DRAG, self.OTHER], where="")
        report = diagnosis.load(self.run_folder)
        self.assertEqual(report.verdict, "cause")
        first, second = report.causes
        self.assertEqual((first.effect, first.label), ("drag_quadratic", "Air Drag"))
        self.assertEqual(first.numbers[0].text, "0.470 ± 0.012")
        self.assertEqual(first.gain_interval, (0.78, 0.85))
        self.assertIsNone(second.gain)
        self.assertEqual([worst.frame for worst in report.worst], [4, 2])
        self.assertEqual(report.worst[0].where, (0.1, 0.0, 0.3))
        self.assertIsNotNone(report.model)

    def test_causes_that_stay_alike_have_their_labels(self):
        alike = "{} and {} stay alike in each recording that was tried."
        self.diagnosed([self.DRAG], next_recording="Throw it fast. " + alike.format(
            "gravity_size", "drag_quadratic"))
        self.assertEqual(diagnosis.load(self.run_folder).next_recording,
                         "Throw it fast. " + alike.format("Gravity", "Air Drag"))

    def test_none_where_there_is_none(self):
        self.assertIsNone(diagnosis.load(self.folder))
        self.assertIsNone(diagnosis.load_quietly(self.folder))

    def test_damaged(self):
        path = os.path.join(self.folder, diagnosis.REPORT_FILE)
        for content, words in ((b"{", "not valid JSON"), (b'{"schema": "other/1"}', "this version"),
                               (json.dumps({"schema": diagnosis.SCHEMA}).encode(), "verdict")):
            files.write_bytes(path, content)
            with self.assertRaises(JobError) as caught:
                diagnosis.load(self.folder)
            self.assertIn(path, str(caught.exception))
            self.assertIn(words, str(caught.exception))
            self.assertIsNone(diagnosis.load_quietly(self.folder))

    def test_what_is_not_finite(self):
        odd = cause("velocity", {"x": number(None), "y": number(0.2, "m/s")}, probability=None,
                    holdout_before=None)
        self.diagnosed([odd])
        found = diagnosis.load(self.run_folder).causes[0]
        self.assertEqual([item.name for item in found.numbers], ["y"])
        self.assertEqual(found.probability, 0.0)


class PanelTest(DiagnoseCase):
    def test_nothing_before_the_first(self):
        self.assertEqual(self.texts(), [])
        self.assertFalse(bpy.ops.matterfit.open_report.poll())
        self.assertFalse(bpy.ops.matterfit.extend_model.poll())

    def test_rows(self):
        self.diagnosed([self.DRAG, self.OTHER])
        texts = self.texts()
        for text in ("0.470 ± 0.012", "90 % likely", "Gain 82 %", "0.0040 ± 0.0010 s", "< 1 % likely",
                     "Gain –"):
            self.assertIn(text, texts)
        rows = self.buttons("matterfit.diagnosis_cause")
        self.assertEqual([text for text, _properties in rows], ["1  Air Drag", "2  Time Offset"])
        self.assertEqual([properties.index for _text, properties in rows], [0, 1])
        said = " ".join(texts)
        self.assertIn("best of 24 causes tested", said)
        self.assertIn("Not observable: Time Offset, Linear Drag", said)
        self.assertIn("Throw it fast and sideways.", said)
        self.assertIn("Why drag quadratic is believed.", said)
        self.assertNotIn("earlier fit", said)
        bpy.ops.matterfit.diagnosis_cause(index=1)
        self.assertIn("Why time offset is believed.", " ".join(self.texts()))

    def test_many_causes_are_folded(self):
        self.diagnosed([self.DRAG, *[self.OTHER] * 9])
        self.assertEqual(len(self.buttons("matterfit.diagnosis_cause")), panel.PROBABLE)
        self.settings.diagnosis.show_all = True
        self.assertEqual(len(self.buttons("matterfit.diagnosis_cause")), 10)

    def test_nothing_is_cut(self):
        if text_width("Young's") <= 0.0:
            self.skipTest("this Blender has no fonts in the background")
        names = [*diagnosis._LABELS, "drag_linear", "drag_quadratic", "wind", "buoyancy",
                 "frame_acceleration", "vortex", "force_field"]
        self.diagnosed([cause(name, {"added": number(1.0)}) for name in names])
        self.settings.diagnosis.show_all = True
        for cls in ui.CLASSES:
            if issubclass(cls, panel.MATTERFIT_PT_diagnose):
                self.assertEqual(faults_of(cls, bpy.context), [])
        # What is not translated is not measured there: the rows of the table, in a box.
        for texts, room in ((("x: (2.943 ± 0.012)e7 Pa s", "acceleration[0]: -0.470 ± 0.012"), 183.0),
                            (("> 99 % likely", "Gain -100 %"), 91.0)):
            for text in texts:
                self.assertLess(text_width(text), room, text)

    def test_worst_frames_jump(self):
        self.diagnosed([self.DRAG])
        rows = self.buttons("matterfit.diagnosis_jump")
        self.assertEqual([text for text, _properties in rows], ["Frame 4: 4 mm", "Frame 2: 2 mm"])
        self.scene.frame_set(1)
        self.assertEqual(bpy.ops.matterfit.diagnosis_jump(frame=rows[0][1].frame), {"FINISHED"})
        self.assertEqual(self.scene.frame_current, 4)

    def test_damaged(self):
        self.diagnosed([self.DRAG])
        files.write_bytes(os.path.join(self.run_folder, diagnosis.REPORT_FILE), b"{")
        self.assertIn("cannot be read", " ".join(self.texts()))

    def test_of_an_earlier_fit(self):
        self.diagnosed([self.DRAG], lambda scene: None)
        fake_fit.write(self.run_folder, extra=[fake_fit.estimate("gravity[2]", "m/s²", -9.8, -9.7,
                                                                 0.1)])
        self.assertIn("earlier fit", " ".join(self.texts()))
        self.fails(bpy.ops.matterfit.extend_model, ["earlier fit", "Diagnose again"])

    def test_page(self):
        self.diagnosed([self.DRAG])
        from matterfit.ops import diagnose
        opened = []
        fake = mock.Mock(wm=mock.Mock(url_open=lambda url: opened.append(url)))
        with mock.patch.object(diagnose.bpy, "ops", fake):
            diagnose.MATTERFIT_OT_open_report.act(None, bpy.context)
        self.assertEqual(len(opened), 1)
        self.assertTrue(opened[0].startswith("file:///") and opened[0].endswith("diagnosis.html"))
        os.remove(os.path.join(self.run_folder, diagnosis.PAGE_FILE))
        self.fails(bpy.ops.matterfit.open_report, ["diagnosis.html does not exist"])


@needs_library
class NativeTest(SceneCase):
    """A cube is thrown in a stronger gravity than the scene has."""

    def test_wrong_gravity(self):
        body = self.jelly(separation=0.05, location=(0.0, 0.0, 3.0))
        body.velocity = (1.0, 0.0, 1.0)
        self.scene.frame_end = 12
        corners = numpy.array([[x, y, z] for x in (-0.08, 0.08) for y in (-0.08, 0.08)
                               for z in (2.92, 3.08)])
        times = numpy.arange(12) / 24.0
        fall = numpy.outer(times, (1.0, 0.0, 1.0)) + numpy.outer(times**2, (0.0, 0.0, -5.5))
        noise = numpy.random.default_rng(3).normal(0.0, 5e-4, (12, 8, 3))
        files.write_npz(os.path.join(self.folder, "clip.npz"),
                        {"positions": corners + fall[:, None] + noise, "times": times})
        capture = self.settings.captures.add()
        capture.name, capture.filepath = "clip", "//clip.npz"
        capture.use_noise, capture.noise = True, 5e-4
        capture.holdout, capture.holdout_start = "FRAMES", 11
        fit_rows.refresh(self.settings)
        fit = self.settings.fit
        for row in fit.parameters:
            row.enabled = row.key == "velocity"
        fit.windows, fit.levels = False, 1
        self.assertEqual(bpy.ops.matterfit.diagnose(), {"FINISHED"}, self.error())
        folder = takes.locate(self.settings.fit.run).folder
        report = diagnosis.load(folder)
        self.assertTrue(diagnosis.is_of_fit(report, fit_results.load(folder)))
        self.assertIn("gravity_size", files.read_json(
            os.path.join(folder, diagnosis.REPORT_FILE))["class"], report.sentence)
        self.assertTrue(os.path.isfile(os.path.join(folder, diagnosis.PAGE_FILE)))
        self.assertTrue(all(1 <= worst.frame <= 12 for worst in report.worst))
        place = next((index for index, found in enumerate(report.causes)
                      if found.effect == "gravity_size" and found.accepted), None)
        if place is not None:
            gravity = tuple(self.settings.solver.gravity)
            self.assertEqual(bpy.ops.matterfit.preview_extended(), {"FINISHED"}, self.error())
            take = self.settings.takes[self.settings.take_index]
            self.assertTrue(take.extended and take.baked)
            self.assertEqual(take.frames_done, 12)
            self.assertEqual(tuple(self.settings.solver.gravity), gravity)
            self.settings.diagnosis.cause_index = place
            self.assertEqual(bpy.ops.matterfit.extend_model(), {"FINISHED"}, self.error())
            self.assertAlmostEqual(self.settings.solver.gravity[2], -11.0, delta=0.5)
