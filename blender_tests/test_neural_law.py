# SPDX-License-Identifier: GPL-3.0-or-later
"""The isotropic neural law in the panel: weights, numbers, document, presets, rows of a fit."""

from matterfit import laws
from matterfit.io import fit_rows, material_check, material_values
from support import SceneCase


class NeuralLawTest(SceneCase):
    def setUp(self):
        super().setUp()
        self.row = self.body(self.cube(size=0.2))
        self.row.material.law = "NEURAL_ISOTROPIC"

    def written(self):
        return self.document()[0]["scene"]["bodies"][0]["material"]

    def test_weights_fill_in_their_numbers(self):
        self.row.material.weights = "SAND"
        written = self.written()
        self.assertEqual((written["law"], written["weights"]), ("neural_isotropic", "sand"))
        self.assertEqual(set(written) - {"law", "weights", *laws.DAMPING},
                         set(laws.PARAMETERS["NEURAL_ISOTROPIC"]))
        self.assertEqual((written["E"], written["tear_strain"]), (1e6, 0.0))
        self.assertTrue(laws.material_flows(self.row.material))
        self.row.material.weights = "JELLY"
        self.assertEqual(self.written()["yield_strain"], 1000.0)
        self.assertFalse(laws.material_flows(self.row.material))

    def test_a_file_of_weights(self):
        self.row.material.weights = "FILE"
        self.row.material.weights_file = "/data/mine.safetensors"
        self.assertEqual(self.written()["weights"], "/data/mine.safetensors")

    def test_a_fitted_material_comes_back(self):
        material = self.row.material
        material.weights, material.form_1, material.yield_strain = "PLASTICINE", 0.25, 0.03
        saved = {"schema": material_check.SCHEMA, "name": "x", "source": "a fit", "density": 900.0,
                 "material": self.written()}
        material_check.check(saved, "x.json")
        material.weights = "WATER"
        material_values.fill(material, saved["material"])
        self.assertEqual(material.weights, "PLASTICINE")
        self.assertAlmostEqual(material.form_1, 0.25, places=6)
        self.assertAlmostEqual(material.yield_strain, 0.03, places=6)

    def test_a_fit_begins_with_few_of_its_numbers(self):
        keys = {quantity.key for owner, quantity in fit_rows.candidates(self.settings)
                if owner == self.row.name}
        self.assertLessEqual({"material.form_4", "material.flow_rate"}, keys)
        self.assertNotIn("material.yield_stress", keys)
