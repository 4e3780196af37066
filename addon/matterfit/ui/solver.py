# SPDX-License-Identifier: GPL-3.0-or-later
import bpy

from ..compat import translate
from ..io import resolution
from .common import MatterfitPanel, contact, form, lines


class MATTERFIT_PT_solver(MatterfitPanel, bpy.types.Panel):
    bl_label = "Solver"
    bl_order = 3

    def draw(self, context):
        layout = self.layout
        solver = context.scene.matterfit.solver
        column = form(layout)
        column.prop(solver, "quality")
        column.prop(solver, "particle_separation")
        cells = _cells(context)
        if cells is not None:
            lines(layout, translate("{n} cells across the thinnest part").format(
                n=f"{cells:.1f}"), icon="ERROR" if cells < 2.95 else "INFO")
        layout.operator("matterfit.set_resolution", icon="DRIVER_DISTANCE")
        column = form(layout)
        column.prop(solver, "use_range")
        if solver.use_range:
            column.prop(solver, "frame_start")
            column.prop(solver, "frame_end")
        column.prop(solver, "gravity")


_measured = {}


def _cells(context):
    """Measuring casts rays, so it is not done at every redraw: only after a change."""
    scene = context.scene
    key = tuple((body.name, body.enabled, body.object.name, len(body.object.data.vertices),
                 tuple(body.object.dimensions))
                for body in scene.matterfit.bodies
                if body.role == "BODY" and body.object is not None and body.object.type == "MESH")
    if _measured.get("key") != key:
        _measured.update(key=key, thickness=resolution.thinnest(scene))
    thickness = _measured["thickness"]
    return None if thickness is None else thickness / (
        2.0 * scene.matterfit.solver.particle_separation)


class MATTERFIT_PT_container(MatterfitPanel, bpy.types.Panel):
    bl_label = "Ground and Container"
    bl_parent_id = "MATTERFIT_PT_solver"

    def draw(self, context):
        layout = self.layout
        solver = context.scene.matterfit.solver
        column = form(layout)
        column.prop(solver, "use_ground")
        if solver.use_ground:
            column.prop(solver, "ground_height")
            contact(layout, solver.ground)
        column = form(layout)
        column.prop(solver, "use_walls")
        if solver.use_walls:
            column.prop(solver, "container")
            column.prop(solver, "open_top")
            contact(layout, solver.walls)


class MATTERFIT_PT_solver_advanced(MatterfitPanel, bpy.types.Panel):
    bl_label = "Advanced"
    bl_parent_id = "MATTERFIT_PT_solver"

    def draw(self, context):
        column = form(self.layout)
        solver = context.scene.matterfit.solver
        column.prop(solver, "cfl")
        column.prop(solver, "memory_limit")
        column.prop(solver, "threads")


CLASSES = (MATTERFIT_PT_solver, MATTERFIT_PT_container, MATTERFIT_PT_solver_advanced)
