# SPDX-License-Identifier: GPL-3.0-or-later
"""The Fit panel's settings as a job document, and the list of what can be fitted."""

import os

import bpy
import numpy
from matterfit import native, quantities
from matterfit.io import files, fit_rows, fit_values, job_fit, resolution
from matterfit.jobs import JobError
from matterfit.props import migration
from support import SceneCase, needs_library


class FitCase(SceneCase):
    """A jelly cube with a capture of its corners."""

    def setUp(self):
        super().setUp()
        self.jelly(location=(0.0, 0.0, 0.3))
        self.capture = self.recording("clip")

    def recording(self, name):
        corners = numpy.array([[x, y, z] for x in (-0.1, 0.1) for y in (-0.1, 0.1)
                               for z in (0.2, 0.4)])
        times = numpy.arange(6) / 24.0
        moved = corners[None] + times[:, None, None] * numpy.array([1.0, 0.0, 0.0])
        files.write_npz(os.path.join(self.folder, name + ".npz"),
                        {"positions": moved, "times": times})
        capture = self.settings.captures.add()
        capture.name, capture.filepath = name, f"//{name}.npz"
        return capture

    @property
    def fit(self):
        return self.settings.fit

    def row(self, key, owner="Cube"):
        return next(row for row in self.fit.parameters if (row.owner, row.key) == (owner, key))

    def only(self, *keys, owner="Cube"):
        """Switches these on, all others off."""
        for row in self.fit.parameters:
            row.enabled = (row.owner, row.key) in {(owner, key) for key in keys}

    def written(self):
        return self.document("fit")[0]["fit"]


