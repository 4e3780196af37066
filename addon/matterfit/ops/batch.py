# SPDX-License-Identifier: GPL-3.0-or-later
"""Batch: the active take with other values, baked, compared or fitted side by side here or on a
farm."""

import contextlib
import os

import bpy
from bpy.props import EnumProperty

from .. import jobs, machine, native
from ..compat import translate
from ..io import batch, batch_results, fit_apply, fit_rows, job_document, takes
from ..jobs import EXIT_INPUT, JobError
from ..props import compare
from ..props import scene as scene_props
from .base import NoJobRunning, PlainOperator, greyed, remove_active, report_left, session
from .compare import require_capture
from .job_operator import JobOperator
from .launch import apart, preparing
from .materials import tell

_items = []  # Blender keeps no reference to the texts of an enumeration


def _candidates(_self, context):
    found = batch.candidates(context.scene.matterfit)
    several = len({owner for owner, _key, _label in found}) > 2
    _items[:] = [(f"{owner}\t{key}", f"{owner}: {label}" if owner and several else label, "", index)
                 for index, (owner, key, label) in enumerate(found)]
    return _items


class MATTERFIT_OT_add_axis(PlainOperator, bpy.types.Operator):
    bl_idname = "matterfit.add_axis"
    bl_label = "Vary"
    bl_description = "Choose a quantity that the batch varies"

    quantity: EnumProperty(name="Quantity", items=_candidates, description="What is varied")

    def act(self, context):
        settings = context.scene.matterfit
        owner, _tab, key = self.quantity.partition("\t")
        rows = settings.batch.axes
        if any((row.owner, row.key) == (owner, key) for row in rows):
            raise JobError(translate("This quantity is varied already."))
        row = rows.add()
        row.owner, row.key = owner, key
        label = next(item[2] for item in batch.candidates(settings) if item[:2] == (owner, key))
        row.name = f"{owner} {label}".strip()
        settings.batch.axis_index = len(rows) - 1


class MATTERFIT_OT_remove_axis(PlainOperator, bpy.types.Operator):
    bl_idname = "matterfit.remove_axis"
    bl_label = "Remove Quantity"
    bl_description = "The batch no longer varies the active quantity"

    @classmethod
    def poll(cls, context):
        return greyed(cls, not context.scene.matterfit.batch.axes, "Nothing is varied")

    def act(self, context):
        remove_active(context.scene.matterfit.batch, "axes", "axis_index")


def preparing_base(context):
    """(document that is varied, assignments, the batch's folder); its inputs are written there. A
    generator as preparing() is."""
    takes.require_saved()
    native.require()
    settings = context.scene.matterfit
    task = settings.batch.task
    if task == "COMPARE":
        require_capture(settings)
    if task == "FIT":
        fit_rows.refresh(settings)
    source, run = takes.ensure_active(settings), batch.home(settings, task)
    with takes.claiming(context.scene, run, like=source) as folder:
        document, replaced = yield from preparing(context, run, folder, task.lower())
        if task == "COMPARE":
            document["output"]["bake"] = True  # so that there is something to see
        try:
            axes = batch.assignments(settings, document["scene"])
        except JobError:
            replaced.put_back()
            raise
    replaced.end()
    return document, axes, folder


class MATTERFIT_OT_run_batch(JobOperator, bpy.types.Operator):
    bl_idname = "matterfit.run_batch"
    bl_label = "Run Batch"
    bl_description = ("Bake, compare or fit the active take once for each combination of the "
                      "values. Those that are finished are kept: pressed again it goes on")
    restart_advice = "Press Free in Batch, or change the values back."
    _task = ""  # what is done; another may be chosen while it runs

    @classmethod
    def poll(cls, context):
        return super().poll(context) and greyed(
            cls, not context.scene.matterfit.batch.axes, "Choose what is varied first")

    def begin(self, context):
        document, axes, folder = yield from preparing_base(context)
        settings = context.scene.matterfit
        at_once, threads = settings.batch.at_once, settings.solver.threads
        self._task = settings.batch.task

        def start():
            path = job_document.write(document, folder)
            return native.wedge_start(path, axes, folder, at_once, threads)

        # What a batch varies moves no body, so that the base tells it of all.
        return jobs.Job(translate("Batch"), lambda: apart(document, folder, threads, start),
                        folder=folder, resumable=True, resume="matterfit.run_batch")

    def progress_mark(self, context, job):
        return job.snapshot.stage

    def progressed(self, context, job):
        batch_results.show(context.scene, self._task)

    def stopped(self, context, job):
        if job.status != EXIT_INPUT or job.result:
            with contextlib.suppress(JobError):  # why it stopped is reported
                batch_results.show(context.scene, self._task)

    def ended(self, context, job):
        shown, count = batch_results.show(context.scene, self._task)
        session(context).last_report = report_text(context.scene.matterfit, self._task, shown, count)


