# SPDX-License-Identifier: GPL-3.0-or-later
"""Extend Model by what stands in the scene, or is the camera's; Ignore and Accept; the preview of the
extended model; what noise and the solver make in the graphs and the heat-map."""

import os

import bpy
import numpy
from fake_diagnosis import cause, number
from mathutils import Vector
from matterfit.io import comparison, diagnosis, error_bands, files
from matterfit.props.diagnosis import is_ignored
from matterfit.ui import diagnosis_overlay, overlay
from test_diagnose import DiagnoseCase


def frames_of(name="clip", after=True):
    """by_frame of a report: frames 1 to 4, of which the last is held out."""
    return [{"capture": name, "frame": frame, "time": 0.04 * frame, "before": 1e-3 * frame,
             "after": 5e-4 if after else None, "noise": 3e-4, "numerical": 4e-4,
             "held_out": frame == 4} for frame in (1, 2, 3, 4)]


class SurroundingsTest(DiagnoseCase):
    def found(self):
        return next(row for row in self.settings.bodies if row.name == "Found Collider")

    def test_a_wall_that_was_not_listed(self):
        wall = {"name": "hidden collider", "shape": "plane", "point": [1.5, 0.0, 0.5],
                "normal": [-1.0, 0.0, 0.0], "contact": {"kind": "friction", "mu": 0.25}}
        self.scene.unit_settings.scale_length = 0.5
        self.extended(cause("hidden_collider", {}), change=lambda scene: scene["colliders"].append(wall))
        self.assertEqual(bpy.ops.matterfit.extend_model(), {"FINISHED"}, self.error())
        self.assertEqual(len([row for row in self.settings.bodies if row.role == "COLLIDER"]), 1)
        row = self.found()
        self.assertEqual((row.role, row.collider_shape, row.contact.kind), ("COLLIDER", "PLANE", "FRICTION"))
        self.assertAlmostEqual(row.contact.mu, 0.25)
        bpy.context.view_layer.update()
        self.assertLess((row.object.matrix_world.translation - Vector((3.0, 0.0, 1.0))).length, 1e-5)
        written = next(item for item in self.document()[0]["scene"]["colliders"] if item["name"] == row.name)
        turn = row.object.matrix_world.to_quaternion()
        self.assertLess((turn @ Vector((0, 0, 1)) - Vector((-1, 0, 0))).length, 1e-5)
        self.assertEqual(written["shape"], "plane")

    def test_a_ball_that_was_not_listed(self):
        ball = {"name": "hidden collider", "shape": "sphere", "radius": 0.5,
                "transform": {"position": [1.0, 0.0, 0.25]}, "contact": {"kind": "friction", "mu": 0.5}}
        self.extended(cause("hidden_collider", {}), change=lambda scene: scene["colliders"].append(ball))
        bpy.ops.matterfit.extend_model()
        bpy.context.view_layer.update()
        written = next(item for item in self.document()[0]["scene"]["colliders"]
                       if item["name"] == "Found Collider")
        self.assertEqual(written["shape"], "sphere")
        self.assertAlmostEqual(written["radius"], 0.5, places=4)
        self.assertAlmostEqual(written["transform"]["position"][0], 1.0, places=4)

    @staticmethod
    def slope(scene):
        ground = next(item for item in scene["colliders"] if item["name"] == "ground")
        ground.pop("height", None)
        ground.update(shape="plane", point=[0.0, 0.0, 0.0], normal=[0.1, 0.0, (1 - 0.01) ** 0.5])

    def test_a_ground_that_slopes(self):
        self.settings.solver.ground.mu = 0.75
        self.extended(cause("ground_tilt", {}), change=self.slope)
        self.assertFalse(self.settings.solver.use_ground)
        row = next(row for row in self.settings.bodies if row.name == "Sloping Ground")
        self.assertAlmostEqual(row.contact.mu, 0.75)
        bpy.context.view_layer.update()
        up = row.object.matrix_world.to_quaternion() @ Vector((0, 0, 1))
        self.assertAlmostEqual(up.x, 0.1, places=5)

    def test_a_camera_that_is_rolled(self):
        def change(scene):
            scene["gravity"] = [1.0, 0.0, -9.75]
            self.slope(scene)

        self.extended(cause("camera_roll", {}), change=change)
        self.assertAlmostEqual(self.settings.solver.gravity[0], 1.0, places=5)
        self.assertFalse(self.settings.solver.use_ground)

    def with_capture(self, effect, entry, change=None, numbers=None, scope="shared", **other):
        self.diagnosed([cause(effect, numbers or {}, scope=scope)], change or (lambda scene: None),
                       model_captures=[{"name": self.settings.captures[0].name, **entry}], **other)
        return self.settings.captures[0]

    def test_a_recording_that_begins_later(self):
        for scope in ("shared", f"capture {self.settings.captures[0].name}"):
            capture = self.with_capture("time_offset", {"start_frame": 1.625}, scope=scope)
            self.assertEqual(bpy.ops.matterfit.extend_model(), {"FINISHED"}, self.error())
            self.assertTrue(capture.use_start_frame)
            self.assertAlmostEqual(capture.start_frame, 1.625, places=5)
            capture.use_start_frame = False

    def test_lengths_of_a_body_that_is_held(self):
        matrix = [[1.25, 0, 0, 0.5], [0, 1.25, 0, 0], [0, 0, 1.25, 0], [0, 0, 0, 1]]

        def change(scene):
            scene["bodies"][0]["pins"] = [{"all": True}]

        capture = self.with_capture("scale", {"unit": "mm", "transform": matrix}, change)
        for _again in range(2):
            self.assertEqual(bpy.ops.matterfit.extend_model(), {"FINISHED"}, self.error())
        self.assertEqual(capture.unit, "CUSTOM")
        self.assertAlmostEqual(capture.scale, 1.25e-3, places=7)
        self.assertAlmostEqual(capture.location[0], 0.5, places=5)
        capture = self.with_capture("scale", {"transform": matrix}, change)
        self.fails(bpy.ops.matterfit.extend_model, ["Unit is Automatic"])

    def test_lengths_of_a_body_that_is_thrown_are_gravity(self):
        self.with_capture("scale", {}, lambda scene: scene.update(gravity=[0.0, 0.0, -10.0]))
        bpy.ops.matterfit.extend_model()
        self.assertAlmostEqual(self.settings.solver.gravity[2], -10.0, places=5)
        self.with_capture("scale", {}, scope="capture clip")
        self.fails(bpy.ops.matterfit.extend_model, ["in the recording 'clip' alone"])

    def test_a_rate_that_is_stated_wrong(self):
        capture = self.with_capture("frame_rate", {}, numbers={"factor": number(0.25)})
        document = files.read_json(os.path.join(self.run_folder, "job.json"))
        times = numpy.arange(4) / 48.0
        points = numpy.zeros((4, 1, 3))
        files.write_npz(os.path.join(self.run_folder, "compare.npz"), {
            "error_mm": points[:, :, 0], "times": times, "captured": points, "labels": numpy.array(["0"])})
        files.write_npz(os.path.join(self.run_folder, "simulated.npz"), {"positions": points, "times": times})
        self.assertEqual(len(document["captures"]), 1)
        for _again in range(2):
            self.assertEqual(bpy.ops.matterfit.extend_model(), {"FINISHED"}, self.error())
        self.assertTrue(capture.use_fps)
        self.assertAlmostEqual(capture.fps, 48.0 / 1.25, places=3)

    def test_a_capture_that_is_gone(self):
        self.with_capture("time_offset", {"start_frame": 2.0})
        self.settings.captures[0].name = "renamed"
        self.fails(bpy.ops.matterfit.extend_model, ["not in the scene any more"])


