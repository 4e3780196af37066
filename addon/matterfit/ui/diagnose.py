# SPDX-License-Identifier: GPL-3.0-or-later
import bpy

from ..compat import translate, translate_label
from ..io import diagnosis, fit_results, number_text, takes, words
from ..props import scene as scene_props
from ..props.diagnosis import is_ignored
from . import fit_overlay
from .common import BOX, MatterfitPanel, form, lines, switched

PROBABLE = 6  # causes in the table before All Causes is switched on

_ICONS = {"nothing": "CHECKMARK", "cause": "VIEWZOOM", "class": "VIEWZOOM", "several": "VIEWZOOM"}


class MATTERFIT_PT_diagnose(MatterfitPanel, bpy.types.Panel):
    bl_label = "Diagnose"
    bl_parent_id = "MATTERFIT_PT_compare"

    def draw(self, context):
        layout = self.layout
        settings = context.scene.matterfit
        row = layout.row()
        row.scale_y = 1.4
        row.operator("matterfit.diagnose", icon="VIEWZOOM")
        switched(form(layout), settings.diagnosis, "use_limit", "limit")
        run = settings.fit.run
        if not run.folder or fit_overlay.running_fit(settings):
            return
        folder = takes.locate(run).folder
        if diagnosis.stamp(folder) is None:
            return
        report = diagnosis.load_quietly(folder)
        if report is None:
            lines(layout, translate("The report of the diagnosis cannot be read. Diagnose again."),
                  icon="ERROR")
            return
        if not diagnosis.is_of_fit(report, fit_results.load_quietly(folder)):
            lines(layout, translate("This is of an earlier fit. Diagnose again."), icon="ERROR")
        lines(layout, words.of_result(report.sentence, settings), icon=_ICONS.get(report.verdict, "QUESTION"))
        self._causes(layout, settings, report)
        self._worst(layout, report)
        self._rest(layout, settings, report)
        if report.frames:
            form(layout).prop(settings.diagnosis, "show_graph", text="Graph")
        column = layout.column(align=True)
        column.operator("matterfit.preview_extended", icon="HIDE_OFF")
        column.operator("matterfit.extend_model", icon="ADD")
        column.operator("matterfit.open_report", icon="URL")

    def _causes(self, layout, settings, report):
        if not report.causes:
            return
        shown = settings.diagnosis
        box = layout.box()
        count = len(report.causes) if shown.show_all else PROBABLE
        for index, cause in enumerate(report.causes[:count]):
            column = box.column(align=True)
            active = index == shown.cause_index
            ignored = is_ignored(settings, cause.effect)
            row = column.row(align=True)
            pick_row = row.row(align=True)
            pick_row.active = not ignored
            pick = pick_row.operator(
                "matterfit.diagnosis_cause", icon="RADIOBUT_ON" if active else "RADIOBUT_OFF",
                text=f"{index + 1}  {translate_label(cause.label)}")
            pick.index = index
            switch = row.operator("matterfit.ignore_cause", text="", icon="HIDE_ON" if ignored else "HIDE_OFF")
            switch.index, switch.ignored = index, not ignored
            self._numbers(column, cause)
        if len(report.causes) > PROBABLE:
            form(layout).prop(shown, "show_all")
        cause = scene_props.active_item(report.causes, shown.cause_index)
        if cause is not None:
            self._evidence(layout, settings, cause, shown.cause_index)

    def _numbers(self, column, cause):
        """A line each for value ± error; probability and gain below."""
        for number in cause.numbers:
            lines(column, number.text if len(cause.numbers) == 1 else f"{number.label}: {number.text}")
        row = column.row()
        row.label(text=translate("{share} likely").format(share=percent(cause.probability)),
                  translate=False)
        row.label(text=translate("Gain {share}").format(share=gain_text(cause)), translate=False)
        if cause.explained is not None:
            column.label(text=translate("Explains {share}").format(share=percent(cause.explained)),
                         translate=False)

    def _evidence(self, layout, settings, cause, index):
        box = layout.box()
        lines(box, words.of_result(cause.sentence, settings), icon="CHECKMARK" if cause.accepted else "NONE", taken=BOX)
        if cause.where:
            lines(box, translate("Where: {place}").format(
                place=words.of_result(cause.where, settings)), taken=BOX)
        if cause.evidence:
            lines(box, words.of_result(cause.evidence, settings), taken=BOX)
        if cause.holdout_before is not None and cause.holdout_after is not None:
            lines(box, translate("Held-out error {before} → {after} mm").format(
                before=f"{1e3 * cause.holdout_before:.3g}",
                after=f"{1e3 * cause.holdout_after:.3g}"), taken=BOX)
        if cause.gain_interval is not None:
            low, high = cause.gain_interval
            lines(box, translate("Gain: {low} to {high} (95 %)").format(low=percent(low),
                                                                        high=percent(high)), taken=BOX)
        if cause.confused_with:
            lines(box, translate("Looks like: {names}").format(names=_names(cause.confused_with)), taken=BOX)
        if not cause.observable:
            lines(box, translate("This recording does not identify it."), icon="INFO", taken=BOX)
        ignored = is_ignored(settings, cause.effect)
        switch = box.operator("matterfit.ignore_cause", text="Accept" if ignored else "Ignore",
                              icon="CHECKMARK" if ignored else "X")
        switch.index, switch.ignored = index, not ignored

    def _worst(self, layout, report):
        if not report.worst:
            return
        layout.label(text="Worst Frames")
        several = len({worst.capture for worst in report.worst}) > 1
        column = layout.column(align=True)
        for worst in report.worst:
            text = translate("Frame {n}: {error} mm").format(n=worst.frame,
                                                             error=f"{1e3 * worst.size:.3g}")
            if several:
                text = f"{worst.capture}, {text}"
            column.operator("matterfit.diagnosis_jump", text=text, icon="TIME").frame = worst.frame

    def _rest(self, layout, settings, report):
        if report.not_observable:
            lines(layout, translate("Not observable: {names}").format(
                names=_names(report.not_observable)), icon="HIDE_ON")
        if report.next_recording:
            lines(layout, translate("Next recording: {text}").format(
                text=words.of_result(report.next_recording, settings)), icon="INFO")
        for statement in report.statements:
            lines(layout, words.of_result(statement, settings), icon="INFO")


def percent(share):
    """A share as people say it; a probability that rounds to all or nothing does not claim it."""
    if 0.0 < share < 0.01:
        return "< 1 %"
    if 0.99 < share < 1.0:
        return "> 99 %"
    return number_text.percent(share)


def gain_text(cause):
    """– where nothing was held out that would show it."""
    return "–" if cause.gain is None else number_text.percent(cause.gain)


def _names(effects):
    """Labels, each once."""
    return ", ".join(dict.fromkeys(translate_label(diagnosis.label_of(name)) for name in effects))


CLASSES = (MATTERFIT_PT_diagnose,)
