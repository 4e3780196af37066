# SPDX-License-Identifier: GPL-3.0-or-later
import bpy

from .. import laws
from ..compat import translate, translate_label
from ..io import fit_outlines, fit_results, number_text, takes, words
from ..ops.fit import error_text
from . import fit_overlay
from .common import BOX, MatterfitPanel, form, lines

_OTHERS = 2  # laws that are named after the nearest
_CAMERAS = 8  # that are shown


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
        self._state(layout, settings, result, folder)
        self._errors(layout, result)
        for body, like in result.likes.items():
            self._like(layout, settings, body if len(result.likes) > 1 else "", like)
        named = words.folded(settings, result.estimates)
        several = len({owner for owner, _label, _estimates in named}) > 1
        for owner, label, estimates in named:
            label = f"{owner}: {label}" if several and owner else label
            if len(estimates) > 1:
                self._code(layout, label, estimates)
            else:
                self._estimate(layout, settings, label, estimates[0])
        shown = {estimate.statement for estimate in result.estimates}
        for statement in result.statements:
            statement = _without_like(statement, result.likes)
            if statement and statement not in shown and not words.is_about_code(statement):
                lines(layout, words.of_result(statement, settings), icon="INFO")
        if len(result.models) > 1:
            self._models(layout, settings, result)
        column = form(layout)
        if _has_tracks(result):
            column.prop(settings.fit, "show_error")
        column.prop(settings.fit, "show_curves")
        row = layout.row(align=True)
        row.scale_y = 1.3
        row.operator("matterfit.apply_fit", icon="CHECKMARK")
        column = layout.column(align=True)
        column.operator("matterfit.save_material", icon="FILE_TICK")
        column.operator("matterfit.add_preset", icon="ADD")

    def _state(self, layout, settings, result, folder):
        if result.status == "cancelled":
            lines(layout, translate("Cancelled: the best so far. Resume goes on.")
                  if fit_results.is_unfinished(folder) else translate("Cancelled: the best so far."),
                  icon="ERROR")
        elif result.warning:
            lines(layout, translate("Doubtful: {reason}").format(
                reason=words.of_result(result.warning, settings)), icon="ERROR")
        elif not result.converged:
            lines(layout, translate("Not converged: {reason}").format(
                reason=words.of_result(result.reason, settings)), icon="ERROR")
        lines(layout, translate("Law: {law}").format(law=translate_label(laws.name_of(result.law))))
        if result.noise_scale > 0.0:
            lines(layout, translate("Remaining error: {factor} × the recording's noise (1 is ideal)").format(
                factor=f"{result.noise_scale:.3g}"))

    def _errors(self, layout, result):
        """Mean errors before and after, on what was fitted and what was held out; of images how much their
        outlines overlap."""
        if _has_tracks(result):
            self._table(layout, "mm", [("Fitted", map(error_text, (result.fitted.before, result.fitted.after))),
                                       ("Held Out", map(error_text, (result.held_out.before,
                                                                     result.held_out.after)))])
        if result.outlines is not None:
            self._outlines(layout, result.outlines)
        if result.predicted is not None:
            text = translate("Predicted to ± {size} mm (95 %); {share} % of what was held out lie within")
            lines(layout, text.format(size=f"{result.predicted.half_width_mm:.2g}",
                                      share=f"{100.0 * result.predicted.coverage:.0f}"))

    def _outlines(self, layout, outlines):
        """Before and after, of what was fitted and what was held out; after, of each camera."""
        layout.label(text="Overlap of Outlines [%]")
        self._table(layout, "", [
            (title, map(fit_outlines.percent, overlaps))
            for title, overlaps in (("Fitted", outlines.fitted), ("Held Out", outlines.held_out)) if overlaps])
        if len(outlines.cameras) < 2:
            return
        shown = outlines.worst(_CAMERAS)
        layout.label(text="Overlap by Camera [%]" if len(shown) == len(outlines.cameras) else
                     "Worst Cameras, Overlap [%]")
        captures = dict.fromkeys(camera.capture for camera in shown)
        for capture in captures:
            column = layout.column()
            if len(captures) > 1:
                lines(column, capture)
            self._cameras(column, [camera for camera in shown if camera.capture == capture],
                          outlines.held_out is not None)

    def _cameras(self, column, cameras, held_out):
        row = column.row()
        for title in ("Camera", "Fitted", *(("Held Out",) if held_out else ())):
            row.label(text=title)
        for camera in cameras:
            row = column.row()
            row.label(text=str(camera.number), translate=False)
            for overlap in (camera.fitted, *((camera.held_out,) if held_out else ())):
                row.label(text=fit_outlines.percent(overlap), translate=False)

    def _table(self, layout, unit, rows):
        column = layout.column()
        row = column.row()
        for title in (unit, "Before", "After"):
            row.label(text=title)
        for title, values in rows:
            row = column.row()
            row.label(text=title)
            for value in values:
                row.label(text=value, translate=False)

    def _estimate(self, layout, settings, label, estimate):
        column = layout.box().column(align=True)
        lines(column, label,
              icon="CHECKMARK" if estimate.observable and not estimate.at_bound else "ERROR", taken=BOX)
        if estimate.observable:
            lines(column, estimate.text, taken=BOX)
        else:
            lines(column, translate("{value}, not observable").format(
                value=number_text.value_text(estimate.value, None, estimate.unit)), taken=BOX)
        if estimate.grid_error and estimate.observable:
            lines(column, translate("Grid: ± {error}").format(
                error=number_text.rounded(estimate.grid_error, estimate.grid_error)), taken=BOX)
        if estimate.interval is not None and estimate.observable:
            low, high = (number_text.rounded(value, estimate.error)
                         for value in estimate.interval)
            lines(column, translate("95 %: {low} to {high}").format(low=low, high=high), taken=BOX)
        if estimate.at_bound:
            column.label(text="At its bound")
        if estimate.statement:
            lines(column, words.of_result(estimate.statement, settings), taken=BOX)

    def _like(self, layout, settings, body, like):
        """The nearest known law, its formula with numbers, and how far off it is."""
        column = layout.box().column(align=True)
        title = translate("Most like {law}").format(law=translate_label(laws.name_of(like.law)))
        lines(column, f"{body}: {title}" if body else title, icon="LIGHT", taken=BOX)
        lines(column, words.of_result(like.sentence.partition(": ")[2] or like.sentence, settings), taken=BOX)
        if like.others:
            lines(column, translate("Then: {laws}").format(laws=", ".join(
                f"{translate_label(laws.name_of(law))} {_percent(distance)}"
                for law, distance in like.others[:_OTHERS])), taken=BOX)

    def _code(self, layout, label, estimates):
        """Numbers that say something together only: how many the recording identifies."""
        column = layout.box().column(align=True)
        known = sum(estimate.observable for estimate in estimates)
        bound = sum(estimate.at_bound for estimate in estimates)
        lines(column, label, icon="CHECKMARK" if known and not bound else "ERROR", taken=BOX)
        lines(column, translate("{n} of {total} numbers are identified").format(
            n=known, total=len(estimates)), taken=BOX)
        if bound:
            lines(column, translate("{n} at their bounds").format(n=bound), taken=BOX)

    def _models(self, layout, settings, result):
        box = layout.column()
        row = box.row()
        for title in ("Held Out", "Probability"):
            row.label(text=title)
        for place, model in enumerate(result.models):
            lines(box, translate_label(laws.name_of(model.get("law", ""))),
                  icon="CHECKMARK" if place == 0 else "NONE")
            if model.get("failed"):
                lines(box, words.of_result(str(model["failed"]), settings), icon="ERROR")
                continue
            row = box.row()
            row.label(text=_millimetres(model.get("held_out_mm")), translate=False)
            row.label(text=_number(model.get("probability"), 2), translate=False)
            if model.get("left"):
                lines(box, words.of_result(str(model.get("reason", "")), settings))


def _has_tracks(result):
    """Whether there are errors in mm: of images alone there are none."""
    return bool(result.fitted.after) or result.outlines is None


def _without_like(statement, likes):
    """A statement without the sentences that stand in boxes of their own."""
    for body, like in likes.items():
        statement = statement.removeprefix(f"{body}: {like.sentence}").strip()
    return statement


def _percent(share):
    return f"{100.0 * share:.2g} %" if share < 1.0 else "> 100 %"


def _millimetres(value):
    text = _number(value, 4)
    return text if text == "–" else f"{text} mm"


def _number(value, digits):
    return number_text.short(value, digits) if isinstance(value, int | float) else "–"


CLASSES = (MATTERFIT_PT_fit_result,)