class SearchTest(DiagnoseCase):
    def test_its_limit_stands_in_jobs(self):
        self.assertNotIn("diagnose", self.document(task="diagnose")[0])
        self.settings.diagnosis.use_limit = True
        self.settings.diagnosis.limit = 450
        self.assertEqual(self.document(task="diagnose")[0]["diagnose"], {"runs": 450})


class IgnoreTest(DiagnoseCase):
    def test_what_is_ignored_is_not_used_and_said_in_jobs(self):
        self.diagnosed([self.DRAG, self.OTHER], lambda scene: scene.update(effects=[]))
        self.assertEqual(bpy.ops.matterfit.ignore_cause(index=0), {"FINISHED"}, self.error())
        self.assertTrue(is_ignored(self.settings, "drag_quadratic"))
        self.assertEqual([text for text, _properties in self.buttons("matterfit.ignore_cause")], ["", "", "Accept"])
        self.fails(bpy.ops.matterfit.extend_model, ["Air Drag is ignored", "Accept"])
        self.assertEqual(self.document(task="diagnose")[0]["diagnose"], {"ignored": ["drag_quadratic"]})
        self.diagnosed([self.DRAG, self.OTHER])  # it stays so
        self.assertTrue(is_ignored(self.settings, "drag_quadratic"))
        bpy.ops.matterfit.ignore_cause(index=0, ignored=False)
        self.assertFalse(is_ignored(self.settings, "drag_quadratic"))
        self.assertNotIn("diagnose", self.document(task="diagnose")[0])

    def test_the_table_says_what_a_cause_explains(self):
        self.diagnosed([self.DRAG])
        self.assertIn("Explains 90 %", self.texts())


