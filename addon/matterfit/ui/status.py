# SPDX-License-Identifier: GPL-3.0-or-later
import bpy

from .. import compat, jobs, native
from ..io import words
from ..jobs import State
from ..ops import job_operator
from .common import BOX, MatterfitPanel, lines


class MATTERFIT_PT_status(MatterfitPanel, bpy.types.Panel):
    bl_label = "Status"
    bl_order = 0
    bl_options = set()

    def draw(self, context):
        layout = self.layout
        session = context.window_manager.matterfit
        if native.load():
            layout.label(text=f"Matterfit {native.version()}", icon="CHECKMARK", translate=False)
        else:
            lines(layout, native.load_error(), icon="ERROR")
        job = jobs.registry.running
        if job is not None:
            self._job(layout, job)
        elif jobs.registry.current is not None:
            self._ended(layout, jobs.registry.current)
        if session.last_error:
            box = layout.box()
            box.alert = True
            lines(box, session.last_error, icon="ERROR", taken=BOX)
            row = box.row()
            row.operator("matterfit.copy_error", icon="COPYDOWN")
            row.operator("matterfit.clear_error", icon="X")
        elif session.last_report:
            lines(layout, session.last_report, icon="INFO")

    def _job(self, layout, job):
        box = layout.box()
        lines(box, job.label, icon="TIME", taken=BOX)
        compat.progress_bar(box, job.fraction, f"{100.0 * job.fraction:.0f} %")
        snapshot = job.snapshot
        column = box.column(align=True)
        if snapshot.stage:
            lines(column, words.stage(snapshot.stage))
        if snapshot.last_frame:
            column.label(text=compat.translate("frame {n} of {total}").format(
                n=snapshot.frame, total=snapshot.last_frame), translate=False)
        left = jobs.duration_text(job.seconds_left)
        if left:
            column.label(text=compat.translate("{time} left").format(time=left), translate=False)
        if snapshot.memory:
            lines(column, job_operator.memory_text(snapshot))
        row = box.row()
        row.enabled = job.state is State.RUNNING
        row.operator("matterfit.cancel", icon="CANCEL")

    def _ended(self, layout, job):
        if job.state is State.CANCELLED:
            lines(layout, job_operator.cancelled_text(job), icon="CANCEL")
            if job.resumable:
                layout.operator(job.resume, icon="PLAY")


CLASSES = (MATTERFIT_PT_status,)
