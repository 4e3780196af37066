# SPDX-License-Identifier: GPL-3.0-or-later
"""Check: before a fit, which values the recording will identify, and how well."""

import os
import tempfile

import bpy

from .. import jobs, native
from ..compat import translate
from ..io import check, fit_rows, job_document, takes
from ..jobs import JobError
from ..props import scene as scene_props
from .base import NeedsTracks, greyed, session
from .job_operator import JobOperator
from .launch import counted


class MATTERFIT_OT_check_fit(NeedsTracks, JobOperator, bpy.types.Operator):
    bl_idname = "matterfit.check_fit"
    bl_label = "Check"
    bl_description = ("Report before a fit what this recording will identify: each value and to what "
                      "error, which values are tied, whether frame rate, duration and noise "
                      "suffice, and what to record instead. Takes a handful of simulations")
    restart_advice = "Press Check."
    _scene = ""  # the name of the one that is checked
    _asked = None

    def begin(self, context):
        takes.require_saved()
        native.require()
        scene = context.scene
        settings = scene.matterfit
        fit_rows.refresh(settings)
        # Nothing of it belongs to a cache: what was fitted keeps its document and inputs.
        holder = tempfile.TemporaryDirectory(prefix="matterfit_")
        try:
            folder = os.path.realpath(holder.name)  # the document's paths climb from it by ..
            take = scene_props.active_take(settings)
            document = yield from job_document.building(scene, take, folder, "fit")
            path = job_document.write(document, folder)
        except BaseException:
            holder.cleanup()
            raise
        self._scene, self._asked = scene.name, check.asked(scene)
        threads = settings.solver.threads
        return jobs.Job(
            translate("Check"),
            lambda: counted(document, folder, threads,
                            lambda: native.start(path, task="check", threads=threads)),
            on_end=lambda _job: holder.cleanup())

    def ended(self, context, job):
        scene = bpy.data.scenes.get(self._scene)
        if scene is None:
            return
        text = check.stored(job.result, self._asked)
        if check.read(text) is None:
            raise JobError(translate("Check: the result is none that this version reads. Install "
                                     "add-on and library from one package."))
        scene.matterfit.fit.check = text
        session(context).last_report = translate("Checked in {time}").format(
            time=jobs.duration_text(job.elapsed))


class MATTERFIT_OT_clear_check(bpy.types.Operator):
    bl_idname = "matterfit.clear_check"
    bl_label = "Clear Check"
    bl_description = "Hide what the last check found"
    bl_options = {"UNDO"}

    @classmethod
    def poll(cls, context):
        return greyed(cls, not context.scene.matterfit.fit.check, "Nothing was checked yet")

    def execute(self, context):
        context.scene.matterfit.fit.check = ""
        return {"FINISHED"}


CLASSES = (MATTERFIT_OT_check_fit, MATTERFIT_OT_clear_check)
