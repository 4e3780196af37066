# SPDX-License-Identifier: GPL-3.0-or-later
import bpy

from ..io import batch_results, plain
from ..props import scene as scene_props
from .common import MatterfitPanel, form, quantity


class MATTERFIT_UL_takes(bpy.types.UIList):
    def draw_item(self, context, layout, _data, item, _icon, _active, _name, _index=0):
        row = layout.row(align=True)
        row.prop(item, "name", text="", emboss=False,
                 icon="VIEWZOOM" if item.extended else "CHECKMARK" if item.baked else "REC")
        error = batch_results.error_of(context.scene.matterfit, item)
        if error >= 0.0:
            row.label(text=batch_results.error_text(error), translate=False)
        elif item.frames_done:
            row.label(text=plain.counted(item.frames_done, "frame"), translate=False)


class MATTERFIT_UL_throws(bpy.types.UIList):
    """A throw finds its body by its name, so that is no text to edit."""

    def draw_item(self, context, layout, _data, item, _icon, _active, _name, _index=0):
        known = any(body.role == "BODY" and body.name == item.name
                    for body in context.scene.matterfit.bodies)
        layout.label(text=item.name, icon="MESH_ICOSPHERE" if known else "ERROR", translate=False)


class MATTERFIT_PT_rerun(MatterfitPanel, bpy.types.Panel):
    bl_label = "Rerun"
    bl_order = 7

    def draw(self, context):
        layout = self.layout
        settings = context.scene.matterfit
        session = context.window_manager.matterfit
        row = layout.row()
        row.template_list("MATTERFIT_UL_takes", "", settings, "takes", settings, "take_index",
                          rows=3)
        column = row.column(align=True)
        column.operator("matterfit.add_take", text="", icon="ADD")
        column.operator("matterfit.remove_take", text="", icon="REMOVE")
        take = scene_props.active_take(settings)
        if take is None:
            layout.operator("matterfit.add_take", icon="ADD")
            return
        row = layout.row()
        row.label(text="Throws")
        row.prop(settings, "show_throws", text="", icon="HIDE_OFF" if settings.show_throws else "HIDE_ON")
        row = layout.row()
        row.template_list("MATTERFIT_UL_throws", "throws", take, "throws", session, "throw_index",
                          rows=2)
        column = row.column(align=True)
        column.operator("matterfit.add_throw", text="", icon="ADD")
        column.operator("matterfit.remove_throw", text="", icon="REMOVE")
        throw = scene_props.active_item(take.throws, session.throw_index)
        if throw is not None:
            column = form(layout)
            column.prop(throw, "use_placement")
            if throw.use_placement:
                column.prop(throw, "location")
                column.prop(throw, "rotation")
            column.prop(throw, "velocity_from", text="Motion")
            if throw.velocity_from == "VALUE":
                column.prop(throw, "velocity")
                quantity(column, throw, "spin")
        column = form(layout)
        column.prop(take, "use_gravity")
        if take.use_gravity:
            column.prop(take, "gravity", text="Gravity")
        row = layout.row()
        row.label(text="Colliders")
        row.operator("matterfit.list_colliders", text="", icon="FILE_REFRESH")
        for switch in take.colliders:
            layout.prop(switch, "enabled", text=switch.name, translate=False)
        row = layout.row(align=True)
        row.scale_y = 1.3
        row.operator("matterfit.bake", text="Bake Take", icon="RENDER_ANIMATION")


CLASSES = (MATTERFIT_UL_takes, MATTERFIT_UL_throws, MATTERFIT_PT_rerun)
