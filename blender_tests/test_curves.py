# SPDX-License-Identifier: GPL-3.0-or-later
"""Stress curves in the viewport, and what a material was seen at when it was fitted."""

import json
import os

import bpy
from matterfit import native
from matterfit.io import files, material_check, material_values
from matterfit.jobs import JobError
from matterfit.ui import curves_overlay
from support import SceneCase, needs_library
from test_fit import FakeFitCase
from test_latent import like

SEEN = {"strain": 0.25, "compression": 0.0625, "expansion": 0.03125, "rates": [0.5, 8.0]}
NEO = {"law": "neo_hookean", "E": 1e5, "nu": 0.3}


class SeenTest(SceneCase):
    def setUp(self):
        super().setUp()
        self.row = self.body(self.cube(size=0.2))

    def written(self):
        return self.document()[0]["scene"]["bodies"][0]

    def test_it_goes_with_a_fitted_material(self):
        self.assertNotIn("excited", self.written())
        material_values.fill(self.row.material, NEO, seen=SEEN)
        self.assertEqual(self.written()["excited"], SEEN)
        self.save("again.blend")
        self.reopen("again.blend")
        self.assertEqual(self.written()["excited"], SEEN)

    def test_another_law_was_not_seen(self):
        material_values.fill(self.row.material, NEO, seen=SEEN)
        self.row.material.law = "STVK_HENCKY"
        self.assertNotIn("excited", self.written())
        material_values.fill(self.row.material, NEO, seen=SEEN)
        self.row.material.preset = "JELLY"
        self.assertNotIn("excited", self.written())

    def test_a_wrong_one_is_named(self):
        saved = {"schema": material_check.SCHEMA, "name": "x", "source": "a fit", "density": 900.0,
                 "material": NEO, "excited": SEEN}
        material_check.check(saved, "x.json")
        for wrong in ({**SEEN, "rates": [1.0]}, {**SEEN, "strain": "1"}, {"strain": 0.1}, [0.1]):
            with self.assertRaisesRegex(JobError, "x.json: 'excited'"):
                material_check.check({**saved, "excited": wrong}, "x.json")

    @needs_library
    def test_the_library_reads_it(self):
        material_values.fill(self.row.material, NEO, seen=SEEN)
        document, folder = self.document()
        read = native.validate(json.dumps(document), folder)
        self.assertEqual(read["scene"]["bodies"][0]["excited"], SEEN)


class CurvesTest(FakeFitCase):
    def setUp(self):
        super().setUp()
        curves_overlay.forget()

    def test_nothing_is_drawn_unasked(self):
        self.assertIsNone(curves_overlay.of_body(self.settings))
        self.fitted(law=NEO)
        self.assertIsNone(curves_overlay.of_fit(self.settings))

    @needs_library
    def test_of_the_active_body(self):
        self.settings.show_curves = True
        self.settings.body_index = 0
        material = self.settings.bodies[0].material
        material_values.fill(material, NEO, seen=SEEN)
        found = curves_overlay.of_body(self.settings)
        self.assertEqual([line.label for line in found.lines], ["Neo-Hookean"])
        self.assertEqual(found.strain, SEEN["strain"])
        pulled = found.lines[0].curve["uniaxial"]
        begin, end = curves_overlay.seen("uniaxial", found.strain)
        self.assertLess(pulled["stretch"][0], begin)
        self.assertGreater(pulled["stretch"][-1], end)
        self.assertAlmostEqual(begin * end, 1.0)
        material.correction = (0.0, 0.5, 0.0, 0.0, 0.0)
        self.assertEqual(len(curves_overlay.of_body(self.settings).lines), 2)

    @needs_library
    def test_of_a_fit_with_the_nearest_law(self):
        self.fitted(law={"law": "latent", "weights": "latent", "E": 2e5, "latent": [0.0] * 8})
        path = os.path.join(self.run_folder, "result.json")
        document = files.read_json(path)
        document["fit"]["like"] = {"Cube": {**like(), "parameters": {
            "E": 2e5, "nu": 0.3, "yield_stress": 3e3}}}
        files.write_json(path, document)
        self.fit.show_curves = True
        found = curves_overlay.of_fit(self.settings)
        self.assertEqual([line.label for line in found.lines], ["Neural (latent)", "von Mises"])
        self.assertEqual(found.title, "Cube")
        ours, nearest = (line.curve["uniaxial"] for line in found.lines)
        self.assertEqual(ours["stretch"], nearest["stretch"])

    @needs_library
    def test_a_fit_hands_on_what_it_was_seen_at(self):
        self.fitted(law=NEO, change=lambda scene: scene["bodies"][0].update(excited=SEEN))
        bpy.ops.matterfit.apply_fit()
        self.assertEqual(material_values.excited(self.settings.bodies[0].material), SEEN)

    def test_without_a_library_nothing_is_shown(self):
        def fails(*_arguments, **_options):
            raise JobError("no library")

        self.settings.show_curves = True
        real, native.curves = native.curves, fails
        try:
            self.assertIsNone(curves_overlay.of_body(self.settings))
        finally:
            native.curves = real

    def test_a_stress_has_its_unit(self):
        self.assertEqual([curves_overlay.stress_text(stress) for stress in (2.0, 1500.0, 2.5e6, 3e9)],
                         ["2 Pa", "1.5 kPa", "2.5 MPa", "3 GPa"])