def report_text(settings, task, shown, count):
    """What a batch says: how many are there, and which is the best."""
    words = (translate("Batch: {n} of {total} are fitted") if task == "FIT" else
             translate("Batch: {n} of {total} are takes now"))
    said = [words.format(n=shown, total=count)]
    best = next(iter(settings.batch.results), None)
    if best is not None and best.error >= 0.0:
        said.append(translate("Best: {values} with {error}").format(
            values=best.name, error=batch_results.error_text(best.error)))
    return "\n".join(said)


class MATTERFIT_OT_write_batch(NoJobRunning, PlainOperator, bpy.types.Operator):
    bl_idname = "matterfit.write_batch"
    bl_label = "Write Jobs"
    bl_description = ("Write a document for each combination, to be baked, compared or fitted, and "
                      "the file that the farm takes; nothing is simulated")

    def act(self, context):
        document, axes, folder = jobs.drained(preparing_base(context))
        settings = context.scene.matterfit.batch
        path = job_document.write(document, folder)
        found = native.wedge_write(path, axes, folder,
                                   "" if settings.farm == "NONE" else settings.farm.lower(),
                                   machine.tool())
        told = translate("{n} jobs in {folder}").format(n=len(found["members"]), folder=folder)
        session(context).last_report = "\n".join([told, *found["files"]])
        self.report({"INFO"}, told)


class MATTERFIT_OT_show_batch(NoJobRunning, PlainOperator, bpy.types.Operator):
    bl_idname = "matterfit.show_batch"
    bl_label = "Load Results"
    bl_description = ("Show what a farm has finished by now: what is baked becomes a take, errors are "
                      "listed")

    def act(self, context):
        task = context.scene.matterfit.batch.task
        shown, count = batch_results.show(context.scene, task)
        said = report_text(context.scene.matterfit, task, shown, count)
        session(context).last_report = said
        self.report({"INFO"}, said)


class MATTERFIT_OT_apply_batch(NoJobRunning, PlainOperator, bpy.types.Operator):
    bl_idname = "matterfit.apply_batch"
    bl_label = "Apply to Body"
    bl_description = ("Put what the fit of the active row has found where it belongs, with the values "
                      "that it was given, so that bakes use them")

    @classmethod
    def poll(cls, context):
        rows = context.scene.matterfit.batch
        row = scene_props.active_item(rows.results, rows.result_index)
        return super().poll(context) and greyed(
            cls, rows.task != "FIT" or row is None or row.error < 0.0,
            "Choose a combination that is fitted")

    def act(self, context):
        settings = context.scene.matterfit
        folder, given = batch_results.fit_of_active(settings)
        left = fit_apply.apply_run(context.scene, folder, settings.batch.fits, given)
        compare.forget(settings)
        tell(self, context, translate("The fitted values are set. Bake or Compare uses them"), left)


class MATTERFIT_OT_free_batch(NoJobRunning, PlainOperator, bpy.types.Operator):
    bl_idname = "matterfit.free_batch"
    bl_label = "Free Batch"
    bl_description = "Remove the batch's takes and delete its caches"
    bl_options = {"UNDO"}

    @classmethod
    def poll(cls, context):
        rows = context.scene.matterfit.batch
        return super().poll(context) and greyed(
            cls, not (rows.run.folder or rows.fits.folder), "There is no batch to delete")

    def invoke(self, context, event):
        return context.window_manager.invoke_confirm(self, event)

    def act(self, context):
        left = batch.free(context.scene)
        session(context).last_report = ""  # that its results are takes
        if left:
            folder = os.path.commonpath([os.path.dirname(name) for name in left])
            report_left(self, folder, [os.path.relpath(name, folder) for name in left])


CLASSES = (MATTERFIT_OT_add_axis, MATTERFIT_OT_remove_axis, MATTERFIT_OT_run_batch,
           MATTERFIT_OT_write_batch, MATTERFIT_OT_show_batch, MATTERFIT_OT_apply_batch,
           MATTERFIT_OT_free_batch)
