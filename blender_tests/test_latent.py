# SPDX-License-Identifier: GPL-3.0-or-later
"""The law without a class in the panel: document, presets, old files, rows of a fit, its result."""

import json
import os

import bpy
import fake_fit
from fake_check import parameter
from matterfit import laws, library, native, quantities
from matterfit.io import check, files, fit_results, fit_rows, material_check, material_values, presets, words
from matterfit.jobs import JobError
from matterfit.ui import bodies as bodies_panel
from matterfit.ui import fit_result as result_panel
from panel_recorder import _stand_in
from support import SceneCase, needs_library
from test_diagnose import Recorder
from test_fit import FakeFitCase
from test_fit_document import FitCase

CODE = [0.5, -1.25, 0.0, 2.0, -0.125, 0.75, 1.0, -3.5]
SENTENCE = ("Most like von Mises: τ = 2μ ε + λ tr ε I, |dev τ| ≤ √(2/3) τ_Y with E = 2e+05 Pa, ν = 0.3. "
            "Its stress differs by 3.4 % in the mean up to strains of 0.2.")
UNSURE = " What the recording excites is not known."


def like(law="von_mises"):
    return {"law": law, "parameters": {"E": 2e5}, "distance": 0.034, "flow_distance": None,
            "sentence": SENTENCE, "over": {},
            "others": [{"law": "herschel_bulkley", "distance": 0.05, "flow_distance": None},
                       {"law": "neo_hookean", "distance": 3.0, "flow_distance": None}]}


def texts(panel):
    recorder = Recorder()
    panel.draw(_stand_in(panel, recorder), bpy.context)
    return " ".join(item for item in recorder.drawn if isinstance(item, str))


class DocumentTest(SceneCase):
    def setUp(self):
        super().setUp()
        self.row = self.body(self.cube(size=0.2))
        self.row.material.law = "LATENT"
        self.row.material.damping_shear = 0.0  # of the preset that it began with

    def written(self):
        return self.document()[0]["scene"]["bodies"][0]["material"]

    def test_until_a_fit_has_told(self):
        self.assertEqual(self.written(), {"law": "latent", "weights": "latent", "E": 100000})

    def test_with_its_numbers(self):
        self.row.material.latent, self.row.material.use_latent = CODE, True
        self.assertEqual(self.written()["latent"], CODE)
        self.save("again.blend")
        self.reopen("again.blend")
        self.assertEqual(self.written()["latent"], CODE)

    def test_a_material_comes_back(self):
        material = self.row.material
        saved = {"schema": material_check.SCHEMA, "name": "x", "source": "a fit", "density": 900.0,
                 "provenance": {"like": {"law": "newtonian", "distance": 0.1}},
                 "material": {"law": "latent", "weights": "latent", "E": 3e4, "latent": CODE}}
        material_check.check(saved, "x.json")
        material_values.fill(material, saved["material"], presets.like_of(saved))
        self.assertEqual(self.written(), {**saved["material"], "E": 30000})
        self.assertTrue(laws.material_flows(material))
        self.assertFalse(material_values.differ(material, saved["material"]))
        material.latent[7] = 0.0
        self.assertTrue(material_values.differ(material, saved["material"]))
        without = {"law": "latent", "E": 3e4, "weights": "/mine.safetensors"}
        material_values.fill(material, without)
        self.assertEqual(self.written(), {**without, "E": 30000})
        self.assertFalse(laws.material_flows(material))

    def test_a_wrong_code_is_named(self):
        saved = {"schema": material_check.SCHEMA, "name": "x", "source": "a fit", "density": 900.0,
                 "material": {"law": "latent", "E": 3e4, "latent": CODE[:3]}}
        for code, message in ((CODE[:3], "'latent' is not a list of 8 numbers"),
                              ([*CODE[:7], "1"], "latent is '1'")):
            saved["material"]["latent"] = code
            with self.assertRaisesRegex(JobError, message):
                material_check.check(saved, "x.json")

    def test_its_mesh_goes_where_it_pours(self):
        self.settings.output.mesh = True
        self.assertIn("mesh", self.document()[0]["output"])
        self.row.material.pours = True
        self.assertNotIn("mesh", self.document()[0]["output"])

    def test_its_numbers_are_folded(self):
        self.assertIn("Not known yet", texts(bodies_panel.MATTERFIT_PT_bodies))
        self.row.material.use_latent, self.row.material.source = True, SENTENCE
        self.assertIn("Most like von Mises", texts(bodies_panel.MATTERFIT_PT_bodies))

    @needs_library
    def test_the_library_reads_it(self):
        for known in (False, True):
            self.row.material.use_latent = known
            document, folder = self.document()
            native.validate(json.dumps(document), folder)


