# SPDX-License-Identifier: GPL-3.0-or-later
"""Preview, Bake, Resume, Free, Cancel, and the estimate before a run."""

import contextlib
import os
import tempfile

import bpy

from .. import jobs, native
from ..compat import translate
from ..io import attach, cache, files, fit_results, job_document, takes
from ..jobs import EXIT_INPUT, JobError, State
from ..props import scene as scene_props
from .base import (
    JobOperator,
    NoJobRunning,
    PlainOperator,
    greyed,
    redraw,
    report_error,
    session,
)

# `restart` of a job: what becomes of results that the folder holds (native/capi/matterfit.h).
GO_ON, AFRESH, AFRESH_WHERE_CHANGED = 0, 1, 2


def check_estimate(context, document, folder):
    """The estimate of a run; JobError with the numbers where it will not fit."""
    estimate = native.estimate(document, folder)
    state = session(context)
    state.estimate = estimate_text(estimate)
    needed = estimate.get("bytes", 0)
    limit = document["scene"]["solver"]["memory_limit_gb"] * 1e9
    free = native.free_memory()
    state.estimate_fits = needed <= limit and (not free or needed <= free)
    if needed > limit:
        raise JobError(translate(
            "This needs about {needed} of memory, the limit is {limit}. Raise Particle Separation, "
            "or Memory Limit in Solver.").format(needed=jobs.size_text(needed),
                                                 limit=jobs.size_text(limit)))
    if free and needed > free:
        raise JobError(translate(
            "This needs about {needed} of memory, and {free} are free. Raise Particle Separation, "
            "or close other programs.").format(needed=jobs.size_text(needed),
                                               free=jobs.size_text(free)))
    return estimate


def estimate_text(estimate):
    parts = []
    particles = estimate.get("particles")
    if particles:
        parts.append(translate("{n} particles").format(n=f"{particles:,}".replace(",", " ")))
    memory = estimate.get("bytes")
    if memory:
        parts.append(translate("{size} of memory").format(size=jobs.size_text(memory)))
    disk = estimate.get("disk_bytes")
    if disk:
        parts.append(translate("{size} on disk").format(size=jobs.size_text(disk)))
    seconds = estimate.get("seconds")
    if seconds:
        parts.append(translate("about {time}").format(time=jobs.duration_text(seconds)))
    return ", ".join(parts)


def prepare(context, take, folder, task, estimate=True, **options):
    """(document, Replaced) of a run, with `estimate` of one that fits into memory; `options` are
    those of job_document.build(). The folder stays as it was where it raises."""
    replaced = job_document.Replaced(folder, task)
    try:
        document = job_document.build(context.scene, take, folder, task, **options)
        if estimate:
            check_estimate(context, document, folder)
    except Exception:
        replaced.put_back()
        raise
    return document, replaced


def start_job(context, label, prepared, folder, restart, **options):
    """A job on <folder>/job.json, which is written first: the file is what is run.

    GO_ON continues what the folder holds, which the library refuses where the inputs have changed.
    What was prepared (prepare()) is taken back where the run leaves the old results. `options` are
    a Job's.
    """
    threads = context.scene.matterfit.solver.threads
    document, replaced = prepared
    path = job_document.write(document, folder)

    def start():
        return native.start(path, task=document["task"], threads=threads, restart=restart)

    def ended(job):
        if job.state is State.DONE:
            replaced.end()
            return
        job.untouched = replaced.untouched()
        if document["task"] == "fit":
            ours = not job.untouched or replaced.is_of(document)
            job.resumable = ours and fit_results.is_unfinished(folder)
        # What is reported is why the job ended.
        with contextlib.suppress(JobError):
            replaced.put_back()

    return jobs.Job(label, start, folder=folder, on_end=ended, **options)


def written_document(folder):
    """The job document of a cache, or JobError."""
    path = os.path.join(folder, job_document.JOB_FILE)
    if not os.path.isfile(path):
        raise JobError(translate("{path} does not exist: this take was not baked yet. Press Bake.")
                       .format(path=path))
    return files.read_json(path)


def report_text(job):
    """What a finished bake says: frames and time, how the bodies were filled, notes."""
    result = job.result
    first, end = result.get("frames", (0, 0))
    parts = [translate("{name}: {n} frames in {time}").format(
        name=job.label, n=end - first, time=jobs.duration_text(job.elapsed))]
    parts += [f"{body['name']}: {body['fill']}" for body in result.get("bodies", [])
              if body.get("fill")]
    parts += result.get("notes", [])
    return "\n".join(parts)


class HasCache(NoJobRunning):
    """Greyed, with the reason, until the active take has a cache."""

    @classmethod
    def poll(cls, context):
        take = scene_props.active_take(context.scene.matterfit)
        return super().poll(context) and greyed(
            cls, take is None or not take.folder, "This take was not baked yet: press Bake")


class BakeJob(JobOperator):
    """What Bake, Resume and Preview share: the cache is attached as it grows."""

    def progressed(self, context, job):
        # Until its first frame is done the job may be refused, and what is shown stays.
        if job.snapshot.frame > written_document(job.folder)["scene"]["frames"][0]:
            self.show(context, job)

    def stopped(self, context, job):
        if job.status == EXIT_INPUT:
            return
        # The reason why the job stopped is reported, not what could not be shown of it.
        with contextlib.suppress(Exception):
            self.show(context, job)

    def ended(self, context, job):
        take = self.show(context, job, final=True)
        if take is not None:
            take.baked = True
        session(context).last_report = report_text(job)

    def show(self, context, job, final=False):
        scene, take = takes.find(job.folder)
        if take is None:
            return None
        document = written_document(job.folder)
        first, end = document["scene"]["frames"]
        take.first_frame, take.frame_count = first, end - first
        shown = attach.Attachment(scene, take, job.folder, document)
        take.frames_done = shown.update(final)
        if take == scene.matterfit.preview:
            attach.show_only(scene.matterfit, take)
        else:
            attach.show_take(scene.matterfit)
        return take


