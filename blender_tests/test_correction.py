# SPDX-License-Identifier: GPL-3.0-or-later
"""A correction beside a law in the panel: asked for in a fit, taken from it, kept in files."""

import json

import bpy
from matterfit import laws, native
from matterfit.io import material_check, material_values
from matterfit.jobs import JobError
from matterfit.ui import bodies as bodies_panel
from matterfit.ui import fit as fit_panel
from panel_recorder import _stand_in
from support import SceneCase, needs_library
from test_diagnose import Recorder
from test_fit_document import FitCase


class Properties(Recorder):
    """Keeps the name of every property that is drawn."""

    def _part(self, across, shrink=0.0, heading=""):
        return Properties(across=across, drawn=self.drawn)

    def prop(self, owner, name, *arguments, **options):
        self.drawn.append(name)
        super().prop(owner, name, *arguments, **options)


def properties(panel):
    recorder = Properties()
    panel.draw(_stand_in(panel, recorder), bpy.context)
    return recorder.drawn


NUMBERS = [0.25, -0.125, 0.0, 0.5, 2.0]


class MaterialTest(SceneCase):
    def setUp(self):
        super().setUp()
        self.row = self.body(self.cube(size=0.2))
        self.row.material.law = "NEO_HOOKEAN"

    def written(self):
        return self.document()[0]["scene"]["bodies"][0]["material"]

    def test_none_is_not_written(self):
        self.assertNotIn("correction", self.written())
        self.assertNotIn("show_correction", properties(bodies_panel.MATTERFIT_PT_bodies))

    def test_it_comes_back(self):
        material = self.row.material
        plain = self.written()
        saved = {"schema": material_check.SCHEMA, "name": "x", "source": "a fit", "density": 900.0,
                 "material": {**plain, "correction": NUMBERS}}
        material_check.check(saved, "x.json")
        self.assertTrue(material_values.differ(material, saved["material"]))
        material_values.fill(material, saved["material"])
        self.assertFalse(material_values.differ(material, saved["material"]))
        self.assertEqual(self.written(), saved["material"])
        self.save("again.blend")
        self.reopen("again.blend")
        self.assertEqual(self.written()["correction"], NUMBERS)
        material_values.fill(self.settings.bodies[0].material, plain)
        self.assertEqual(self.written(), plain)

    def test_its_numbers_are_shown_where_there_are_some(self):
        self.row.material.correction = NUMBERS
        self.assertIn("show_correction", properties(bodies_panel.MATTERFIT_PT_bodies))

    def test_a_wrong_one_is_named(self):
        saved = {"schema": material_check.SCHEMA, "name": "x", "source": "a fit", "density": 900.0,
                 "material": {**self.written(), "correction": NUMBERS[:4]}}
        with self.assertRaisesRegex(JobError, "'correction' is not a list of 5 numbers"):
            material_check.check(saved, "x.json")

    @needs_library
    def test_the_library_reads_it(self):
        for law, _label, _about in laws.CANDIDATES:  # the published one takes a file
            self.row.material.law = law
            self.row.material.correction = NUMBERS
            document, folder = self.document()
            with self.subTest(law=law):
                native.validate(json.dumps(document), folder)


class FitTest(FitCase):
    def written(self):
        return self.document("fit")[0]["fit"]

    def test_steps(self):
        self.assertNotIn("correction", self.written())
        self.fit.correction_steps = 8
        self.assertEqual(self.written()["correction"], 8)

    def test_not_together_with_all_weights(self):
        self.fit.correction_steps = 8
        self.fit.weight_steps = 4
        self.assertEqual(self.written()["correction"], 8)
        self.settings.bodies[0].material.law = "NEURAL_ISOTROPIC"
        written = self.written()
        self.assertEqual(written["weights"], 4)
        self.assertNotIn("correction", written)
        self.assertNotIn("correction_steps", properties(fit_panel.MATTERFIT_PT_fit_advanced))
        self.fit.weight_steps = 0
        self.assertIn("correction_steps", properties(fit_panel.MATTERFIT_PT_fit_advanced))
