# SPDX-License-Identifier: GPL-3.0-or-later
"""The isotropic neural law in the panel: weights, numbers, document, presets, rows of a fit."""

import json
import os

from matterfit import laws, native
from matterfit.io import fit_rows, material_check, material_values
from matterfit.jobs import JobError
from support import SceneCase, needs_library


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


class PublishedLawTest(SceneCase):
    """Two networks, the library's or a file's: no numbers, and nothing that a fit could look for."""

    def setUp(self):
        super().setUp()
        self.row = self.body(self.cube(size=0.2))
        self.row.material.law = "NEURAL"

    def written(self):
        return self.document()[0]["scene"]["bodies"][0]["material"]

    def test_its_document_names_a_start_or_a_file(self):
        self.assertEqual(self.written()["weights"], "jelly")
        self.row.material.published_weights = "WATER"
        self.assertEqual(self.written()["weights"], "water")
        self.assertTrue(laws.material_flows(self.row.material))
        self.assertFalse(material_values.differ(self.row.material, self.written()))
        for file in ("/data/mine.safetensors", "/data/jelly_0300.pt"):
            self.row.material.published_file = file
            written = self.written()
            self.assertEqual((written["law"], written["weights"]), ("neural", file))
        self.assertEqual(self.row.material.published_weights, "FILE")
        self.row.material.property_unset("published_weights")  # as a scene of before has it
        self.assertEqual(self.written()["weights"], file)

    def test_a_saved_material_has_its_weights_beside_it(self):
        weights = os.path.join(self.folder, "theirs.pt")
        with open(weights, "wb") as stream:
            stream.write(b"weights")
        self.row.material.published_file = weights
        saved = {"schema": material_check.SCHEMA, "name": "x", "source": "NCLaw", "density": 900.0,
                 "material": self.written()}
        material_check.check(saved, "x.json")
        path = os.path.join(self.folder, "kept.json")
        beside = material_values.with_weights_beside(saved["material"], path)
        self.assertEqual(beside["weights"], "kept.pt")
        self.assertTrue(os.path.exists(os.path.join(self.folder, "kept.pt")))
        material_values.resolve(beside, self.folder)
        self.row.material.law = "NEO_HOOKEAN"
        material_values.fill(self.row.material, beside)
        self.assertEqual(self.row.material.law, "NEURAL")
        self.assertFalse(material_values.differ(self.row.material, beside))

    @needs_library
    def test_the_library_reads_its_file(self):
        """Nets of nothing but zeros are read whole, and found to hold no body together."""
        header, size = {}, 0
        for net in ("elastic", "plastic"):
            for layer, shape in enumerate(((64, 13), (64, 64), (9, 64))):
                end = size + 4 * shape[0] * shape[1]
                header[f"{net}.{layer}"] = {"dtype": "F32", "shape": shape,
                                            "data_offsets": (size, end)}
                size = end
        text = json.dumps(header).encode()
        text += b" " * (-len(text) % 8)
        path = os.path.join(self.folder, "none.safetensors")
        with open(path, "wb") as stream:
            stream.write(len(text).to_bytes(8, "little") + text + bytes(size))
        self.row.material.published_file = path
        document, folder = self.document()
        with self.assertRaisesRegex(JobError, "none.safetensors: these weights hold no body"):
            native.validate(json.dumps(document), folder)
        for start in laws.START_NUMBERS:
            self.row.material.published_weights = start
            document, folder = self.document()
            native.validate(json.dumps(document), folder)

    def test_no_candidate_of_a_fit(self):
        self.assertNotIn("NEURAL", self.settings.fit.laws)
        keys = {quantity.key for owner, quantity in fit_rows.candidates(self.settings)
                if owner == self.row.name}
        self.assertNotIn("material.E", keys)
