# SPDX-License-Identifier: GPL-3.0-or-later
"""What is done with a take's cache beside baking it: Free, Write Job; Cancel and Estimate."""

import os
import tempfile

import bpy

from .. import jobs, native
from ..compat import translate
from ..io import attached, cache, job_boxes, job_document, job_render, takes
from ..props import scene as scene_props
from .base import NoJobRunning, PlainOperator, greyed, redraw, report_left, session
from .job_operator import JobOperator
from .launch import judge_estimate, memory_limit, prepare


class HasCache(NoJobRunning):
    """Greyed, with the reason, until the active take has a cache."""

    @classmethod
    def poll(cls, context):
        take = scene_props.active_take(context.scene.matterfit)
        return super().poll(context) and greyed(
            cls, take is None or not take.folder, "This take was not baked yet: press Bake")


def discard_preview(scene):
    """Removes an earlier preview, its cache and its objects."""
    preview = scene.matterfit.preview
    if not preview.folder:
        return
    attached.detach(scene, preview)
    location = takes.locate(preview)
    if location.exists and not location.linked:
        cache.free(location.folder)
    preview.folder = ""
    preview.baked = False
    preview.frames_done = 0


class MATTERFIT_OT_free(NoJobRunning, PlainOperator, bpy.types.Operator):
    bl_idname = "matterfit.free"
    bl_label = "Free"
    bl_description = ("Delete the active take's cache and the objects that show it. Only files "
                      "that the cache's own lists name are deleted")
    bl_options = {"UNDO"}

    @classmethod
    def poll(cls, context):
        settings = context.scene.matterfit
        take = scene_props.active_take(settings)
        baked = settings.preview.folder or (take is not None and take.folder)
        return super().poll(context) and greyed(cls, not baked, "There is no cache to delete")

    def invoke(self, context, event):
        return context.window_manager.invoke_confirm(self, event)

    def act(self, context):
        scene = context.scene
        discard_preview(scene)
        take = scene_props.active_take(scene.matterfit)
        if take is None or not take.folder:
            return
        location = takes.locate(take)
        attached.detach(scene, take)
        left = []
        if location.exists and not location.linked:
            left = cache.free(location.folder)
            job_render.hide_removed(location.folder)
        take.baked = False
        take.frames_done = 0
        session(context).last_report = ""  # of the bake that was there
        compare = scene.matterfit.compare
        take.compared = compare.done = compare.images_done = False
        if not location.linked and not left:
            take.folder = ""
        report_left(self, location.folder, left)


class MATTERFIT_OT_cancel(bpy.types.Operator):
    bl_idname = "matterfit.cancel"
    bl_label = "Cancel"
    bl_description = "Stop the running job within a second; what is done is kept for Resume"

    @classmethod
    def poll(cls, _context):
        return jobs.registry.running is not None

    def execute(self, context):
        jobs.registry.running.cancel()
        redraw(context)
        return {"FINISHED"}


class MATTERFIT_OT_estimate(JobOperator, bpy.types.Operator):
    bl_idname = "matterfit.estimate"
    bl_label = "Estimate"
    bl_description = ("Count the particles, and say what memory and time a bake will need; one "
                      "frame is baked to see")
    bl_options = set()
    _document = None

    def begin(self, context):
        takes.require_saved()
        native.require()
        # The take's folder keeps the inputs of what was baked there.
        holder = tempfile.TemporaryDirectory(prefix="matterfit_")
        try:
            folder = os.path.realpath(holder.name)  # the document's paths climb from it by ..
            take = scene_props.active_take(context.scene.matterfit)
            self._document = yield from job_document.building(context.scene, take, folder, "bake")
        except BaseException:
            holder.cleanup()
            raise
        document, threads = self._document, context.scene.matterfit.solver.threads

        def ask():
            with holder:
                found = native.estimate(document, folder, threads)
                if (found.get("bytes", 0) <= memory_limit(document)
                        and job_boxes.may_overlap(document, folder)):
                    native.validate(document, folder, threads)
                return found

        return jobs.Job(translate("Estimate"), lambda: jobs.ThreadRun(ask, "Counting particles"))

    def ended(self, context, job):
        judge_estimate(context, self._document, job.result)


class MATTERFIT_OT_write_job(NoJobRunning, PlainOperator, bpy.types.Operator):
    bl_idname = "matterfit.write_job"
    bl_label = "Write Job"
    bl_description = ("Write job.json and its input files into the take's cache folder, for the "
                      "matterfit tool or a farm; nothing is simulated")
    bl_options = {"UNDO"}

    def act(self, context):
        takes.require_saved()
        take = takes.ensure_active(context.scene.matterfit)
        takes.require_own(take)
        with takes.claiming(context.scene, take) as folder:
            document, replaced = prepare(context, take, folder, "bake")
        replaced.end()
        path = job_document.write(document, folder)
        session(context).last_report = path
        self.report({"INFO"}, path)


CLASSES = (MATTERFIT_OT_free, MATTERFIT_OT_cancel, MATTERFIT_OT_estimate, MATTERFIT_OT_write_job)
