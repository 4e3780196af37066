# SPDX-License-Identifier: GPL-3.0-or-later
"""Fit, Resume and Free of a fit, and the list of its parameters."""

import contextlib
import os

import bpy

from .. import jobs, native
from ..compat import translate
from ..io import cache, fit_outlines, fit_results, fit_rows, job_document, takes, words
from ..jobs import JobError, State
from .base import NoJobRunning, PlainOperator, greyed, report_left, session
from .job_operator import JobOperator
from .launch import AFRESH_WHERE_CHANGED, GO_ON, prepare, preparing, start_job


class FitJob(JobOperator):
    """What Fit, Resume and Diagnose share. The fit has a cache of its own, apart from the takes'."""

    restart_advice = "Press Fit to begin afresh."
    task = "fit"
    resume_operator = "matterfit.resume_fit"
    _before = None  # takes.Kept of what the fit was until now
    _result_before = None

    def begin_at_scene(self, context, label):
        """The job of what the scene is now; an unfinished fit of the very same inputs goes on, since
        hours of it are not thrown away."""
        takes.require_saved()
        native.require()
        settings = context.scene.matterfit
        fit_rows.refresh(settings)
        run = settings.fit.run
        self._before = takes.Kept(run)
        folder = ""
        try:
            takes.for_fit(settings)
            folder = takes.claim(run)
            job = yield from self.start(context, label, run, folder, AFRESH_WHERE_CHANGED)
        except BaseException:  # a generator that is left, too
            _scene, run = takes.still(context.scene, run, folder)
            if run is not None:
                self._before.put_back(run)
            raise
        job.stale = fit_results.history_stamp(folder)
        session(context).last_report = ""
        if not self._before.is_in(run) or bpy.data.is_dirty:
            session(context).last_report = translate(
                "Save the .blend file now: without that, a fit that is killed with Blender cannot "
                "be resumed")
        return job

    def start(self, context, label, run, folder, restart):
        """The job; JobError where it is refused before it starts."""
        prepared = yield from preparing(context, run, folder, self.task)
        self._result_before = fit_results.stamp(folder)
        return start_job(context, label.format(name=run.name), prepared, folder, restart,
                         resumable=True, resume=self.resume_operator)

    def progress_mark(self, context, job):
        return fit_results.history_stamp(job.folder)

    def progressed(self, context, job):
        _redraw_view(context)  # the curve lies in the scene

    def stopped(self, context, job):
        fit = self.settings_of(job)
        if job.untouched:
            # What lies in the folder is what an earlier fit has left.
            session(context).last_report = ""
            if fit is not None:
                if self._before is not None:
                    self._before.put_back(fit.run)
                folder = takes.locate(fit.run).folder
                fit.done = fit.done and fit_results.stamp(folder) is not None
            return
        # Cancelled: the best so far. Why it ended is reported, not what could not be read.
        with contextlib.suppress(JobError):
            self.show_result(context, job)

    def taken_away(self, context, job):
        self.stopped(context, job)

    def ended(self, context, job):
        result = self.show_result(context, job)
        warning = [result.warning] if result is not None and result.warning else []
        session(context).last_report = words.in_panel(
            "\n".join([summary(result, job), *warning, *job.result.get("notes", [])]),
            context.scene.matterfit)

    def settings_of(self, job):
        """The settings of the fit that the job is of; None where they are gone."""
        scene, run = takes.find(job.folder)
        return scene.matterfit.fit if scene is not None and run == scene.matterfit.fit.run else None

    def show_result(self, context, job):
        """The result; None where there is none but that of an earlier fit."""
        fit = self.settings_of(job)
        if fit is not None:
            fit.done = False
        _redraw_view(context)
        if job.state is not State.DONE and fit_results.stamp(job.folder) == self._result_before:
            return None
        result = fit_results.load(job.folder)
        if fit is not None:
            fit.done = True
        return result


def summary(result, job):
    """What a finished fit says in one line: the held-out error where there is one; of images alone how their
    outlines agree."""
    if not result.fitted.after and result.outlines is not None:
        return _outlines_summary(result.outlines, job)
    words, measure = translate("Fitted error {before} → {after} mm, in {time}"), result.fitted
    if result.held_out.after:
        words, measure = translate("Held-out error {before} → {after} mm, in {time}"), result.held_out
    return words.format(before=error_text(measure.before), after=error_text(measure.after),
                        time=jobs.duration_text(job.elapsed))


def _outlines_summary(outlines, job):
    words = translate("Fitted outlines overlap by {before} → {after} %, in {time}")
    if outlines.held_out:
        words = translate("Fitted outlines overlap by {before} → {after} %, held-out ones by {held_before} → "
                          "{held_after} %, in {time}")
    before, after = map(fit_outlines.percent, outlines.fitted or (None, None))
    held_before, held_after = map(fit_outlines.percent, outlines.held_out or (None, None))
    return words.format(before=before, after=after, held_before=held_before, held_after=held_after,
                        time=jobs.duration_text(job.elapsed))


