# SPDX-License-Identifier: GPL-3.0-or-later
"""Batch: the active take with other values, side by side here or on a farm."""

import contextlib
import os

import bpy
from bpy.props import EnumProperty

from .. import jobs, machine, native
from ..compat import translate
from ..io import batch, job_document, takes
from ..jobs import EXIT_INPUT, JobError
from .base import JobOperator, NoJobRunning, PlainOperator, greyed, remove_active, session
from .launch import prepare

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


def written_base(context):
    """(path of the document that is varied, assignments); its folder is the batch's."""
    takes.require_saved()
    native.require()
    settings = context.scene.matterfit
    source, run = takes.ensure_active(settings), settings.batch.run
    run.name = translate("Batch")
    takes.copy_settings(source, run)
    folder = takes.claim(run)
    document, replaced = prepare(context, run, folder, "bake")
    try:
        axes = batch.assignments(settings, document["scene"])
    except JobError:
        replaced.put_back()
        raise
    replaced.end()
    return job_document.write(document, folder), axes


class MATTERFIT_OT_run_batch(JobOperator, bpy.types.Operator):
    bl_idname = "matterfit.run_batch"
    bl_label = "Run Batch"
    bl_description = ("Bake the active take once for each combination of the values; results "
                      "appear as takes. Those that are finished are kept: pressed again it goes on")
    restart_advice = "Press Free in Batch, or change the values back."

    @classmethod
    def poll(cls, context):
        return super().poll(context) and greyed(
            cls, not context.scene.matterfit.batch.axes, "Choose what is varied first")

    def begin(self, context):
        path, axes = written_base(context)
        settings = context.scene.matterfit
        folder, at_once = os.path.dirname(path), settings.batch.at_once
        threads = settings.solver.threads

        def start():
            return native.wedge_start(path, axes, folder, at_once, threads)

        return jobs.Job(translate("Batch"), start, folder=folder, resumable=True,
                        resume="matterfit.run_batch")

    def progress_mark(self, context, job):
        return job.snapshot.stage

    def progressed(self, context, job):
        batch.show(context.scene)

    def stopped(self, context, job):
        if job.status != EXIT_INPUT or job.result:
            with contextlib.suppress(JobError):  # why it stopped is reported
                batch.show(context.scene)

    def ended(self, context, job):
        shown, count = batch.show(context.scene)
        session(context).last_report = translate("Batch: {n} of {total} are takes now").format(
            n=shown, total=count)


class MATTERFIT_OT_write_batch(NoJobRunning, PlainOperator, bpy.types.Operator):
    bl_idname = "matterfit.write_batch"
    bl_label = "Write Jobs"
    bl_description = ("Write a document for each combination, and the file that the farm takes; "
                      "nothing is simulated")

    def act(self, context):
        path, axes = written_base(context)
        farm = context.scene.matterfit.batch.farm
        found = native.wedge_write(path, axes, os.path.dirname(path),
                                   "" if farm == "NONE" else farm.lower(), machine.tool())
        told = translate("{n} jobs in {folder}").format(n=len(found["members"]),
                                                        folder=os.path.dirname(path))
        session(context).last_report = "\n".join([told, *found["files"]])
        self.report({"INFO"}, told)


class MATTERFIT_OT_show_batch(NoJobRunning, PlainOperator, bpy.types.Operator):
    bl_idname = "matterfit.show_batch"
    bl_label = "Load Results"
    bl_description = "Show what a farm has finished by now: each becomes a take"

    def act(self, context):
        shown, count = batch.show(context.scene)
        self.report({"INFO"}, translate("Batch: {n} of {total} are takes now").format(
            n=shown, total=count))


class MATTERFIT_OT_free_batch(NoJobRunning, PlainOperator, bpy.types.Operator):
    bl_idname = "matterfit.free_batch"
    bl_label = "Free Batch"
    bl_description = "Remove the batch's takes and delete its caches"
    bl_options = {"UNDO"}

    @classmethod
    def poll(cls, context):
        return super().poll(context) and greyed(
            cls, not context.scene.matterfit.batch.run.folder, "There is no batch to delete")

    def invoke(self, context, event):
        return context.window_manager.invoke_confirm(self, event)

    def act(self, context):
        left = batch.free(context.scene)
        if left:
            self.report({"WARNING"}, translate(
                "{n} files in {folder} are not ours and stay: {names}").format(
                    n=len(left), folder=context.scene.matterfit.batch.run.folder,
                    names=", ".join(left[:5])))


CLASSES = (MATTERFIT_OT_add_axis, MATTERFIT_OT_remove_axis, MATTERFIT_OT_run_batch,
           MATTERFIT_OT_write_batch, MATTERFIT_OT_show_batch, MATTERFIT_OT_free_batch)
