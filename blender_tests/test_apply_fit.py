# SPDX-License-Identifier: GPL-3.0-or-later
"""Apply, Save Material, presets of one's own."""

import os
from unittest import mock

import bpy
import fake_fit
import numpy
from mathutils import Quaternion
from matterfit.io import files, fit_results, presets
from test_fit import FakeFitCase


class ApplyTest(FakeFitCase):
    def test_material_and_velocity(self):
        self.fitted()
        self.settings.bodies[0].density = 777.0
        bpy.ops.matterfit.apply_fit()
        body = self.settings.bodies[0]
        self.assertAlmostEqual(body.material.E, fake_fit.E, delta=1.0)
        self.assertEqual(tuple(body.velocity), (1.0, 2.0, 3.0))
        self.assertEqual(body.material.preset, "CUSTOM")
        self.assertIn("held-out error 0.75 mm", body.material.source)
        self.assertEqual(body.density, 777.0, "what was not fitted stays")

    def test_another_law(self):
        """The whole material of the law that was found."""
        self.fit.law = "FIND"
        self.fitted(law={"law": "von_mises", "E": 2e5, "nu": 0.3, "yield_stress": 4e3,
                         "damping_shear": 5.0, "maxwell": [{"modulus": 3e3, "time": 0.2}]})
        self.assertEqual(len(fit_results.load(self.run_folder).models), 2)
        bpy.ops.matterfit.apply_fit()
        material = self.settings.bodies[0].material
        self.assertEqual((material.law, material.yield_stress, material.damping_shear),
                         ("VON_MISES", 4e3, 5.0))
        self.assertEqual(len(material.maxwell), 1)
        self.assertAlmostEqual(material.maxwell[0].time, 0.2, places=6)
        self.assertIn("material.maxwell[0].time", [row.key for row in self.fit.parameters])

    def test_what_pours_is_as_fine_as_it_was_fitted(self):
        """A fit that finds a liquid leaves the separation, so that Compare repeats its error."""
        self.fit.law = "FIND"
        self.fitted(law={"law": "newtonian", "bulk_modulus": 2e5, "viscosity": 3.0})
        solver = self.settings.solver
        before = (solver.quality, solver.particle_separation)
        bpy.ops.matterfit.apply_fit()
        self.assertEqual(self.settings.bodies[0].material.law, "NEWTONIAN")
        self.assertEqual((solver.quality, solver.particle_separation), before)
        self.assertTrue(solver.for_flows)

    def test_the_throw_of_the_take(self):
        """A velocity that came from a throw goes back to it."""
        bpy.ops.matterfit.add_take()
        self.settings.body_index = 0
        bpy.ops.matterfit.add_throw()
        self.fitted()
        bpy.ops.matterfit.add_take()
        self.settings.takes[1].throws.clear()
        bpy.ops.matterfit.apply_fit()
        throw = self.settings.takes[0].throws[0]
        self.assertEqual((throw.velocity_from, tuple(throw.velocity)), ("VALUE", (1.0, 2.0, 3.0)))
        self.assertEqual(tuple(self.settings.bodies[0].velocity), (0.0, 0.0, 0.0))

    def test_a_throw_of_a_body_from_a_file(self):
        """What the file's own axes are turned by is no part of the throw."""
        bpy.ops.matterfit.add_take()
        self.settings.body_index = 0
        bpy.ops.matterfit.add_throw()
        throw = self.settings.takes[0].throws[0]
        throw.use_placement = True

        def change(scene):
            # Turned by half a right angle about z, after −y to z.
            turn = Quaternion((0.0, 0.0, 1.0), 0.25 * numpy.pi) @ Quaternion((1.0, 0.0, 0.0), -0.5 * numpy.pi)
            scene["bodies"][0]["placement"] = {"position": [1.0, 2.0, 3.0], "rotation": list(turn)}

        self.fitted(change=change, extra=[
            fake_fit.estimate("bodies.Cube.placement.rotation[2]", "", 0.0, 0.25 * numpy.pi, 0.1)])
        self.settings.bodies[0].source, self.settings.bodies[0].file_up = "GAUSSIANS", "-Y"
        bpy.ops.matterfit.apply_fit()
        numpy.testing.assert_allclose(throw.location, (1.0, 2.0, 3.0), atol=1e-6)
        numpy.testing.assert_allclose(throw.rotation, (0.0, 0.0, 0.25 * numpy.pi), atol=1e-6)

    def test_everything_else(self):
        """Placement, gravity, ground, a collider, in Blender's units."""
        self.scene.unit_settings.scale_length = 0.5
        self.body(self.cube("Ball", location=(2, 0, 0)), role="COLLIDER")
        item = bpy.data.objects["Cube"]
        item.scale = (1.0, 2.0, 1.0)
        bpy.context.view_layer.update()

        def change(scene):
            scene["bodies"][0]["density"] = 555.0
            scene["bodies"][0]["placement"] = {
                "position": [0.5, 0.0, 1.0], "rotation": [0.5**0.5, 0.0, 0.0, 0.5**0.5]}
            scene["gravity"] = [0.0, 0.0, -9.5]
            ground = next(item for item in scene["colliders"] if item["name"] == "ground")
            ground["height"] = 0.1
            ground["contact"]["mu"] = 0.7
            ball = next(item for item in scene["colliders"] if item["name"] == "Ball")
            ball["contact"]["stiffness"] = 3e6

        extra = [fake_fit.estimate(path, "", 0.0, 1.0, 0.1) for path in (
            "bodies.Cube.density", "bodies.Cube.placement.position[0]",
            "bodies.Cube.placement.rotation[2]", "gravity[2]", "colliders.ground.height",
            "colliders.ground.contact.mu", "colliders.Ball.contact.stiffness")]
        extra.append(fake_fit.estimate("captures.clip.start_frame", "frames", 1.0, 0.25, 0.1))
        self.fitted(change=change, extra=extra)
        bpy.ops.matterfit.apply_fit()
        bpy.context.view_layer.update()
        body = self.settings.bodies[0]
        solver = self.settings.solver
        self.assertEqual(body.density, 555.0)
        self.assertEqual(tuple(body.velocity), (2.0, 4.0, 6.0))
        numpy.testing.assert_allclose(item.matrix_world.translation, (1.0, 0.0, 2.0), atol=1e-6)
        numpy.testing.assert_allclose(item.rotation_euler, (0.0, 0.0, numpy.pi / 2), atol=1e-5)
        numpy.testing.assert_allclose(item.scale, (1.0, 2.0, 1.0), atol=1e-5)
        self.assertAlmostEqual(solver.gravity[2], -9.5, places=5)
        self.assertAlmostEqual(solver.ground_height, 0.2, places=6)
        self.assertAlmostEqual(solver.ground.mu, 0.7, places=6)
        ball = self.settings.bodies[1].contact
        self.assertEqual((ball.use_stiffness, ball.stiffness), (True, 3e6))
        self.assertEqual((self.capture.use_start_frame, self.capture.start_frame), (True, 0.25))

    def test_the_take_that_is_gone(self):
        """Not into the one that happens to be active."""
        self.fitted()
        self.settings.takes[0].name = "Other"
        self.fails(bpy.ops.matterfit.apply_fit, ["'Take 1'", "not among the Takes"])
        self.assertEqual(self.settings.bodies[0].material.E, 1e5)

    def test_a_body_that_is_gone(self):
        """Nothing is half applied."""
        self.fitted()
        self.settings.bodies[0].name = "Dough"
        self.fails(bpy.ops.matterfit.apply_fit, ["'Cube'", "not among the Bodies"])
        self.assertEqual(self.settings.bodies[0].material.E, 1e5)

    def test_a_collider_that_is_gone(self):
        """What was found of it goes neither onto the ground nor onto a body."""
        self.body(self.cube("Ball", location=(2, 0, 0)), role="COLLIDER")
        self.fitted(extra=[fake_fit.estimate("colliders.Ball.contact.mu", "", 0.4, 0.7, 0.1)])
        ground, ball = self.settings.solver.ground.mu, self.settings.bodies[1]
        ball.name = "Wall"
        self.fails(bpy.ops.matterfit.apply_fit, ["'Ball'", "not among the colliders"])
        ball.name, ball.role = "Ball", "BODY"
        self.fails(bpy.ops.matterfit.apply_fit, ["'Ball'", "not among the colliders"])
        self.settings.bodies[0].role = "COLLIDER"
        ball.role = "COLLIDER"
        self.fails(bpy.ops.matterfit.apply_fit, ["'Cube'", "not among the Bodies"])
        self.assertEqual(self.settings.solver.ground.mu, ground)
        self.assertEqual(self.settings.bodies[0].material.E, 1e5)

    def test_names_with_quotes(self):
        """In the words of the result."""
        self.settings.bodies[0].name = 'the "cube"'
        self.fitted()
        path = os.path.join(self.run_folder, "result.json")
        result = files.read_json(path)
        for entry in result["fit"]["parameters"]:
            entry["path"] = entry["path"].replace('the "cube"', "'the \"cube\"'")
        files.write_json(path, result)
        bpy.ops.matterfit.apply_fit()
        self.assertAlmostEqual(self.settings.bodies[0].material.E, fake_fit.E, delta=1.0)

    def test_a_capture_that_is_gone(self):
        self.fitted(extra=[fake_fit.estimate("captures.clip.start_frame", "frames", 1, 0.25, 0.1)])
        self.capture.name = "other"
        self.fails(bpy.ops.matterfit.apply_fit, ["'clip'", "not among the Captures"])
        self.assertEqual(self.settings.bodies[0].material.E, 1e5)

    def test_compare_is_out_of_date(self):
        self.fitted()
        self.settings.compare.done = True
        bpy.ops.matterfit.apply_fit()
        self.assertFalse(self.settings.compare.done)


