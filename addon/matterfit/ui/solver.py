# SPDX-License-Identifier: GPL-3.0-or-later
import zlib

import bpy
import numpy

from ..compat import translate, translate_label
from ..io import plain, resolution
from ..props import scene as scene_props
from .common import MatterfitPanel, contact, form, lines


class MATTERFIT_PT_solver(MatterfitPanel, bpy.types.Panel):
    bl_label = "Solver"
    bl_order = 3

    def draw(self, context):
        layout = self.layout
        solver = context.scene.matterfit.solver
        column = form(layout)
        column.prop(solver, "quality")
        column.prop(solver, "particle_separation", text="Separation")
        known = _known(context)
        cells = resolution.cells_across(context.scene, known)
        if cells is not None:
            lines(layout, translate("{n} cells across the thinnest part").format(
                n=f"{cells:.1f}"), icon="ERROR" if cells < 2.95 else "INFO")
        advice = resolution.advice(context.scene, known)
        if advice:
            lines(layout, advice, icon="ERROR")
        limit = resolution.limited_to(context.scene, known)
        if limit is not None:
            lines(layout, translate("Limited to {n}; {quality} asks for {wanted}").format(
                n=plain.counted(limit[0], "particle"), wanted=limit[1], quality=translate_label(
                    solver.bl_rna.properties["quality"].enum_items[solver.quality].name)),
                  icon="INFO")
        if solver.quality != "CUSTOM":
            layout.prop(solver, "most_particles")
        layout.operator("matterfit.set_resolution", icon="DRIVER_DISTANCE")
        column = form(layout)
        column.prop(solver, "use_range", text="Own Range")
        if solver.use_range:
            column.prop(solver, "frame_start")
            column.prop(solver, "frame_end")
        column.prop(solver, "gravity", text="Gravity")


_measured = {}


def forget():
    """Another file is open."""
    _measured.clear()


def _known(context):
    """Measuring casts rays, so it is not done at every redraw: only after a change of a shape."""
    scene = context.scene
    graph = context.evaluated_depsgraph_get()
    key = tuple(_key(item, graph) for item in resolution.bodies(scene))
    if _measured.get("key") != key:
        _measured.update(key=key, sizes=resolution.seen(scene))
    return _measured["sizes"]


def _key(item, graph):
    """Changes with the object's evaluated shape; quickly found, as it is asked at every redraw."""
    shape = 0
    if item.type == "MESH" and item.mode != "EDIT":
        vertices = item.evaluated_get(graph).data.vertices
        places = numpy.empty(3 * len(vertices), dtype=numpy.float32)
        vertices.foreach_get("co", places)
        shape = zlib.crc32(places)
    return item.name, shape, tuple(item.dimensions), item.visible_get(), item.mode


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
            column.prop(solver, "container", text="Object")
            column.prop(solver, "open_top")
            contact(layout, solver.walls)


class MATTERFIT_UL_pairs(bpy.types.UIList):
    def draw_item(self, _context, layout, _data, item, _icon, _active, _name, _index=0):
        layout.label(text=f"{item.first} · {item.second}", translate=False)


class MATTERFIT_PT_pairs(MatterfitPanel, bpy.types.Panel):
    bl_label = "Contact between Bodies"
    bl_parent_id = "MATTERFIT_PT_solver"

    def draw(self, context):
        layout = self.layout
        settings = context.scene.matterfit
        row = layout.row()
        row.template_list("MATTERFIT_UL_pairs", "", settings, "pairs", settings, "pair_index", rows=2)
        column = row.column(align=True)
        column.operator("matterfit.add_pair", text="", icon="ADD")
        column.operator("matterfit.remove_pair", text="", icon="REMOVE")
        pair = scene_props.active_item(settings.pairs, settings.pair_index)
        if pair is None:
            return
        column = form(layout)
        column.prop_search(pair, "first", settings, "bodies")
        column.prop_search(pair, "second", settings, "bodies", text="Other")
        contact(layout, pair.contact)


class MATTERFIT_PT_solver_advanced(MatterfitPanel, bpy.types.Panel):
    bl_label = "Advanced"
    bl_parent_id = "MATTERFIT_PT_solver"

    def draw(self, context):
        column = form(self.layout)
        solver = context.scene.matterfit.solver
        column.prop(solver, "cfl")
        column.prop(solver, "memory_limit", text="RAM [GB]")
        column.prop(solver, "threads")


CLASSES = (MATTERFIT_UL_pairs, MATTERFIT_PT_solver, MATTERFIT_PT_container, MATTERFIT_PT_pairs,
           MATTERFIT_PT_solver_advanced)
