# SPDX-License-Identifier: GPL-3.0-or-later
import bpy

from ..compat import translate
from ..io import check, words
from .common import MatterfitPanel, lines


class MATTERFIT_PT_fit_check(MatterfitPanel, bpy.types.Panel):
    bl_label = "Before the Fit"
    bl_parent_id = "MATTERFIT_PT_fit"
    bl_order = 0
    bl_options = set()

    @classmethod
    def poll(cls, context):
        return bool(context.scene.matterfit.fit.check)

    def draw(self, context):
        layout = self.layout
        settings = context.scene.matterfit
        report = check.read(settings.fit.check)
        if report is None:
            lines(layout, translate("What was checked cannot be read. Check again."), icon="ERROR")
            return
        if report.asked != check.asked(context.scene):
            lines(layout, translate("Other recordings, frames or values are chosen now. Check "
                                    "again."), icon="ERROR")
        self._headline(layout, report)
        self._parameters(layout, settings, report)
        for tie in report.ties:
            lines(layout, translate(
                "Tied: {names}. Only a combination is identified: set one of them, and switch it off in "
                "the list.").format(names=check.listed(settings, tie)), icon="LINKED")
        for enough in report.enough:
            lines(layout, check.verdict(settings, enough, report.sigma),
                  icon="CHECKMARK" if enough.enough else "ERROR")
        if report.record_instead:
            lines(layout, translate("Record instead: {text}").format(
                text=words.of_result(report.record_instead, settings)), icon="INFO")
        for note in report.notes:
            lines(layout, words.of_result(note, settings), icon="INFO")
        layout.operator("matterfit.clear_check", text="Clear", icon="X")

    def _headline(self, layout, report):
        known, count = report.known, len(report.parameters)
        if known == count:
            lines(layout, translate("This recording identifies all of it:"), icon="CHECKMARK")
        else:
            lines(layout, translate("This recording identifies {n} of {total} values:").format(
                n=known, total=count), icon="ERROR")

    def _parameters(self, layout, settings, report):
        """A value and its error each: a name and a number do not fit beside each other."""
        box = layout.box()
        for parameter, label in check.rows(settings, report):
            column = box.column(align=True)
            lines(column, label, icon="CHECKMARK" if parameter.known else "ERROR")
            lines(column, check.error_text(settings, parameter))


CLASSES = (MATTERFIT_PT_fit_check,)