class PresetTest(FakeFitCase):
    def test_save_and_load(self):
        self.fitted()
        path = os.path.join(self.folder, "dough")
        self.assertEqual(bpy.ops.matterfit.save_material(filepath=path), {"FINISHED"})
        document = files.read_json(path + ".json")
        self.assertEqual(document["name"], "dough")
        self.assertEqual(document["provenance"]["held_out"]["mean_mm"], 0.75)
        self.assertEqual(document["material"]["E"], fake_fit.E)
        self.body(self.cube("Other", location=(2, 0, 0)))
        self.assertEqual(bpy.ops.matterfit.load_material(filepath=path + ".json"), {"FINISHED"})
        self.assertAlmostEqual(self.settings.bodies[1].material.E, fake_fit.E, delta=1.0)
        self.assertIn("Fitted to", self.settings.bodies[1].material.source)

    def test_a_fit_that_is_no_result(self):
        """Whoever applies, saves, loads or keeps it is told."""
        words = "The search did not end at a minimum."
        self.fitted(warning=words)
        path = os.path.join(self.folder, "dough.json")
        for act in (bpy.ops.matterfit.apply_fit,
                    lambda: bpy.ops.matterfit.save_material(filepath=path),
                    lambda: bpy.ops.matterfit.load_material(filepath=path),
                    lambda: bpy.ops.matterfit.add_preset(name="doubtful")):
            bpy.context.window_manager.matterfit.last_report = ""
            self.assertEqual(act(), {"FINISHED"})
            self.assertIn(words, self.report())

    def test_another_bodys_material(self):
        """It was not fitted, and the files of an earlier fit are not looked at."""
        self.body(self.cube("Other", location=(2, 0, 0)))
        self.fitted()
        files.write_json(os.path.join(self.run_folder, "material_Other.json"),
                         files.read_json(os.path.join(self.run_folder, "material.json")))
        path = os.path.join(self.folder, "dough.json")
        self.settings.body_index = 1
        self.fails(bpy.ops.matterfit.save_material, ["material of 'Cube', not of 'Other'"],
                   filepath=path)
        self.fails(bpy.ops.matterfit.add_preset, ["material of 'Cube', not of 'Other'"], name="x")
        self.assertFalse(os.path.exists(path))
        self.settings.bodies[1].role = "COLLIDER"  # has none, so it says nothing
        self.assertEqual(bpy.ops.matterfit.save_material(filepath=path), {"FINISHED"})

    def test_of_two_bodies(self):
        """The file of the first has no name; that of the second has."""
        self.body(self.cube("Other", location=(2, 0, 0)))
        self.fitted(extra=[fake_fit.estimate("bodies.Other.material.E", "Pa", 1e5, 3e5, 1e3)])
        first = files.read_json(os.path.join(self.run_folder, "material.json"))
        files.write_json(os.path.join(self.run_folder, "material_Other.json"),
                         {**first, "material": {**first["material"], "E": 3e5}})
        path = os.path.join(self.folder, "dough.json")
        for index, value in enumerate((fake_fit.E, 3e5)):
            self.settings.body_index = index
            bpy.ops.matterfit.save_material(filepath=path)
            self.assertEqual(files.read_json(path)["material"]["E"], value)

    def test_load_refuses(self):
        path = os.path.join(self.folder, "bad.json")
        good = dict(presets.materials()["JELLY"])
        elastic = {"law": "neo_hookean", "E": 1e5, "nu": 0.3}
        for change, words in (
                ({"schema": "other/1"}, ["bad.json", "schema is 'other/1'"]),
                ({"material": {"law": "jam"}}, ["law is 'jam'"]),
                ({"material": {**elastic, "E": "stiff"}}, ["E is 'stiff'", "a number"]),
                ({"material": {**elastic, "maxwell": [{"modulus": 1}]}}, ["maxwell time is None"]),
                ({"material": {**elastic, "maxwell": 3}}, ["at most 6 branches"]),
                ({"material": {"law": "neo_hookean", "E": 1e5}}, ["'nu' is missing"]),
                ({"material": {**elastic, "law": "von_mises"}}, ["'yield_stress' is missing"]),
                ({"material": {"law": "newtonian", "viscosity": 1}}, ["'bulk_modulus' is missing"]),
                ({"material": {**elastic, "E": 0}}, ["E is 0", "above 0"]),
                ({"material": {**elastic, "damping_shear": -1}}, ["damping_shear is -1", "above 0"]),
                ({"density": 0.0}, ["density is 0.0", "above 0"]),
                ({"source": 3}, ["source is 3", "a text"]),
                ({"name": None}, ["name is None", "a text"])):
            files.write_json(path, {**good, **change})
            self.fails(bpy.ops.matterfit.load_material, words, filepath=path)
        files.write_json(path, [])
        self.fails(bpy.ops.matterfit.load_material, ["schema is None"], filepath=path)

    def test_a_preset_of_ones_own(self):
        """In the list, applied by its name, kept in saved files, removed again."""
        self.fitted()
        self.assertEqual(bpy.ops.matterfit.add_preset(name="Grandma's dough"), {"FINISHED"})
        items = {item[1]: item for item in presets.enum_items()}
        identifier, number = items["Grandma's dough"][0], items["Grandma's dough"][3]
        self.assertGreaterEqual(number, presets.USER_NUMBERS)
        self.assertLess(number, 2**31)
        body = self.settings.bodies[0]
        body.material.preset = identifier
        self.assertAlmostEqual(body.material.E, fake_fit.E, delta=1.0)
        self.assertFalse(presets.differs(body.material))
        self.save("scene.blend")
        self.reopen()
        body = self.settings.bodies[0]
        self.assertEqual(body.material.preset, identifier)
        self.fails(bpy.ops.matterfit.add_preset, ["there is one of this name"],
                   name="Grandma's dough")
        self.settings.body_index = 0
        self.assertEqual(bpy.ops.matterfit.remove_preset(), {"FINISHED"})
        self.assertEqual(body.material.preset, "CUSTOM")
        self.assertAlmostEqual(body.material.E, fake_fit.E, delta=1.0)
        self.assertFalse(bpy.ops.matterfit.remove_preset.poll())

    def test_one_that_cannot_be_deleted(self):
        """It stays, and so does the choice of it."""
        self.fitted()
        bpy.ops.matterfit.add_preset(name="mine")
        self.settings.body_index = 0
        body = self.settings.bodies[0]
        body.material.preset = "USER_MINE"
        with mock.patch.object(os, "remove", side_effect=PermissionError(13, "Permission denied")):
            self.fails(bpy.ops.matterfit.remove_preset, ["mine.json", "Permission denied"])
        self.assertEqual(body.material.preset, "USER_MINE")

    def test_a_preset_that_this_machine_lacks(self):
        """The values lie in the scene; nothing raises."""
        self.fitted()
        bpy.ops.matterfit.add_preset(name="mine")
        body = self.settings.bodies[0]
        body.material.preset = "USER_MINE"
        os.remove(os.path.join(presets.user_folder(), "mine.json"))
        presets.forget()
        self.assertFalse(presets.differs(body.material))
        self.assertFalse(presets.is_users(body.material.preset))
        self.assertAlmostEqual(body.material.E, fake_fit.E, delta=1.0)

    def test_a_damaged_one_is_left_out(self):
        files.write_bytes(os.path.join(presets.user_folder(), "broken.json"), b"{")
        presets.forget()
        self.assertIn("JELLY", presets.materials())
        self.assertNotIn("USER_BROKEN", presets.materials())
        self.assertIn("broken.json", presets.faults()[0])

    def test_no_name(self):
        self.fitted()
        self.fails(bpy.ops.matterfit.add_preset, ["no name is given"], name="  ")
