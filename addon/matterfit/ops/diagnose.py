# SPDX-License-Identifier: GPL-3.0-or-later
"""Diagnose: what the fitted simulation gets wrong, and what becomes of the cause."""

import os
import pathlib

import bpy
from bpy.props import BoolProperty, IntProperty

from .. import jobs
from ..compat import translate
from ..io import diagnosis, extend_model, fit_results, takes, words
from ..jobs import JobError
from ..props import compare
from ..props import scene as scene_props
from ..props.diagnosis import set_ignored
from .base import NeedsTracks, NoJobRunning, PlainOperator, greyed, session
from .fit import FitJob


class MATTERFIT_OT_diagnose(NeedsTracks, FitJob, bpy.types.Operator):
    bl_idname = "matterfit.diagnose"
    bl_label = "Diagnose"
    bl_description = ("Find what the fitted simulation gets wrong beyond noise and grid, name the "
                      "cause, and measure what it gains on held-out data. Fits first where there is "
                      "no fit of the same inputs. The scene is not changed")

    restart_advice = "Press Diagnose to begin afresh."
    task = "diagnose"
    resume_operator = "matterfit.diagnose"

    def begin(self, context):
        return (yield from self.begin_at_scene(context, translate("Diagnose {name}")))

    def ended(self, context, job):
        self.show_result(context, job)
        report = diagnosis.load(job.folder)
        if report is None:
            raise JobError(translate("{path} does not exist: the diagnosis has left no report. "
                                     "Diagnose again.").format(
                                         path=os.path.join(job.folder, diagnosis.REPORT_FILE)))
        scene, _run = takes.find(job.folder)
        if scene is not None:
            scene.matterfit.diagnosis.cause_index = 0
        session(context).last_report = words.in_panel("\n".join([
            report.sentence, translate("Diagnosed in {time}").format(
                time=jobs.duration_text(job.elapsed)), *report.statements]),
            context.scene.matterfit)


class HasReport(NoJobRunning):
    """Mixin: the scene's fit was diagnosed."""

    @classmethod
    def poll(cls, context):
        run = context.scene.matterfit.fit.run
        none = not run.folder or diagnosis.stamp(takes.locate(run).folder) is None
        return super().poll(context) and greyed(
            cls, none, "Nothing was diagnosed yet: press Diagnose")


def fit_folder(context):
    """Where the report lies."""
    return takes.locate(context.scene.matterfit.fit.run).folder


class MATTERFIT_OT_extend_model(HasReport, PlainOperator, bpy.types.Operator):
    bl_idname = "matterfit.extend_model"
    bl_label = "Extend Model"
    bl_description = ("Put the active cause into the scene: its own setting where it has one, else "
                      "the list of effects, where it can be edited, keyed and switched off; and what was "
                      "fitted, as it is beside the cause. Fit again afterwards to refine both")

    def act(self, context):
        scene, folder = context.scene, fit_folder(context)
        settings = scene.matterfit
        report = diagnosis.load(folder)
        if not diagnosis.is_of_fit(report, fit_results.load(folder)):
            raise JobError(translate("The diagnosis is of an earlier fit. Diagnose again."))
        cause = scene_props.active_item(report.causes, settings.diagnosis.cause_index)
        if cause is None:
            raise JobError(translate("The diagnosis names no cause to extend the model by."))
        left = extend_model.extend(scene, folder, report, cause)
        compare.forget(settings)
        said = translate("The model is extended, with what was fitted beside it. Fit again to refine both")
        session(context).last_report = "\n".join([said, *left])
        self.report({"INFO"}, said)
        for sentence in left:
            self.report({"WARNING"}, sentence)


class MATTERFIT_OT_open_report(HasReport, PlainOperator, bpy.types.Operator):
    bl_idname = "matterfit.open_report"
    bl_label = "Open Report"
    bl_description = "Open the report of the diagnosis, one page that needs no network, in the browser"
    bl_options = set()

    def act(self, context):
        path = os.path.join(fit_folder(context), diagnosis.PAGE_FILE)
        if not os.path.isfile(path):
            raise JobError(translate("{path} does not exist: the diagnosis has left no page. "
                                     "Diagnose again.").format(path=path))
        bpy.ops.wm.url_open(url=pathlib.Path(path).as_uri())


class MATTERFIT_OT_diagnosis_jump(PlainOperator, bpy.types.Operator):
    bl_idname = "matterfit.diagnosis_jump"
    bl_label = "Jump to Frame"
    bl_description = "Go to this frame, one of those in which the simulation is farthest off"
    bl_options = {"INTERNAL"}

    frame: IntProperty(name="Frame", default=0, min=0, max=1048574, soft_max=10000,
                       description="Scene frame")

    def act(self, context):
        context.scene.frame_set(self.frame)


class MATTERFIT_OT_diagnosis_cause(PlainOperator, bpy.types.Operator):
    bl_idname = "matterfit.diagnosis_cause"
    bl_label = "Show Cause"
    bl_description = "Show the evidence of this cause below; Extend Model takes it"
    bl_options = {"INTERNAL"}

    index: IntProperty(name="Cause", default=0, min=0, max=100000, soft_max=100,
                       description="Its place in the table, from 0")

    def act(self, context):
        context.scene.matterfit.diagnosis.cause_index = self.index


class MATTERFIT_OT_ignore_cause(HasReport, PlainOperator, bpy.types.Operator):
    bl_idname = "matterfit.ignore_cause"
    bl_label = "Ignore"
    bl_description = ("Extend Model leaves this cause alone, in this diagnosis and in later ones, until it is "
                      "accepted again; jobs that are written say so too")

    index: IntProperty(name="Cause", default=0, min=0, max=100000, soft_max=100,
                       description="Its place in the table, from 0")
    ignored: BoolProperty(name="Ignored", default=True, options={"SKIP_SAVE"},
                          description="Off: it may extend the model again")

    def act(self, context):
        settings = context.scene.matterfit
        report = diagnosis.load(fit_folder(context))
        if not 0 <= self.index < len(report.causes):
            raise JobError(translate("The diagnosis has no such cause any more."))
        set_ignored(settings, report.causes[self.index].effect, self.ignored)


CLASSES = (MATTERFIT_OT_diagnose, MATTERFIT_OT_extend_model, MATTERFIT_OT_open_report,
           MATTERFIT_OT_diagnosis_jump, MATTERFIT_OT_diagnosis_cause, MATTERFIT_OT_ignore_cause)
