# SPDX-License-Identifier: GPL-3.0-or-later
"""Extend Model: what each cause becomes in the panel, and what was fitted beside it."""

import bpy
from fake_diagnosis import cause, number
from test_diagnose import DiagnoseCase


class ExtendTest(DiagnoseCase):
    def test_damping(self):
        found = cause("damping_shear", {"added": number(12.5, "Pa s", 0.5)})

        def change(scene):
            scene["bodies"][0]["material"]["damping_shear"] = 12.5

        self.extended(found, change=change)
        material = self.settings.bodies[0].material
        self.assertAlmostEqual(material.damping_shear, 12.5, places=4)
        bpy.ops.matterfit.extend_model()  # the value is the model's, not one more of it
        self.assertAlmostEqual(material.damping_shear, 12.5, places=4)
        written = self.document()[0]["scene"]["bodies"][0]["material"]
        self.assertEqual(written["damping_shear"], 12.5)

    def test_what_was_fitted_is_set_as_it_is_beside_the_cause(self):
        found = cause("damping_shear", {"added": number(12.5, "Pa s", 0.5)})

        def change(scene):
            scene["bodies"][0]["material"].update(damping_shear=12.5, E=2e5, damping_bulk=3.0)
            scene["bodies"][0]["velocity"] = [4.0, 5.0, 6.0]

        self.extended(found, change=change)
        body = self.settings.bodies[0]
        self.assertAlmostEqual(body.material.E, 2e5)
        self.assertEqual(tuple(body.velocity), (4.0, 5.0, 6.0))
        self.assertEqual(body.material.damping_bulk, 0.0)  # nobody asked for it

    def test_of_a_law_that_the_fit_found(self):
        law = {"law": "von_mises", "E": 3e5, "nu": 0.25, "yield_stress": 4e3}

        def change(scene):
            scene["bodies"][0]["material"] = {**law, "damping_shear": 2.0}

        self.extended(cause("damping_shear", {"added": number(2.0, "Pa s", 0.5)}), change=change)
        material = self.settings.bodies[0].material
        self.assertEqual((material.law, material.yield_stress, material.damping_shear), ("VON_MISES", 4e3, 2.0))

    def test_drag_quadratic(self):
        entry = {"effect": "drag_quadratic", "drag_coefficient": 0.47, "area": 0.04,
                 "air_density": 1.204}
        self.scene.unit_settings.scale_length = 0.5
        bpy.ops.matterfit.add_effect(kind="DRAG_QUADRATIC")
        off = self.settings.effects[0]
        off.name, off.enabled, off.area = "Mine", False, 7.0
        self.extended(self.DRAG, change=lambda scene: scene.update(effects=[entry]))
        bpy.ops.matterfit.extend_model()
        self.assertEqual(len(self.settings.effects), 2)
        off, row = self.settings.effects
        self.assertEqual((off.enabled, off.area), (False, 7.0))
        self.assertEqual(self.settings.effect_index, 1)
        self.assertEqual((row.kind, row.name, row.enabled), ("DRAG_QUADRATIC", "Air Drag", True))
        self.assertAlmostEqual(row.area, 0.16, places=5)  # units of half a metre
        self.assertEqual(self.document()[0]["scene"]["effects"], [{**entry, "name": "Air Drag"}])

    def test_every_other_effect(self):
        entries = [{"effect": "drag_linear", "rate": 0.7},
                   {"effect": "wind", "velocity": [1.0, 2.0, 0.0], "drag_coefficient": 0.5,
                    "area": 0.0, "air_density": 1.2},
                   {"effect": "buoyancy", "medium_density": 998.0, "added_mass": 0.5},
                   {"effect": "force_field", "center": [0.0, 1.0, 2.0], "radius": 3.0,
                    "acceleration": [0.0, 0.0, 4.0]},
                   {"effect": "frame_acceleration", "acceleration": [1.0, 0.0, 0.0],
                    "frequency": 2.0, "phase": 30.0}]
        self.diagnosed([cause(entry["effect"], {}) for entry in entries],
                       lambda scene: scene.update(effects=entries))
        for index in range(len(entries)):
            self.settings.diagnosis.cause_index = index
            self.assertEqual(bpy.ops.matterfit.extend_model(), {"FINISHED"}, self.error())
        written = self.document()[0]["scene"]["effects"]
        for entry, found in zip(entries, written, strict=True):
            self.assertEqual({key: found[key] for key in entry}, entry)

    def test_shaking_has_two_rows(self):
        entries = [{"effect": "frame_acceleration", "name": name, "acceleration": vector,
                    "frequency": 3.0, "phase": phase}
                   for name, vector, phase in (("shaking cosine", [1.0, 0.0, 0.5], 0.0),
                                               ("shaking sine", [0.0, 2.0, 0.0], -90.0))]
        self.extended(cause("frame_acceleration", {}),
                      change=lambda scene: scene.update(effects=entries))
        bpy.ops.matterfit.extend_model()
        written = self.document()[0]["scene"]["effects"]
        self.assertEqual(len(written), 2)
        for entry, found in zip(entries, written, strict=True):
            self.assertEqual({key: found[key] for key in entry if key != "name"},
                             {key: entry[key] for key in entry if key != "name"})

    def test_a_push_for_a_while_is_refused(self):
        keyed = {"frames": [0, 5, 9], "values": [[0, 0, 0], [0, 9, 0], [0, 0, 0]],
                 "interpolation": "step"}
        entry = {"effect": "force_field", "center": [0.0, 1.0, 2.0], "radius": 3.0,
                 "acceleration": keyed}
        self.diagnosed([cause("force_field", {})], lambda scene: scene.update(effects=[entry]))
        self.fails(bpy.ops.matterfit.extend_model, ["no setting in the panel", "extended.json"])
        self.assertEqual(len(self.settings.effects), 0)

    def test_gravity_and_motion(self):
        def change(scene):
            scene["gravity"] = [0.0, 0.0, -9.5]
            scene["bodies"][0]["velocity"] = [0.5, 0.0, 1.0]
            scene["bodies"][0]["spin"] = [0.0, 2.0, 0.0]

        causes = [cause(name, {}) for name in ("gravity_size", "velocity", "spin")]
        self.diagnosed(causes, change)
        self.assertAlmostEqual(self.settings.solver.gravity[2], -9.81, places=5)
        for index in range(3):
            self.settings.diagnosis.cause_index = index
            bpy.ops.matterfit.extend_model()
        self.assertAlmostEqual(self.settings.solver.gravity[2], -9.5, places=5)
        body = self.settings.bodies[0]
        self.assertEqual(tuple(body.velocity), (0.5, 0.0, 1.0))
        self.assertEqual(tuple(body.spin), (0.0, 2.0, 0.0))

    def test_contact(self):
        self.body(self.cube("Ball"), "COLLIDER").contact.mu = 0.25
        self.settings.solver.ground.mu = 0.5

        def change(scene):
            ground = next(item for item in scene["colliders"] if item["name"] == "ground")
            ground["contact"].update(mu=0.75, damping=0.125)

        self.diagnosed([cause("friction", {}), cause("restitution", {})], change)
        bpy.ops.matterfit.extend_model()
        ground = self.settings.solver.ground
        self.assertEqual((ground.mu, ground.use_damping), (0.75, False))
        self.assertEqual(self.settings.bodies[1].contact.mu, 0.25)
        self.settings.diagnosis.cause_index = 1
        bpy.ops.matterfit.extend_model()
        self.assertEqual((ground.use_damping, ground.damping), (True, 0.125))

    def test_another_kind_of_contact(self):
        self.settings.solver.ground.kind = "GLUE"

        def change(scene):
            ground = next(item for item in scene["colliders"] if item["name"] == "ground")
            ground["contact"] = {"kind": "friction", "mu": 0.125}

        self.extended(cause("contact_kind", {}), change=change)
        ground = self.settings.solver.ground
        self.assertEqual((ground.kind, ground.mu), ("FRICTION", 0.125))

    def test_the_law(self):
        """A body that yields has another law; what the scene states of it is a number of its own."""
        def change(scene):
            body = scene["bodies"][0]
            body["formulation"] = "total"
            body["material"] = {"law": "von_mises", "E": 2e4, "nu": 0.25, "yield_stress": 500.0}

        self.diagnosed([cause("yield", {}), cause("material.nu", {})], change)
        self.assertEqual(bpy.ops.matterfit.extend_model(), {"FINISHED"}, self.error())
        body = self.settings.bodies[0]
        self.assertEqual((body.material.law, body.formulation), ("VON_MISES", "TOTAL"))
        self.assertEqual(body.material.yield_stress, 500.0)
        body.material.nu = 0.4
        self.settings.diagnosis.cause_index = 1
        self.assertEqual(bpy.ops.matterfit.extend_model(), {"FINISHED"}, self.error())
        self.assertEqual(body.material.nu, 0.25)

    def test_a_correction_of_the_law(self):
        """A law that improves the extended model is a row of the table although nothing was accepted."""
        def change(model):
            model["bodies"][0]["material"]["correction"] = [0.1, -0.2, 0, 0, 0.3]
        law = {"score": 90.0, "p": 1e-3, "keep": 0.5, "observable": True, "refitted": True, "improves": True,
               "explained": 0.8, "gain": 0.6, "gain_interval": [0.4, 0.7],
               "parameters": {"correction[0]": number(0.1, "", 0.02)}, "sentence": "A law of another form."}
        self.diagnosed([], change, law=law, verdict="unknown")
        self.assertEqual(bpy.ops.matterfit.extend_model(), {"FINISHED"}, self.error())
        correction = self.settings.bodies[0].material.correction
        self.assertEqual([round(value, 6) for value in correction], [0.1, -0.2, 0, 0, 0.3])

    def test_what_one_recording_has_alone_is_refused(self):
        self.diagnosed([cause("attached_mass", {}, scope="capture second")],
                       lambda scene: scene["bodies"][0].update(masses=[]))
        self.fails(bpy.ops.matterfit.extend_model, ["in the recording 'second' alone", "extended.json"])

    def test_relaxation_and_mass(self):
        def change(scene):
            body = scene["bodies"][0]
            body["material"]["maxwell"] = [{"modulus": 4000.0, "time": 0.125}]
            body["masses"] = [{"position": [0.1, 0.0, 0.3], "mass": 0.052}]

        self.diagnosed([cause("relaxation", {}), cause("attached_mass", {})], change)
        for index in (0, 1, 0, 1):
            self.settings.diagnosis.cause_index = index
            self.assertEqual(bpy.ops.matterfit.extend_model(), {"FINISHED"}, self.error())
        body = self.settings.bodies[0]
        self.assertEqual([(branch.modulus, branch.time) for branch in body.material.maxwell],
                         [(4000.0, 0.125)])
        self.assertEqual(len(body.masses), 1)
        self.assertAlmostEqual(body.masses[0].mass, 0.052, places=6)
        self.assertAlmostEqual(body.masses[0].object.location.x, 0.1, places=6)

    def test_a_spectrum_of_relaxation(self):
        spectrum = [{"modulus": 4000.0, "time": 0.125 * 4.0 ** k} for k in range(4)]
        self.extended(cause("relaxation", {}),
                      change=lambda scene: scene["bodies"][0]["material"].update(maxwell=spectrum))
        bpy.ops.matterfit.extend_model()
        branches = self.settings.bodies[0].material.maxwell
        self.assertEqual([(branch.modulus, branch.time) for branch in branches],
                         [(branch["modulus"], branch["time"]) for branch in spectrum])

    def test_what_has_no_place_is_refused(self):
        for name in ("tracker_lag", "something_new"):
            self.diagnosed([cause(name, {"x": number(0.02)})], lambda scene: None)
            self.fails(bpy.ops.matterfit.extend_model, ["no setting in the panel", "extended.json"])
        self.assertEqual(len(self.settings.effects), 0)

    def test_what_was_not_accepted_is_refused(self):
        self.diagnosed([self.OTHER], model=None)
        self.fails(bpy.ops.matterfit.extend_model, ["was not accepted", "Why time offset"])

    def test_a_body_that_is_gone(self):
        self.diagnosed([cause("damping_bulk", {})], lambda scene: None)
        self.settings.bodies[0].name = "Renamed"
        self.fails(bpy.ops.matterfit.extend_model, ["'Cube'", "not among the Bodies"])

    def test_a_model_without_it(self):
        self.diagnosed([self.DRAG], lambda scene: None)
        self.fails(bpy.ops.matterfit.extend_model, ["diagnosis.json", "holds nothing of Air Drag"])