class MATTERFIT_OT_bake(BakeJob, bpy.types.Operator):
    bl_idname = "matterfit.bake"
    bl_label = "Bake"
    bl_description = ("Simulate the active take and write its caches beside the .blend file; "
                      "frames appear as they are done")

    def begin(self, context):
        takes.require_saved()
        native.require()
        scene = context.scene
        take = takes.ensure_active(scene.matterfit)
        discard_preview(scene)
        folder = takes.claim(take)
        prepared = prepare(context, take, folder, "bake")
        scene.matterfit.compare.done = False
        # States of the very same inputs are used again: another output bakes without simulating.
        return start_job(context, translate("Bake {name}").format(name=take.name), prepared,
                         folder, AFRESH_WHERE_CHANGED, resumable=True)


class MATTERFIT_OT_resume(HasCache, BakeJob, bpy.types.Operator):
    bl_idname = "matterfit.resume"
    bl_label = "Resume"
    bl_description = ("Go on from the last checkpoint of a bake that was cancelled or killed; "
                      "refused where the scene has changed since")

    def begin(self, context):
        takes.require_saved()
        native.require()
        scene = context.scene
        take = scene_props.active_take(scene.matterfit)
        if take is None or not take.folder:
            raise JobError(translate("This take was not baked yet. Press Bake."))
        location = takes.locate(take)
        if location.linked:
            raise JobError(translate("This take belongs to another .blend file and is linked, "
                                     "read-only. Press Bake to make one of its own."))
        written_document(location.folder)
        prepared = prepare(context, take, location.folder, "bake")
        return start_job(context, translate("Resume {name}").format(name=take.name), prepared,
                         location.folder, GO_ON, resumable=True)


class MATTERFIT_OT_preview(BakeJob, bpy.types.Operator):
    bl_idname = "matterfit.preview"
    bl_label = "Preview"
    bl_description = ("Simulate the active take coarsely, particles only, to see roughly what "
                      "happens; no take is changed")

    def begin(self, context):
        takes.require_saved()
        native.require()
        scene = context.scene
        settings = scene.matterfit
        source = takes.ensure_active(settings)
        discard_preview(scene)
        preview = settings.preview
        preview.name = translate("Preview")
        takes.copy_settings(source, preview)
        folder = takes.claim(preview)
        separation = (settings.solver.particle_separation * scene.unit_settings.scale_length
                      * session(context).preview_scale)
        prepared = prepare(context, preview, folder, "bake", quality="preview",
                           separation=separation, outputs=False)
        return start_job(context, translate("Preview"), prepared, folder, AFRESH)


def discard_preview(scene):
    """Removes an earlier preview, its cache and its objects."""
    preview = scene.matterfit.preview
    if not preview.folder:
        return
    attach.detach(scene, preview)
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
        attach.detach(scene, take)
        left = []
        if location.exists and not location.linked:
            left = cache.free(location.folder)
        take.baked = False
        take.frames_done = 0
        scene.matterfit.compare.done = False
        if not location.linked and not left:
            take.folder = ""
        if left:
            self.report({"WARNING"}, translate(
                "{n} files in {folder} are not ours and stay: {names}").format(
                    n=len(left), folder=location.folder, names=", ".join(left[:5])))
        return


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


class MATTERFIT_OT_estimate(NoJobRunning, bpy.types.Operator):
    bl_idname = "matterfit.estimate"
    bl_label = "Estimate"
    bl_description = "Count the particles, and say what memory and time a bake will need"
    bl_options = set()

    def execute(self, context):
        scene = context.scene
        try:
            takes.require_saved()
            native.require()
            # The take's folder keeps the inputs of what was baked there.
            with tempfile.TemporaryDirectory(prefix="matterfit_") as folder:
                folder = os.path.realpath(folder)  # the document's paths climb from it by ..
                take = scene_props.active_take(scene.matterfit)
                document = job_document.build(scene, take, folder, "bake")
                check_estimate(context, document, folder)
        except JobError as error:
            return report_error(self, context, str(error))
        redraw(context)
        return {"FINISHED"}


class MATTERFIT_OT_write_job(NoJobRunning, PlainOperator, bpy.types.Operator):
    bl_idname = "matterfit.write_job"
    bl_label = "Write Job"
    bl_description = ("Write job.json and its input files into the take's cache folder, for the "
                      "matterfit tool or a farm; nothing is simulated")
    bl_options = {"UNDO"}

    def act(self, context):
        takes.require_saved()
        take = takes.ensure_active(context.scene.matterfit)
        folder = takes.claim(take)
        document, replaced = prepare(context, take, folder, "bake", estimate=False)
        replaced.end()
        path = job_document.write(document, folder)
        session(context).last_report = path
        self.report({"INFO"}, path)


CLASSES = (MATTERFIT_OT_bake, MATTERFIT_OT_resume, MATTERFIT_OT_preview, MATTERFIT_OT_free,
           MATTERFIT_OT_cancel, MATTERFIT_OT_estimate, MATTERFIT_OT_write_job)