class BandsTest(DiagnoseCase):
    def shown(self, after=True, name=None):
        residual = {"by_frame": frames_of(name or self.settings.captures[0].name, after), "worst": [], "wrong": []}
        self.diagnosed([self.DRAG], residual=residual)
        return error_bands.of_fit(self.settings, self.settings.captures[0].name)

    def test_read(self):
        bands = self.shown()
        numpy.testing.assert_allclose(bands.usual, 0.5)
        numpy.testing.assert_allclose(bands.before, [1, 2, 3, 4])
        self.assertEqual(bands.held_out_spans(), [(4.0, 4.0)])
        self.assertEqual([title for title, _values in diagnosis_overlay.titles(bands)], ["Before", "After"])
        self.assertEqual(diagnosis_overlay.top_of(bands), 4.0)
        bands = self.shown(after=False)
        self.assertEqual([title for title, _values in diagnosis_overlay.titles(bands)], ["Before"])

    def test_none_of_another_capture(self):
        self.assertIsNone(self.shown(name="another"))

    def test_the_heat_map_in_sigma(self):
        self.shown()
        compare = self.settings.compare
        errors = numpy.array([[0.25, 1.5], [2.0, numpy.nan]])
        points = numpy.zeros((2, 2, 3))
        found = comparison.Comparison(numpy.array([1.0, 2.0]), points, points, errors, ["0", "1"])
        self.assertEqual(overlay.shown_now(self.settings, found)[2], "mm")
        compare.heat_unit, compare.significant_only = "SIGMA", True
        sigmas, left_out, unit = overlay.shown_now(self.settings, found)
        self.assertEqual(unit, "σ")
        numpy.testing.assert_allclose(sigmas, [[0.5, 3.0], [4.0, numpy.nan]])
        numpy.testing.assert_array_equal(left_out, [[True, False], [False, False]])
        compare.range_mode, compare.range_sigma = "FIXED", 5.0
        self.assertEqual(overlay.top_of_range(self.settings, found), 5.0)
        sets = overlay.point_sets(compare, found, 0, 1.0, 5.0)
        self.assertEqual([len(points) for points, _color, _size in sets], [1, 1])

    def test_without_a_diagnosis_it_is_in_mm(self):
        errors = numpy.array([[0.25]])
        found = comparison.Comparison(numpy.array([1.0]), numpy.zeros((1, 1, 3)), numpy.zeros((1, 1, 3)), errors, ["0"])
        self.settings.compare.heat_unit = "SIGMA"
        self.assertEqual(overlay.shown_now(self.settings, found)[2], "mm")


class PreviewTest(DiagnoseCase):
    def test_is_refused_without_a_model(self):
        self.diagnosed([self.DRAG])
        count = len(self.settings.takes)
        os.remove(os.path.join(self.run_folder, diagnosis.EXTENDED_FILE))
        self.fails(bpy.ops.matterfit.preview_extended, ["accepted no cause"])
        self.assertEqual(len(self.settings.takes), count)

    def test_runs_the_extended_model_in_a_take_of_its_own(self):
        self.diagnosed([self.DRAG], lambda scene: scene.update(gravity=[0.0, 0.0, -5.0]))
        count = len(self.settings.takes)
        for _again in range(2):  # the second takes the first one's place
            bpy.ops.matterfit.preview_extended()
            self.assertEqual(self.started[-1][0]["scene"]["gravity"], [0.0, 0.0, -5.0])
            self.assertEqual(self.started[-1][1]["task"], "bake")
        self.assertLessEqual(len(self.settings.takes), count + 1)
