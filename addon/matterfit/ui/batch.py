# SPDX-License-Identifier: GPL-3.0-or-later
import bpy

from ..compat import translate
from ..io import batch
from ..props import scene as scene_props
from .common import MatterfitPanel, form, lines


class MATTERFIT_UL_axes(bpy.types.UIList):
    def draw_item(self, _context, layout, _data, item, _icon, _active, _name, _index=0):
        layout.label(text=item.name, translate=False)


class MATTERFIT_PT_batch(MatterfitPanel, bpy.types.Panel):
    bl_label = "Batch"
    bl_order = 9

    def draw(self, context):
        layout = self.layout
        rows = context.scene.matterfit.batch
        row = layout.row()
        row.template_list("MATTERFIT_UL_axes", "", rows, "axes", rows, "axis_index", rows=2)
        row.column(align=True).operator("matterfit.remove_axis", text="", icon="REMOVE")
        layout.operator_menu_enum("matterfit.add_axis", "quantity", text="Vary", icon="ADD")
        axis = scene_props.active_item(rows.axes, rows.axis_index)
        if axis is not None:
            unit = batch.unit(axis.key)
            layout.prop(axis, "values", text=f"[{unit}]" if unit else "")
        count = _combinations(rows.axes)
        if count:
            lines(layout, translate("{n} simulations").format(n=count), icon="INFO")
        column = form(layout)
        column.prop(rows, "at_once", text="At Once")
        row = layout.row(align=True)
        row.scale_y = 1.3
        row.operator("matterfit.run_batch", icon="RENDER_ANIMATION")
        row.operator("matterfit.free_batch", text="", icon="TRASH")
        form(layout).prop(rows, "farm")
        layout.operator("matterfit.write_batch", icon="FILE_TICK")
        layout.operator("matterfit.show_batch", icon="IMPORT")


def _combinations(axes):
    count = 1 if axes else 0
    for axis in axes:
        count *= len([text for text in axis.values.split(",") if text.strip()])
    return count


CLASSES = (MATTERFIT_UL_axes, MATTERFIT_PT_batch)