class ListTest(FitCase):
    def keys(self, owner="Cube", enabled=None):
        return [row.key for row in self.fit.parameters
                if row.owner == owner and enabled in (None, row.enabled)]

    def test_of_a_body(self):
        """Law, damping, density, motion; gravity and the ground. On: the law and the throw."""
        self.assertEqual(self.keys(), [
            "material.E", "material.nu", "material.damping_shear", "material.damping_bulk",
            "density", "velocity", "spin", "placement.position", "placement.rotation"])
        self.assertEqual(self.keys(""), ["gravity"])
        self.assertEqual(self.keys("ground"), ["contact.mu", "contact.stiffness", "height"])
        self.assertEqual(self.keys(enabled=True),
                         ["material.E", "material.nu", "velocity", "spin"])
        self.assertEqual(self.keys("ground", enabled=True), [])
        fit_rows.refresh(self.settings)
        self.assertEqual(self.keys("clip"), ["start_frame"])
        self.assertEqual(self.keys("clip", enabled=True), [])

    def test_follows_the_scene(self):
        """Another law, another body, another collider; what was set stays."""
        row = self.row("material.E")
        row.use_bounds, row.low, row.high = True, 2e4, 3e6
        self.settings.bodies[0].material.preset = "PLASTICINE"
        self.assertEqual(self.keys()[:4], ["material.E", "material.nu", "material.yield_stress",
                                           "material.hardening"])
        row = self.row("material.E")
        self.assertEqual((row.use_bounds, row.low, row.high), (True, 2e4, 3e6))
        row = self.row("material.yield_stress")
        self.assertTrue(row.enabled)
        self.assertAlmostEqual(row.start, 6124.0, places=1)
        self.assertFalse(self.row("material.hardening").enabled)
        self.body(self.cube("Ball", location=(2, 0, 0)), role="COLLIDER")
        self.assertEqual(self.keys("Ball"), ["contact.mu", "contact.stiffness"])
        self.settings.bodies[1].contact.kind = "NO_SLIP"
        self.assertEqual(self.keys("Ball"), ["contact.stiffness"])
        bpy.ops.matterfit.remove_body()
        self.assertEqual(self.keys("Ball"), [])
        self.settings.solver.use_ground = False
        self.assertEqual(self.keys("ground"), [])

    def test_a_renamed_body_keeps_its_rows(self):
        self.row("density").enabled = True
        self.settings.bodies[0].name = "Dough"
        self.assertEqual(self.keys(), [])
        self.assertTrue(self.row("density", "Dough").enabled)

    def test_a_second_body_is_not_observed(self):
        """Only the capture's body is switched on."""
        self.body(self.cube("Other", location=(2, 0, 0)))
        self.assertEqual(self.keys("Other", enabled=True), [])

    def test_a_pin_holds(self):
        self.settings.body_index = 0
        bpy.ops.matterfit.add_pin()
        self.assertFalse(self.row("velocity").enabled)
        self.assertFalse(self.row("spin").enabled)
        self.assertTrue(self.row("material.E").enabled)

    def test_branches(self):
        self.settings.body_index = 0
        bpy.ops.matterfit.add_branch()
        bpy.ops.matterfit.add_branch()
        self.assertIn("material.maxwell[1].time", self.keys())
        self.assertEqual(quantities.label_of("material.maxwell[1].time"),
                         "2: Relaxation Time [s]")
        bpy.ops.matterfit.remove_branch()
        self.assertNotIn("material.maxwell[1].time", self.keys())
        document, _folder = self.document()
        self.assertEqual(document["scene"]["bodies"][0]["material"]["maxwell"],
                         [{"modulus": 10000, "time": 0.1}])

    def test_removing_a_branch_moves_the_settings_of_the_next(self):
        """They belong to a branch, not to its number."""
        self.settings.body_index = 0
        for _ in range(3):
            bpy.ops.matterfit.add_branch()
        material = self.settings.bodies[0].material
        for index, modulus in enumerate((1e3, 2e3, 3e3)):
            material.maxwell[index].modulus = modulus
            row = self.row(f"material.maxwell[{index}].modulus")
            row.enabled, row.use_start, row.start = index == 1, True, 10.0 * modulus
        material.maxwell_index = 0
        bpy.ops.matterfit.remove_branch()
        row = self.row("material.maxwell[0].modulus")
        self.assertEqual((row.enabled, row.start), (True, 2e4))
        self.assertIn("1: Modulus", row.name)
        row = self.row("material.maxwell[1].modulus")
        self.assertEqual((row.enabled, row.start), (False, 3e4))
        self.assertNotIn("material.maxwell[2].modulus", self.keys())

    def test_a_capture_keeps_its_row(self):
        """Renamed, or switched off for a while."""
        row = self.row("start_frame", "clip")
        row.enabled, row.use_bounds, row.low, row.high = True, True, 0.5, 1.5
        self.capture.name = "drop"
        self.capture.enabled = False
        fit_rows.refresh(self.settings)
        row = self.row("start_frame", "drop")
        self.assertEqual((row.enabled, row.use_bounds, row.low, row.high), (True, True, 0.5, 1.5))
        self.assertEqual(self.keys("clip"), [])

    def test_older_scenes(self):
        """Version 2 had no list: it is made when the file is opened."""
        self.fit.parameters.clear()
        self.settings.schema_version = 2
        self.save("scene.blend")
        self.reopen()
        self.assertEqual(self.settings.schema_version, migration.SCHEMA_VERSION)
        self.assertTrue(self.row("material.E").enabled)

    def test_older_scenes_that_pour(self):
        """Version 3 had one separation for what pours and what does not: it stays when a law is
        changed that pours too."""
        solver, material = self.settings.solver, self.settings.bodies[0].material
        material.law = "NEWTONIAN"
        with resolution.kept(self.scene):
            solver.quality, solver.particle_separation = "STANDARD", 0.04
        solver.for_flows = False
        self.settings.schema_version = 3
        self.save("scene.blend")
        self.reopen()
        solver, material = self.settings.solver, self.settings.bodies[0].material
        self.assertEqual(self.settings.schema_version, migration.SCHEMA_VERSION)
        self.assertTrue(solver.for_flows)
        material.law = "DRUCKER_PRAGER"
        self.assertAlmostEqual(solver.particle_separation, 0.04, places=6)

    def test_settings_survive(self):
        self.row("material.E").enabled = False
        self.fit.levels, self.fit.law = 2, "FIND"
        self.fit.laws = {"NEO_HOOKEAN", "VON_MISES"}
        self.save("scene.blend")
        self.reopen()
        self.assertFalse(self.row("material.E").enabled)
        self.assertEqual((self.fit.levels, self.fit.law), (2, "FIND"))
        self.assertEqual(self.fit.laws, {"NEO_HOOKEAN", "VON_MISES"})

    def test_values_are_si(self):
        """Lengths in metres whatever the scene's scale is."""
        self.scene.unit_settings.scale_length = 0.01
        self.settings.bodies[0].velocity = (100.0, 0.0, 0.0)
        self.settings.solver.ground_height = 50.0
        numpy.testing.assert_allclose(
            fit_values.value(self.settings, "Cube", "velocity"), (1.0, 0.0, 0.0), rtol=1e-6)
        self.assertAlmostEqual(fit_values.value(self.settings, "ground", "height"), 0.5)


