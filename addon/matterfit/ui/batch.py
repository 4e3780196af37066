# SPDX-License-Identifier: GPL-3.0-or-later
import bpy

from ..compat import translate
from ..io import batch, batch_results
from ..props import scene as scene_props
from .common import MatterfitPanel, form, lines


class MATTERFIT_UL_axes(bpy.types.UIList):
    def draw_item(self, _context, layout, _data, item, _icon, _active, _name, _index=0):
        layout.label(text=item.name, translate=False)


class MATTERFIT_UL_batch_results(bpy.types.UIList):
    """The best first: rows lie in that order."""

    def draw_item(self, context, layout, _data, item, _icon, _active, _name, index=0):
        row = layout.split(factor=0.68)
        row.label(text=item.name, translate=False,
                  icon="SOLO_ON" if index == 0 and item.error >= 0.0 else "BLANK1")
        row.label(text=batch_results.error_text(item.error), translate=False)


class MATTERFIT_PT_batch(MatterfitPanel, bpy.types.Panel):
    bl_label = "Batch"
    bl_order = 9

    def draw(self, context):
        layout = self.layout
        settings = context.scene.matterfit
        rows = settings.batch
        row = layout.row()
        row.template_list("MATTERFIT_UL_axes", "", rows, "axes", rows, "axis_index", rows=2)
        row.column(align=True).operator("matterfit.remove_axis", text="", icon="REMOVE")
        layout.operator_menu_enum("matterfit.add_axis", "quantity", text="Vary", icon="ADD")
        axis = scene_props.active_item(rows.axes, rows.axis_index)
        if axis is not None:
            unit = batch.unit(axis.key)
            layout.prop(axis, "values", text=f"[{unit}]" if unit else "")
        layout.row(align=True).prop(rows, "task", expand=True)
        count = batch.combinations(settings)
        if count:
            words = translate("{n} fits") if rows.task == "FIT" else translate("{n} simulations")
            lines(layout, words.format(n=count), icon="INFO")
        form(layout).prop(rows, "at_once", text="At Once")
        row = layout.row(align=True)
        row.scale_y = 1.3
        row.operator("matterfit.run_batch", icon="RENDER_ANIMATION")
        row.operator("matterfit.free_batch", text="", icon="TRASH")
        self._results(layout, rows)
        form(layout).prop(rows, "farm", text="Jobs For")
        row = layout.column(align=True)
        row.operator("matterfit.write_batch", icon="FILE_TICK")
        row.operator("matterfit.show_batch", icon="IMPORT")

    def _results(self, layout, rows):
        if not rows.results:
            return
        names = rows.varied
        if any(row.error >= 0.0 for row in rows.results):
            words = (translate("{names}: error after the fit") if rows.task == "FIT" else
                     translate("{names}: mean error"))
            names = words.format(names=names)
        lines(layout, names)
        layout.template_list("MATTERFIT_UL_batch_results", "", rows, "results", rows,
                             "result_index", rows=4)
        if rows.task == "FIT":
            layout.operator("matterfit.apply_batch", icon="CHECKMARK")


CLASSES = (MATTERFIT_UL_axes, MATTERFIT_UL_batch_results, MATTERFIT_PT_batch)
