# SPDX-License-Identifier: GPL-3.0-or-later
"""Throws of a take: their list, and what they become in a document."""

from unittest import mock

import bpy
import numpy
from mathutils import Vector
from matterfit import ui
from matterfit.io import motion, takes
from test_operators import JobCase


class ThrowTest(JobCase):
    """The arrow and the path that the viewport draws."""

    def flight(self):
        found = ui.throw_overlay.flights(self.scene)
        return found[0] if found else None

    def test_none_without_a_velocity(self):
        self.assertIsNone(self.flight())
        self.settings.bodies[0].velocity = (1.0, 0.0, 0.0)
        self.settings.bodies[0].velocity_from = "ANIMATION"
        self.assertIsNone(self.flight())

    def test_a_parabola_to_the_ground(self):
        """From .3 m with the half height .1 m the underside meets the ground after √(2·.2/9.81) s."""
        self.scene.frame_end = 25
        self.settings.bodies[0].velocity = (2.0, 0.0, 0.0)
        path = self.flight().path
        numpy.testing.assert_allclose(path[0], (0.0, 0.0, 0.3), atol=1e-6)
        numpy.testing.assert_allclose(path[-1], (2.0 * (0.4 / 9.81) ** 0.5, 0.0, 0.1), atol=0.01)
        numpy.testing.assert_allclose(path[2, 2], 0.3 - 0.5 * 9.81 / 12**2, atol=1e-6)

    def test_the_throw_of_a_take(self):
        """Its own place, velocity and gravity count; without a ground it flies to the last frame."""
        self.settings.solver.use_ground = False
        take = takes.ensure_active(self.settings)
        bpy.ops.matterfit.add_throw()
        throw = take.throws[0]
        throw.velocity, throw.use_placement, throw.location = (0.0, 1.0, 0.0), True, (3.0, 0.0, 0.0)
        take.use_gravity, take.gravity = True, (0.0, 0.0, -2.0)
        path = self.flight().path
        numpy.testing.assert_allclose(path[0], (3.0, 0.0, 0.0), atol=1e-6)
        seconds = 5 / 24
        numpy.testing.assert_allclose(path[-1], (3.0, seconds, -seconds**2), atol=1e-6)
        throw.velocity_from = "BODY"
        self.assertIsNone(self.flight())

    def test_an_animation(self):
        """Along its keys at the first frame, from where the object is there; a turn about an origin
        beside the middle adds to it."""
        self.settings.solver.use_ground = False
        item, body = self.settings.bodies[0].object, self.settings.bodies[0]
        body.velocity_from = "ANIMATION"
        item.location = (1.0, 0.0, 5.0)
        item.keyframe_insert("location", frame=1)
        item.location = (3.0, 0.0, 5.0)
        item.keyframe_insert("location", frame=25)
        for curve in motion._curves(item.animation_data.action):
            for key in curve.keyframe_points:
                key.interpolation = "LINEAR"
        self.scene.frame_set(20)
        flight = self.flight()
        numpy.testing.assert_allclose(flight.start, (1.0, 0.0, 5.0), atol=1e-5)
        numpy.testing.assert_allclose(flight.velocity, (2.0, 0.0, 0.0), atol=1e-4)
        document = self.document()[0]["scene"]["bodies"][0]
        numpy.testing.assert_allclose(document["velocity"], flight.velocity, atol=1e-3)
        # A wheel: its middle stands off the origin.
        for vertex in item.data.vertices:
            vertex.co.x += 0.5
        item.rotation_euler.z = 0.0
        item.keyframe_insert("rotation_euler", index=2, frame=1)
        item.rotation_euler.z = 2.4
        item.keyframe_insert("rotation_euler", index=2, frame=25)
        for curve in motion._curves(item.animation_data.action):
            for key in curve.keyframe_points:
                key.interpolation = "LINEAR"
        bpy.context.view_layer.update()
        numpy.testing.assert_allclose(self.flight().velocity, (2.0, 1.2, 0.0), atol=0.02)
        document = self.document()[0]["scene"]["bodies"][0]
        numpy.testing.assert_allclose(document["velocity"], self.flight().velocity, atol=0.02)
        item.constraints.new("LIMIT_LOCATION")
        self.assertIsNone(self.flight(), "a constraint may move it as well")

    def test_the_arrow(self):
        flight = ui.throw_overlay.Flight("a", Vector((1, 0, 0)), Vector((0, 0, 5)), None)
        ends = ui.throw_overlay.arrow(flight, Vector((0, 1, 0)))
        numpy.testing.assert_allclose(ends[1], (1.0, 0.0, 0.5), atol=1e-6)
        numpy.testing.assert_allclose(ends[3] + ends[5], (2.0, 0.0, 0.8), atol=1e-6)
        self.assertGreater(abs(ends[3][0] - ends[5][0]), 0.05)

    def test_the_arrow_leaves_the_body(self):
        """It begins outside of the box, turned as the throw has it."""
        take = takes.ensure_active(self.settings)
        bpy.ops.matterfit.add_throw()
        throw = take.throws[0]
        throw.velocity, throw.use_placement, throw.location = (4.0, 0.0, 0.0), True, (1.0, 0.0, 2.0)
        for turned, half in ((0.0, 0.1), (numpy.pi / 4.0, 0.1 * 2.0**0.5)):
            throw.rotation = (0.0, 0.0, turned)
            ends = ui.throw_overlay.arrow(self.flight(), Vector((0, 1, 0)))
            numpy.testing.assert_allclose(ends[0], (1.0 + half, 0.0, 2.0), atol=1e-5)
            numpy.testing.assert_allclose(ends[1], (1.4 + half, 0.0, 2.0), atol=1e-5)


class ThrowListTest(JobCase):
    def test_the_name_cannot_be_edited(self):
        """It is drawn as a label: renaming would part the throw from its body."""
        bpy.ops.matterfit.add_take()
        bpy.ops.matterfit.add_throw()
        throw = self.settings.takes[0].throws[0]
        for name, icon in (("Cube", "MESH_ICOSPHERE"), ("Gone", "ERROR")):
            throw.name = name
            layout = mock.Mock()
            ui.rerun.MATTERFIT_UL_throws.draw_item(None, bpy.context, layout, None, throw, 0, None,
                                                   "")
            layout.prop.assert_not_called()
            self.assertEqual(layout.label.call_args[1]["icon"], icon)
