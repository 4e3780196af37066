# SPDX-License-Identifier: GPL-3.0-or-later
"""Panels in the states that only work leaves them in: at the sidebar's default width no text is cut,
and none has a path of the document."""

import os
import re
import unittest

import bpy
import fake_check
import fake_diagnosis
import fake_fit
from fake_diagnosis import cause, number
from matterfit import jobs, ui
from matterfit.io import check, files, takes
from matterfit.jobs import Snapshot
from panel_recorder import faults_of_all, text_width
from test_diagnose import Recorder, _stand_in
from test_fit import FakeFitCase
from test_operators import Backend

PATH = "bodies.Cube.material.E"
# Paths of the document, and files that no artist looks into.
KEYS = re.compile(r"\b(?:bodies|colliders|captures|scene)[.\[]|\w\[\d\]|\.npz|\bNaN\b|start_frame")
NOTES = ["captures.clip: 2 of 6 samples lie outside the simulated time; they are NaN in simulated.npz",
         "captures.clip: points lie up to 2 m off 'Cube' at rest; are unit, transform and start_frame "
         "right?"]


@unittest.skipUnless(text_width("Young's") > 0.0, "this Blender has no fonts in the background")
@unittest.skipIf(bpy.app.version >= (4, 0), "the room of labels was read off Blender 3.4")
class StateTest(FakeFitCase):
    def texts(self):
        """All texts of all panels, in which lines that were wrapped stand together."""
        recorder = Recorder()
        for cls in ui.CLASSES:
            if issubclass(cls, bpy.types.Panel) and cls.poll(bpy.context):
                cls.draw(_stand_in(cls, recorder), bpy.context)
        return " ".join(text for text in recorder.drawn if isinstance(text, str))

    def check(self, *shown):
        """Nothing is cut, there is no path, and `shown` is there."""
        self.assertEqual(faults_of_all(ui.CLASSES, bpy.context), [])
        texts = self.texts()
        self.assertIsNone(KEYS.search(texts), texts)
        for text in shown:
            self.assertIn(text, texts)

    def test_a_baked_take(self):
        document, folder = self.document()
        take = takes.ensure_active(self.settings)
        files.write_json(os.path.join(folder, "job.json"), document)
        for kind in ("volume", "mesh", "points", "attributes", "splat", "state"):
            for frame in range(12):
                files.write_bytes(os.path.join(folder, kind, f"Cube_{frame:04d}.vdb"), bytes(98765))
        take.name, take.baked = "Take of the third bounce", True
        take.first_frame, take.frame_count, take.frames_done = 1001, 250, 240
        collection = bpy.data.collections.new("Matterfit Take")
        self.scene.collection.children.link(collection)
        item = bpy.data.objects.new("Take of the third bounce Cube", None)
        item["matterfit"] = "points:Cube"
        collection.objects.link(item)
        take.collection = collection
        state = bpy.context.window_manager.matterfit
        state.verify = "volume/Cube_0001.vdb has 12 bytes, 98765 were written"
        state.estimate = "8 000 particles\n1.2 GB of memory"
        self.check("frame 1240 of 1250", "12 · 1.2 MB")

    def test_a_running_job(self):
        job = jobs.registry.add(jobs.Job("Bake Take of the third bounce", lambda: Backend((1, 1))))
        job.start().tick()
        job.snapshot = Snapshot(fraction=0.5, stage="Measuring the solver's own error", frame=1240,
                                last_frame=1250, memory=12_300_000_000)
        self.check("Blender uses 12.3 GB")

    def test_a_cancelled_job(self):
        """What it did, over the whole width, above the button that goes on."""
        for resume in ("matterfit.resume", "matterfit.resume_fit", "matterfit.run_batch"):
            job = jobs.registry.add(jobs.Job("Bake Take of the third bounce", lambda: Backend((1, 1)),
                                             resumable=True, resume=resume))
            job.start().tick()
            job.snapshot = Snapshot(fraction=0.5, stage="Simulating", frame=1240, last_frame=1250,
                                    memory=12_300_000_000)
            job.cancel()
            job.join()
            self.check("Cancelled: Bake Take of the third bounce", "frame 1 of 6")
            self.assertNotIn("12.3 GB", self.texts())

    def test_an_error(self):
        state = bpy.context.window_manager.matterfit
        state.last_error = "'Cube', Young's Modulus is -1, expected a number above 0. Raise it."
        self.check("expected a number")
        state.last_error, state.last_report = "", "Mean error 0.8412 mm, 95 % below 2.315 mm, in 12 s"
        self.check("95 % below")

    def test_results(self):
        fitted = [fake_fit.estimate("bodies.Cube.material.damping_shear", "Pa s", 0.0, 1234.5, 67.8),
                  fake_fit.estimate("bodies.Cube.spin[1]", "rad/s", 0.0, -0.0001, 0.012, grid_error=1.849e-6),
                  fake_fit.estimate(PATH, "Pa", 1e5, 2.943e7, 1.2e5, at_bound=True,
                                    statement=f"{PATH} lies at its bound.")]
        for entry in fitted[:1]:
            entry["grid_error"] = 123.4
        self.fitted(extra=fitted, warning=f"{PATH} is at its bound.")
        self.check("Doubtful: Young's Modulus is at its bound.", "0.000 ± 0.012 rad/s", "Grid: ± 1.8e-06")
        self.fit.law = "FIND"
        self.fitted(extra=fitted)
        found = files.read_json(os.path.join(self.run_folder, "result.json"))
        found["fit"]["models"] = [
            {"law": "drucker_prager", "held_out_mm": 12.3456, "probability": 0.97},
            {"law": "newtonian", "failed": f"{PATH}: unstable at frame 4"},
            {"law": "herschel_bulkley", "left": True, "reason": f"{PATH} is far too high",
             "held_out_mm": 0.001234, "probability": 0.0}]
        found["fit"].update(converged=False, reason=f"{PATH} still moves")
        found["fit"]["like"] = {"Cube": {
            "law": "von_mises", "distance": 0.034, "sentence": f"Most like von Mises: {PATH} = 2e+05 Pa.",
            "others": [{"law": "drucker_prager", "distance": 0.12}]}}
        files.write_json(os.path.join(self.run_folder, "result.json"), found)
        self.check("Not converged: Young's Modulus still moves", "Young's Modulus: unstable",
                   "Young's Modulus is far too high", "Young's Modulus = 2e+05")

    def test_a_cancelled_fit(self):
        self.cancelled(lambda: fake_fit.write_cancelled(self.run_folder))
        self.check("Cancelled: the best so far.")

    def test_a_diagnosis(self):
        self.fitted()
        causes = [
            cause("drag_quadratic", {"drag_coefficient": number(0.47, "", 0.012)},
                  sentence=f"{PATH} is 0.3 Pa higher.", evidence=f"{PATH} and captures.clip disagree.",
                  where=PATH),
            cause("gravity_direction", {"tilt[0]": number(-0.00001, "rad", 0.0123),
                                        "tilt[1]": number(12345.6, "rad", 12.3)}, 0.02, accepted=False,
                  gain=-0.004, gain_interval=[-0.004, 0.85]),
            cause("attached_mass", {"mass": number(0.004, "kg", 0.001)}, 0.002, accepted=False,
                  gain=None, gain_interval=None)]
        fake_diagnosis.write(self.run_folder, causes, sentence=f"{PATH} is wrong.",
                             next_recording=f"Move it so that {PATH} shows.",
                             statements=[f"{PATH} was held."])
        for index in range(len(causes)):
            self.settings.diagnosis.cause_index = index
            self.check("Young's Modulus is wrong.", "Young's Modulus was held.",
                       "so that Young's Modulus shows", "Gain 0 %", "tilt X: 0.000 ± 0.012 rad")
        self.settings.diagnosis.cause_index = 0
        self.check("Young's Modulus is 0.3 Pa higher.", "Where: Young's Modulus",
                   "Young's Modulus and 'clip' disagree.")

    def test_a_check(self):
        self.fit.check = check.stored(
            fake_check.result(record_instead=f"Press it, so that {PATH} shows.", notes=NOTES),
            check.asked(self.scene))
        self.check("so that Young's Modulus shows", "points lie up to 2 m off 'Cube' at rest")