class DocumentTest(FitCase):
    def test_as_it_opens(self):
        document, _folder = self.document("fit")
        self.assertEqual(document["task"], "fit")
        self.assertEqual(document["output"], {"folder": "."})
        self.assertEqual(document["fit"], {
            "parameters": ["bodies.Cube.material.E", "bodies.Cube.material.nu",
                           "bodies.Cube.velocity", "bodies.Cube.spin"],
            "loss": "tracks", "huber": 0, "iterations": 30, "windows": True, "draws": 16})

    def test_settings(self):
        fit = self.fit
        fit.loss, fit.use_huber, fit.huber = "CHAMFER", True, 2.5
        fit.iterations, fit.windows, fit.levels = 12, False, 3
        written = self.written()
        self.assertEqual(
            [written[key] for key in ("loss", "huber", "iterations", "windows", "levels")],
            ["chamfer", 2.5, 12, False, [4, 2, 1]])
        fit.loss = "SURFACE"
        self.assertEqual(self.written()["loss"], "surface")

    def test_start_bounds_prior(self):
        self.only("material.E")
        row = self.row("material.E")
        row.use_start, row.start = True, 5e4
        row.use_bounds, row.low, row.high = True, 1e3, 1e7
        row.use_prior, row.mean, row.sigma = True, 8e4, 0.5
        self.assertEqual(self.written()["parameters"], [
            {"path": "bodies.Cube.material.E", "start": 50000, "bounds": [1000, 10000000],
             "prior": {"mean": 80000, "sigma": 0.5}}])

    def test_switching_on_takes_what_is_there(self):
        """Start and bounds begin about the present value, not about that of long ago."""
        self.settings.bodies[0].material.E = 7e6
        row = self.row("material.E")
        row.use_start = True
        self.assertEqual(row.start, 7e6)
        row = self.row("density")
        self.settings.bodies[0].density = 400.0
        row.use_bounds = True
        self.assertAlmostEqual(row.low, 0.04, places=5)
        self.assertAlmostEqual(row.high, 4e6, places=0)

    def test_bounds_are_the_documented_ones(self):
        """Switched on, they are those that the search has without them (docs/formats.md)."""
        self.settings.solver.ground_height = 5.0
        row = self.row("height", "ground")
        row.use_bounds = True
        self.assertEqual((row.low, row.high), (4.0, 6.0))
        self.settings.bodies[0].material.preset = "TOOTHPASTE"
        row = self.row("material.exponent")
        row.use_bounds = True
        numpy.testing.assert_allclose((row.low, row.high), (0.1, 4.0))
        for key, reach in (("velocity", 50.0), ("spin", 200.0), ("placement.position", 1.0),
                           ("placement.rotation", numpy.pi)):
            self.assertAlmostEqual(self.row(key).reach, reach, places=5)

    def test_a_prior_expects_the_start(self):
        """What is expected begins at what the search begins at when it is switched on."""
        self.only("material.E", "velocity")
        self.settings.bodies[0].material.E = 7e4
        self.settings.bodies[0].velocity = (1.0, 2.0, 3.0)
        row = self.row("material.E")
        row.use_prior = True
        self.assertEqual(row.mean, 7e4)
        row.use_prior, row.use_start, row.start = False, True, 5e4
        row.use_prior = True
        self.assertEqual(row.mean, 5e4)
        row = self.row("velocity")
        row.use_prior, row.sigma = True, 0.5
        row.axes = (True, False, True)
        self.assertEqual(self.written()["parameters"][1:], [
            {"path": "bodies.Cube.velocity[0]", "prior": {"mean": 1, "sigma": 0.5}},
            {"path": "bodies.Cube.velocity[2]", "prior": {"mean": 3, "sigma": 0.5}}])

    def test_vectors(self):
        """Axes alone, and components with bounds about where they start."""
        self.only("velocity")
        row = self.row("velocity")
        row.axes = (True, False, True)
        self.assertEqual(self.written()["parameters"],
                         ["bodies.Cube.velocity[0]", "bodies.Cube.velocity[2]"])
        self.settings.bodies[0].velocity = (1.0, 2.0, 3.0)
        row.use_bounds, row.reach = True, 0.5
        self.assertEqual(self.written()["parameters"], [
            {"path": "bodies.Cube.velocity[0]", "bounds": [0.5, 1.5]},
            {"path": "bodies.Cube.velocity[2]", "bounds": [2.5, 3.5]}])
        row.axes = (False, False, False)
        with self.assertRaisesRegex(JobError, "Cube: Velocity.*no axis"):
            self.written()

    def test_when_a_capture_begins(self):
        """Its bounds are counted from where the capture begins in the scene."""
        fit_rows.refresh(self.settings)
        self.only("start_frame", owner="clip")
        self.assertEqual(self.written()["parameters"], ["captures.clip.start_frame"])
        row = self.row("start_frame", "clip")
        self.scene.frame_start = 1
        row.use_bounds = True
        self.assertEqual((row.low, row.high), (-1.0, 3.0))
        solver = self.settings.solver
        solver.use_range, solver.frame_start, solver.frame_end = True, 4, 6
        row.use_bounds = False
        row.use_bounds = True
        self.assertEqual((row.low, row.high), (2.0, 6.0))
        self.written()
        self.capture.use_start_frame, self.capture.start_frame = True, 0.5
        self.assertEqual(fit_values.value(self.settings, "clip", "start_frame"), 0.5)

    def test_rotation_is_on_top(self):
        """The document has a quaternion; the search begins at none."""
        self.only("placement.rotation")
        bpy.data.objects["Cube"].rotation_euler.z = 1.0
        bpy.context.view_layer.update()
        row = self.row("placement.rotation")
        row.use_bounds, row.reach, row.axes = True, 0.25, (False, False, True)
        self.assertEqual(self.written()["parameters"], [
            {"path": "bodies.Cube.placement.rotation[2]", "bounds": [-0.25, 0.25]}])

    def test_the_takes_own_throw(self):
        """Bounds lie about what the take throws."""
        bpy.ops.matterfit.add_take()
        self.settings.body_index = 0
        bpy.ops.matterfit.add_throw()
        self.settings.takes[0].throws[0].velocity = (4.0, 0.0, 0.0)
        self.only("velocity")
        row = self.row("velocity")
        row.axes, row.use_bounds, row.reach = (True, False, False), True, 1.0
        self.assertEqual(self.written()["parameters"],
                         [{"path": "bodies.Cube.velocity[0]", "bounds": [3, 5]}])

    def test_what_the_active_take_starts_from(self):
        """Its throw and its gravity; of an animated object the place at the first frame."""
        def start(key, owner="Cube"):
            return fit_values.value(self.settings, owner, key)

        item = bpy.data.objects["Cube"]
        for frame, x in ((1, 2.0), (6, 4.0)):
            item.location.x = x
            item.keyframe_insert("location", frame=frame)
        self.scene.frame_set(6)
        self.assertIsNone(start("placement.position"))
        row = self.row("placement.position")
        row.use_start = True
        self.assertAlmostEqual(row.start_vector[0], 2.0, places=5)
        self.assertEqual(self.scene.frame_current, 6)
        bpy.ops.matterfit.add_take()
        self.settings.body_index = 0
        bpy.ops.matterfit.add_throw()
        take = self.settings.takes[0]
        throw = take.throws[0]
        throw.velocity_from, throw.velocity, throw.spin = "VALUE", (4.0, 0.0, 0.0), (0.0, 5.0, 0.0)
        throw.use_placement, throw.location = True, (7.0, 0.0, 0.0)
        take.use_gravity, take.gravity = True, (0.0, 0.0, -2.0)
        self.assertEqual(start("velocity"), (4.0, 0.0, 0.0))
        self.assertEqual(start("spin"), (0.0, 5.0, 0.0))
        self.assertEqual(start("placement.position"), (7.0, 0.0, 0.0))
        self.assertEqual(start("gravity", ""), (0.0, 0.0, -2.0))
        row = self.row("velocity")
        row.use_start = True
        self.assertEqual(tuple(row.start_vector), (4.0, 0.0, 0.0))
        throw.velocity_from = "ANIMATION"
        self.assertIsNone(start("velocity"))
        throw.velocity_from = "BODY"
        self.assertEqual(start("velocity"), (0.0, 0.0, 0.0))

    def test_names_in_quotes(self):
        self.settings.bodies[0].name = "my.dough"
        self.settings.captures[0].body = ""
        written = self.written()["parameters"]
        self.assertEqual(written[0], 'bodies."my.dough".material.E')
        self.assertEqual(job_fit.split_path('bodies."my.dough".velocity[1]', {}),
                         ("my.dough", "velocity", 1))
        self.settings.bodies[0].name = 'the "dough"'
        path = self.written()["parameters"][0]
        self.assertEqual(path, """bodies.'the "dough"'.material.E""")
        self.assertEqual(job_fit.split_path(path, {}), ('the "dough"', "material.E", None))

    def test_split_path(self):
        scene = {"bodies": [{"name": "Cube"}], "captures": [{"name": "a"}, {"name": "b'\""}]}
        for path, expected in (
                ("material.E", ("Cube", "material.E", None)),
                ("scene.bodies.Cube.material.maxwell[0].time",
                 ("Cube", "material.maxwell[0].time", None)),
                ("bodies[0].placement.rotation[2]", ("Cube", "placement.rotation", 2)),
                ("gravity[2]", ("", "gravity", 2)), ("gravity", ("", "gravity", None)),
                ("colliders.ground.contact.mu", ("ground", "contact.mu", None)),
                ('captures."a.b".start_frame', ("a.b", "start_frame", None)),
                ("captures[1].start_frame", ("b'\"", "start_frame", None)),
                ("""bodies.'my "cube"'.velocity[1]""", ('my "cube"', "velocity", 1)),
                ("""bodies."Ann's".density""", ("Ann's", "density", None))):
            self.assertEqual(job_fit.split_path(path, scene), expected, path)

    def test_find_the_law(self):
        """What no candidate has is left out: another law may be what is found."""
        self.settings.bodies[0].material.preset = "PLASTICINE"
        self.fit.law = "FIND"
        self.assertEqual(self.written()["laws"], "all")
        self.fit.laws = {"VON_MISES", "NEO_HOOKEAN"}
        written = self.written()
        self.assertEqual(written["laws"], ["neo_hookean", "von_mises"])
        self.assertIn("bodies.Cube.material.yield_stress", written["parameters"])
        self.fit.laws = {"NEO_HOOKEAN"}
        self.assertNotIn("bodies.Cube.material.yield_stress", self.written()["parameters"])
        self.fit.laws = set()
        with self.assertRaisesRegex(JobError, "no law is chosen"):
            self.written()

    def test_hold_out(self):
        self.capture.holdout, self.capture.holdout_tracks = "TRACKS", "Tip-1, 3"
        document, _folder = self.document("fit")
        self.assertEqual(document["captures"][0]["holdout"], {"tracks": ["Tip-1", 3]})
        self.capture.holdout, self.capture.holdout_start = "BOTH", 4
        document, _folder = self.document("fit")
        self.assertEqual(document["captures"][0]["holdout"], {"frames": [4, 7], "tracks": ["Tip-1", 3]})
        # Files hold the number.
        items = self.capture.bl_rna.properties["holdout"].enum_items
        self.assertEqual({item.identifier: item.value for item in items},
                         {"NONE": 0, "FRAMES": 1, "CAPTURE": 2, "TRACKS": 3, "BOTH": 4})
        self.capture.holdout_tracks = " "
        with self.assertRaisesRegex(JobError, "no point is named"):
            self.written()

    def test_a_switched_off_body_is_left_out(self):
        self.body(self.cube("Other", location=(2, 0, 0)))
        self.row("density", "Other").enabled = True
        self.assertIn("bodies.Other.density", self.written()["parameters"])
        self.settings.bodies[1].enabled = False
        self.assertNotIn("bodies.Other.density", self.written()["parameters"])

    @needs_library
    def test_the_library_reads_it(self):
        """Every kind of entry, in the words of the library itself."""
        for row in self.fit.parameters:
            row.enabled = True
        self.settings.body_index = 0
        bpy.ops.matterfit.add_branch()
        self.row("material.maxwell[0].time").enabled = True
        self.row("velocity").use_bounds = True
        self.row("spin").axes = (True, False, True)
        self.row("material.E").use_prior = True
        self.row("placement.position").use_prior = True
        for loss, law in (("TRACKS", "BODY"), ("CHAMFER", "FIND")):
            self.fit.loss, self.fit.law = loss, law
            document, folder = self.document("fit")
            native.validate(document, folder)
        for name in ("my.dough", 'the "dough"', "Ann's"):
            self.settings.bodies[0].name = name
            document, folder = self.document("fit")
            native.validate(document, folder)