def error_text(measure):
    """The mean error [mm] of one of a result's measures; – where there is none."""
    mean = (measure or {}).get("mean_mm")
    return f"{mean:.4g}" if isinstance(mean, int | float) else "–"


def linked_text(location):
    """Whose the fit is that this scene only shows."""
    if location.shared:
        return translate("This fit is that of the scene that was copied, and is linked, read-only. "
                         "Press Fit to make one of its own.")
    return translate("This fit belongs to another .blend file and is linked, read-only. Press Fit "
                     "to make one of its own.")


def _redraw_view(context):
    for area in context.screen.areas if context.screen else ():
        if area.type == "VIEW_3D":
            area.tag_redraw()


class MATTERFIT_OT_fit(FitJob, bpy.types.Operator):
    bl_idname = "matterfit.fit"
    bl_label = "Fit"
    bl_description = ("Find the parameters with which the simulation follows the captures, with "
                      "their uncertainty; Cancel keeps the best so far. The scene is not changed")

    def begin(self, context):
        return (yield from self.begin_at_scene(context, translate("Fit {name}")))


class _HasFit(NoJobRunning):
    @classmethod
    def poll(cls, context):
        return super().poll(context) and greyed(
            cls, not context.scene.matterfit.fit.run.folder, "Nothing was fitted yet: press Fit")


class MATTERFIT_OT_resume_fit(_HasFit, FitJob, bpy.types.Operator):
    bl_idname = "matterfit.resume_fit"
    bl_label = "Resume Fit"
    bl_description = ("Go on from the last checkpoint of a fit that was cancelled or killed, to the "
                      "result of an unbroken one; refused where the scene has changed since")

    def begin(self, context):
        takes.require_saved()
        native.require()
        run = context.scene.matterfit.fit.run
        location = takes.locate(run)
        if location.linked:
            raise JobError(linked_text(location))
        if not os.path.isfile(os.path.join(location.folder, job_document.JOB_FILE)):
            raise JobError(translate("{path} does not exist: nothing was fitted yet. Press Fit.")
                           .format(path=os.path.join(location.folder, job_document.JOB_FILE)))
        return (yield from self.start(context, translate("Resume {name}"), run, location.folder, GO_ON))


class MATTERFIT_OT_free_fit(_HasFit, PlainOperator, bpy.types.Operator):
    bl_idname = "matterfit.free_fit"
    bl_label = "Free Fit"
    bl_description = ("Delete the fit's cache with its result. Only files that the cache's own "
                      "lists name are deleted; what was applied stays")
    bl_options = {"UNDO"}

    def invoke(self, context, event):
        return context.window_manager.invoke_confirm(self, event)

    def act(self, context):
        fit = context.scene.matterfit.fit
        location = takes.locate(fit.run)
        left = []
        if location.exists and not location.linked:
            left = cache.free(location.folder)
        fit.done = False
        if not left:
            fit.run.folder = ""
            return
        report_left(self, location.folder, left)


class MATTERFIT_OT_write_fit_job(NoJobRunning, PlainOperator, bpy.types.Operator):
    bl_idname = "matterfit.write_fit_job"
    bl_label = "Write Job"
    bl_description = ("Write job.json and its input files into the fit's cache folder, for the "
                      "matterfit tool or a farm; nothing is computed. Resume takes up what was "
                      "done there")
    bl_options = {"UNDO"}

    def act(self, context):
        takes.require_saved()
        settings = context.scene.matterfit
        fit_rows.refresh(settings)
        fit = settings.fit
        before = takes.Kept(fit.run)
        try:
            takes.for_fit(settings)
            folder = takes.claim(fit.run)
            document, replaced = prepare(context, fit.run, folder, "fit")
        except BaseException:
            before.put_back(fit.run)
            raise
        # A result that lies there is of another job, unless that is still the same.
        fit.done = fit.done and replaced.is_of(document)
        replaced.end()
        path = job_document.write(document, folder)
        session(context).last_report = path
        self.report({"INFO"}, path)


class MATTERFIT_OT_list_parameters(PlainOperator, bpy.types.Operator):
    bl_idname = "matterfit.list_parameters"
    bl_label = "List Parameters"
    bl_description = "Bring the list of what can be fitted up to date with Bodies and Solver"

    def act(self, context):
        fit_rows.refresh(context.scene.matterfit)


CLASSES = (MATTERFIT_OT_fit, MATTERFIT_OT_resume_fit, MATTERFIT_OT_free_fit,
           MATTERFIT_OT_write_fit_job, MATTERFIT_OT_list_parameters)
