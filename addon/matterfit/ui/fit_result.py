# SPDX-License-Identifier: GPL-3.0-or-later
import bpy

from .. import laws
from ..compat import translate, translate_label
from ..io import fit_results, takes, words
from ..ops.fit import error_text
from . import fit_overlay
from .common import MatterfitPanel, form, lines


class MATTERFIT_PT_fit_result(MatterfitPanel, bpy.types.Panel):
    bl_label = "Result"
    bl_parent_id = "MATTERFIT_PT_fit"
    bl_order = 1
    bl_options = set()

    @classmethod
    def poll(cls, context):
        fit = context.scene.matterfit.fit
        return (fit.done and bool(fit.run.folder)
                and not fit_overlay.running_fit(context.scene.matterfit))

    def draw(self, context):
        layout = self.layout
        settings = context.scene.matterfit
        folder = takes.locate(settings.fit.run).folder
        result = fit_results.load_quietly(folder)
        if result is None:
            lines(layout, translate("The result of the fit cannot be read. Fit again."),
                  icon="ERROR")
            return
        self._state(layout, result, folder)
        self._errors(layout, result)
        named = [(*words.owner_and_label(settings, estimate.path), estimate) for estimate in result.estimates]
        several = len({owner for owner, _label, _estimate in named}) > 1
        for owner, label, estimate in named:
            self._estimate(layout, f"{owner}: {label}" if several and owner else label, estimate)
        shown = {estimate.statement for estimate in result.estimates}
        for statement in result.statements:
            if statement not in shown:
                lines(layout, words.of_result(statement, settings), icon="INFO")
        if result.models:
            self._models(layout, result)
        form(layout).prop(settings.fit, "show_error")
        row = layout.row(align=True)
        row.scale_y = 1.3
        row.operator("matterfit.apply_fit", icon="CHECKMARK")
        column = layout.column(align=True)
        column.operator("matterfit.save_material", icon="FILE_TICK")
        column.operator("matterfit.add_preset", icon="ADD")

    def _state(self, layout, result, folder):
        if result.status == "cancelled":
            lines(layout, translate("Cancelled: the best so far. Resume goes on.")
                  if fit_results.is_unfinished(folder) else translate("Cancelled: the best so far."),
                  icon="ERROR")
        elif result.warning:
            lines(layout, translate("Doubtful: {reason}").format(reason=result.warning),
                  icon="ERROR")
        elif not result.converged:
            lines(layout, translate("Not converged: {reason}").format(reason=result.reason),
                  icon="ERROR")
        row = layout.row()
        row.label(text="Law")
        row.label(text=laws.name_of(result.law))
        if result.noise_scale > 0.0:
            lines(layout, translate("Remaining error: {factor} × the recording's noise (1 is ideal)").format(
                factor=f"{result.noise_scale:.3g}"))

    def _errors(self, layout, result):
        """Mean errors before and after, on what was fitted and what was held out."""
        box = layout.box()
        row = box.row()
        for title in ("mm", "Before", "After"):
            row.label(text=title)
        for title, measure in (("Fitted", result.fitted), ("Held Out", result.held_out)):
            row = box.row()
            row.label(text=title)
            for found in (measure.before, measure.after):
                row.label(text=error_text(found), translate=False)

    def _estimate(self, layout, label, estimate):
        column = layout.box().column(align=True)
        column.label(text=label, translate=False,
                     icon="CHECKMARK" if estimate.observable and not estimate.at_bound else "ERROR")
        if estimate.observable:
            column.label(text=estimate.text, translate=False)
        else:
            column.label(text=translate("{value}, not observable").format(
                value=fit_results.value_text(estimate.value, None, estimate.unit)),
                translate=False)
        if estimate.grid_error and estimate.observable:
            column.label(text=translate("Grid: ± {error}").format(
                error=fit_results.rounded(estimate.grid_error, estimate.grid_error)),
                translate=False)
        if estimate.interval is not None and estimate.observable:
            low, high = (fit_results.rounded(value, estimate.error)
                         for value in estimate.interval)
            column.label(text=translate("95 %: {low} to {high}").format(low=low, high=high),
                         translate=False)
        if estimate.at_bound:
            column.label(text="At its bound")
        if estimate.statement:
            lines(column, words.of_result(estimate.statement, bpy.context.scene.matterfit))

    def _models(self, layout, result):
        box = layout.box()
        row = box.row()
        for title in ("Law", "Held Out", "Probability"):
            row.label(text=title)
        for place, model in enumerate(result.models):
            row = box.row()
            row.label(text=translate_label(laws.name_of(model.get("law", ""))), translate=False,
                      icon="CHECKMARK" if place == 0 else "NONE")
            if model.get("failed"):
                lines(box, str(model["failed"]), icon="ERROR")
                continue
            row.label(text=_number(model.get("held_out_mm")), translate=False)
            row.label(text=_number(model.get("probability"), 2), translate=False)
            if model.get("left"):
                lines(box, str(model.get("reason", "")))


def _number(value, digits=4):
    return f"{value:.{digits}g}" if isinstance(value, int | float) else "–"


CLASSES = (MATTERFIT_PT_fit_result,)