class TableTest(SceneCase):
    """The add-on's tables of laws and quantities are those of the library."""

    def test_a_saved_file_keeps_its_law(self):
        """Files hold the number of a law: new ones come last."""
        self.assertEqual([law[0] for law in laws.LAWS], [
            "FIXED_COROTATED", "NEO_HOOKEAN", "STVK_HENCKY", "VON_MISES", "HERSCHEL_BULKLEY",
            "DRUCKER_PRAGER", "NEWTONIAN", "NEURAL_ISOTROPIC", "LATENT", "NEURAL"])

    def test_every_law_has_its_numbers(self):
        self.assertEqual(list(laws.PARAMETERS), [law[0] for law in laws.LAWS])
        for names in laws.PARAMETERS.values():
            for name in names:
                self.assertIsNotNone(quantities.material(name), name)

    def test_every_start_has_its_numbers(self):
        self.assertEqual([start[0] for start in laws.STARTS], [*laws.START_NUMBERS, "FILE"])

    @needs_library
    def test_same_as_the_library(self):
        native.require()
        self.assertEqual(library._TABLES, native._json_call(native._library.mf_quantities),
                         "python scripts/addon_tables.py writes what the library says now")


class FitRowTest(FitCase):
    def setUp(self):
        super().setUp()
        self.material = self.settings.bodies[0].material
        self.material.law = "LATENT"

    def paths(self):
        return [entry if isinstance(entry, str) else entry["path"]
                for entry in self.written()["parameters"]]

    def test_one_row_for_its_numbers(self):
        keys = [row.key for row in self.fit.parameters if row.owner == "Cube" and row.enabled]
        self.assertEqual(keys, ["material.E", "material.latent", "velocity", "spin"])
        self.assertEqual(self.paths()[:9], ["bodies.Cube.material.E"] + [
            f"bodies.Cube.material.latent[{index}]" for index in range(8)])
        self.row("material.latent").enabled = False
        self.assertEqual(self.paths()[:2], ["bodies.Cube.material.E", "bodies.Cube.velocity"])

    def test_the_row_has_no_values_of_its_own(self):
        row = self.row("material.latent")
        row.use_prior = row.use_bounds = row.use_start = True
        self.assertIn("bodies.Cube.material.latent[7]", self.written()["parameters"])

    def test_unknown_whatever_the_body_is(self):
        """The stiffness is looked for under the name that this law has for it."""
        self.fit.law = "UNKNOWN"
        for preset in ("JELLY", "WATER"):
            self.material.preset = preset
            self.assertEqual(self.written()["laws"], ["latent"])
            self.assertEqual(self.paths(), ["bodies.Cube.material.E", "bodies.Cube.velocity",
                                            "bodies.Cube.spin"])

    def test_among_the_candidates(self):
        self.material.law = "NEO_HOOKEAN"
        self.fit.law = "FIND"
        self.assertEqual(self.written()["laws"], "all")
        self.fit.laws = {"NEO_HOOKEAN", "LATENT"}
        self.assertEqual(self.written()["laws"], ["neo_hookean", "latent"])
        self.assertNotIn("bodies.Cube.material.latent[0]", self.paths())

    def test_not_among_what_a_batch_varies(self):
        from matterfit.io import batch
        keys = [key for _owner, key, _label in batch.candidates(self.settings)]
        self.assertIn("material.E", keys)
        self.assertFalse([key for key in keys if key.startswith("material.latent")])

    def test_steps_with_all_weights(self):
        self.fit.weight_steps = 12
        self.assertNotIn("weights", self.written())
        self.material.law = "NEURAL_ISOTROPIC"
        self.assertEqual(self.written()["weights"], 12)

    @needs_library
    def test_the_library_reads_it(self):
        for law in ("BODY", "FIND", "UNKNOWN"):
            for preset in ("JELLY", "WATER", ""):
                if preset:
                    self.material.preset = preset
                else:
                    self.material.law = "LATENT"
                fit_rows.refresh(self.settings)
                self.fit.law = law
                with self.subTest(law=law, preset=preset):
                    document, folder = self.document("fit")
                    native.validate(json.dumps(document), folder)


class ResultTest(FakeFitCase):
    def found(self, law="von_mises", told=5, more=""):
        """A fit without a class."""
        self.fit.law = "UNKNOWN"
        extra = [fake_fit.estimate(f"bodies.Cube.material.latent[{index}]", "", 0.0, CODE[index],
                                   0.1, observable=index < told) for index in range(8)]
        self.fitted(law={"law": "latent", "weights": "latent", "E": 2e5, "latent": CODE},
                    extra=extra)
        path = os.path.join(self.run_folder, "result.json")
        document = files.read_json(path)
        document["fit"]["like"] = {"Cube": like(law)}
        document["fit"]["statements"] += [
            f"Cube: {SENTENCE}{more}",
            "bodies.Cube.material.latent[1] and bodies.Cube.material.latent[2] are alike.",
            "bodies.Cube.material.E and bodies.Cube.material.latent[2] are alike."]
        files.write_json(path, document)

    def test_what_it_is_like_stands_in_the_result(self):
        self.found(more=UNSURE)
        said = texts(result_panel.MATTERFIT_PT_fit_result)
        self.assertIn("Most like von Mises", said)
        self.assertIn("τ_Y with E = 2e+05 Pa", said)
        self.assertIn("Then: Herschel-Bulkley 5 %, Neo-Hookean > 100 %", said)
        self.assertEqual(said.count("differs by 3.4 %"), 1)
        self.assertIn(UNSURE.strip(), said)

    def test_how_sure_the_prediction_is(self):
        self.found()
        self.assertNotIn("Predicted to", texts(result_panel.MATTERFIT_PT_fit_result))
        path = os.path.join(self.run_folder, "result.json")
        document = files.read_json(path)
        document["fit"]["predicted"] = {"half_width_mm": 1.234, "coverage": 0.956, "mean_mm": 2.0,
                                        "samples": 9, "draws": 16, "captures": []}
        files.write_json(path, document)
        said = " ".join(texts(result_panel.MATTERFIT_PT_fit_result).split())
        self.assertIn("Predicted to ± 1.2 mm (95 %); 96 % of what was held out lie within", said)

    def test_its_numbers_are_one_row(self):
        self.found()
        said = texts(result_panel.MATTERFIT_PT_fit_result)
        self.assertEqual(said.count("Kind of Material"), 2)
        self.assertIn("Young's Modulus and Kind of Material 3 are alike", " ".join(said.split()))
        self.assertIn("5 of 8 numbers are identified", said)
        result = fit_results.load(self.run_folder)
        self.assertEqual([len(estimates) for _owner, _label, estimates in
                          words.folded(self.settings, result.estimates)], [1, 1, 1, 1, 1, 8])

    def test_apply(self):
        self.found("newtonian")
        bpy.ops.matterfit.apply_fit()
        material = self.settings.bodies[0].material
        self.assertEqual((material.law, material.E, material.use_latent), ("LATENT", 2e5, True))
        self.assertEqual(list(material.latent), CODE)
        self.assertTrue(material.pours)
        self.assertIn("Most like von Mises", material.source)
        written = self.document()[0]["scene"]["bodies"][0]["material"]
        self.assertEqual((written["E"], written["latent"]), (200000, CODE))

    def test_saved_loaded_and_kept(self):
        self.found("newtonian")
        path = os.path.join(self.folder, "found.json")
        bpy.ops.matterfit.save_material(filepath=path)
        bpy.ops.matterfit.add_preset(name="Found")
        material = self.settings.bodies[0].material
        bpy.ops.matterfit.load_material(filepath=path)
        self.assertEqual((list(material.latent), material.pours), (CODE, True))
        self.assertIn("Most like von Mises", material.source)
        material.preset = "JELLY"
        material.preset = "USER_FOUND"
        self.assertEqual((material.law, list(material.latent), material.pours),
                         ("LATENT", CODE, True))
        self.assertFalse(presets.differs(material))

    def test_weights_of_a_fit_outlive_its_cache(self):
        name = "weights_Cube.safetensors"
        self.fitted(law={"law": "neural_isotropic", "weights": name, "E": 2e5, "nu": 0.3})
        weights = os.path.join(self.run_folder, name)
        files.write_bytes(weights, b"weights")
        path = os.path.join(self.folder, "neural.json")
        bpy.ops.matterfit.save_material(filepath=path)
        bpy.ops.matterfit.add_preset(name="Neural")
        bpy.ops.matterfit.apply_fit()
        os.remove(weights)
        material = self.settings.bodies[0].material
        self.assertTrue(material.weights_file.startswith("//matterfit_weights_"))
        for _again in range(3):
            self.assertEqual(material.weights, "FILE")
            with open(material_values.weights_of(material), "rb") as stream:
                self.assertEqual(stream.read(), b"weights")
            if _again == 0:
                bpy.ops.matterfit.load_material(filepath=path)
            else:
                material.preset = "USER_NEURAL"
        self.assertEqual(files.read_json(path)["material"]["weights"], "neural.safetensors")
        bpy.ops.matterfit.remove_preset()
        self.assertEqual(os.listdir(os.path.join(self.folder, "presets")), [])

    def test_a_check_shows_one_row_or_two(self):
        self.settings.bodies[0].material.law = "LATENT"
        rows = [parameter(f"bodies.Cube.material.latent[{index}]", 0.0, 0.1, known=index < 5)
                for index in range(8)]
        report = check.Report(parameters=tuple(map(check._parameter, rows)), ties=(), enough=(),
                              record_instead="", sigma=None, notes=(), asked={})
        self.assertEqual([label for _parameter, label in check.rows(self.settings, report)],
                         ["Kind of Material: 5 of 8", "Kind of Material: 3 of 8"])

    def test_words_of_a_number(self):
        self.assertEqual(words.in_panel("scene.bodies[0].material.latent[3] is 9.", self.settings),
                         "'Cube', Kind of Material 4 is 9.")
