# SPDX-License-Identifier: GPL-3.0-or-later
"""Bake, Resume and Preview."""

import contextlib

import bpy
from bpy.props import EnumProperty

from .. import jobs, native
from ..compat import translate
from ..io import (
    attach,
    attached,
    cache,
    job_render,
    plain,
    resolution,
    shapes,
    takes,
    transforms,
    visibility,
    words,
)
from ..jobs import EXIT_INPUT, JobError
from ..props import scene as scene_props
from .base import session
from .caches import HasCache, discard_preview
from .job_operator import JobOperator
from .launch import AFRESH, AFRESH_WHERE_CHANGED, GO_ON, preparing, start_job, written_document

ONTO = (("NEW", "New Take", "Into a new take with the same settings; the finished one stays"),
        ("REPLACE", "Replace", "Into this take: what it holds is baked anew where it has changed"))


def report_text(job):
    """What a finished bake says: frames and time, how the bodies were filled, notes."""
    result = job.result
    first, end = result.get("frames", (0, 0))
    parts = [translate("{name}: {frames} in {time}").format(
        name=job.label, frames=plain.counted(end - first, "frame"), time=jobs.duration_text(job.elapsed))]
    parts += [f"{body['name']}: {words.fill(body['fill'])}" for body in result.get("bodies", [])
              if body.get("fill")]
    parts += result.get("notes", [])
    return "\n".join(parts)


def lost_hair(settings):
    """What is said of hair that the results do not have."""
    return [translate("{name}: its hair is not on the result, as modifiers make another mesh. Grow it "
                      "on the result.").format(name=body.name)
            for body in settings.bodies
            if body.role == "BODY" and body.enabled and body.source == "OBJECT"
            and body.object is not None and shapes.loses_hair(body.object)]


class BakeJob(JobOperator):
    """What Bake, Resume and Preview share: the cache is attached as it grows."""

    _followed = None  # the frame that the playhead was put to last
    _stood = 0  # and where it was before
    _notes = ()  # what is to be said of what is shown
    _pictures_gone = False  # those of Render Take, from behind a camera's view

    def progressed(self, context, job):
        # Until its first frame is done the job may be refused, and what is shown stays.
        if job.snapshot.frame > written_document(job.folder)["scene"]["frames"][0]:
            self.show(context, job, live=True)
            self._follow(job)

    def stopped(self, context, job):
        scene, take = takes.find(job.folder)
        if take is not None and not job.begun:
            self.take_back(scene.matterfit, take)
        if job.status == EXIT_INPUT or not job.begun:
            return
        # The reason why the job stopped is reported, not what could not be shown of it.
        with contextlib.suppress(Exception):
            take = self.show(context, job)
            # Particles of a frame whose other files are not written yet are seen, and baked anew.
            take.frames_done = min(take.frames_done, takes.frames_on_disk(take))

    def ended(self, context, job):
        take = self.show(context, job, final=True)
        scene, _take = takes.find(job.folder)
        if scene is not None and scene.frame_current == self._followed:
            scene.frame_set(self._stood)
        if take is not None:
            take.baked = True
        settings = context.scene.matterfit
        said = [words.in_panel(report_text(job), settings), resolution.advice(context.scene),
                *lost_hair(settings), *self._notes]
        if self._pictures_gone:
            said.append(translate("Render Take's pictures of what the take held before are gone, from behind the "
                                  "camera's view too. Render Take draws new ones."))
        session(context).last_report = "\n".join(filter(None, said))

    def take_back(self, settings, take):
        """Called where nothing came of the job: it has not begun."""

    def _follow(self, job):
        """The playhead goes with the frame whose particles are seen, so that all else, such as an
        animated collider, is of that frame too; until the artist moves it."""
        scene, take = takes.find(job.folder)
        if take is None or not take.frames_done:
            return
        if self._followed is None:
            self._stood = scene.frame_current
        elif scene.frame_current != self._followed:
            return
        self._followed = take.first_frame + take.frames_done - 1
        scene.frame_set(self._followed)

    def show(self, context, job, final=False, live=False):
        self._pictures_gone = job_render.hide_removed(job.folder) or self._pictures_gone
        scene, take = takes.find(job.folder)
        if take is None:
            return None
        document = written_document(job.folder)
        first, end = document["scene"]["frames"]
        take.first_frame, take.frame_count = first, end - first
        shown = attach.Attachment(scene, take, job.folder, document)
        take.frames_done = shown.update(final, live)
        self._notes = shown.notes
        if take == scene.matterfit.preview:
            visibility.show_only(scene.matterfit, take)
        else:
            visibility.show_take(scene.matterfit)
        return take


class MATTERFIT_OT_bake(BakeJob, bpy.types.Operator):
    bl_idname = "matterfit.bake"
    bl_label = "Bake"
    bl_description = ("Simulate the active take and write its caches beside the .blend file; "
                      "frames appear as they are done. A take that is finished is kept")

    onto: EnumProperty(
        name="Onto", items=ONTO, options={"SKIP_SAVE"},
        description="Where the bake goes when the active take is finished")

    _stood_at = None  # the take that was active before one was added for this bake
    _kept = None  # its take before it got a folder

    def invoke(self, context, event):
        take = scene_props.active_take(context.scene.matterfit)
        asked = self.properties.is_property_set("onto")
        if take is not None and not asked and not bpy.app.background and takes.finished_frames(take):
            return bpy.ops.matterfit.bake_again("INVOKE_DEFAULT")
        return super().invoke(context, event)

    def begin(self, context):
        takes.require_saved()
        native.require()
        scene = context.scene
        settings = scene.matterfit
        before, count = settings.take_index, len(settings.takes)
        take = takes.for_bake(settings, replace=self.onto == "REPLACE")
        self._stood_at = before if len(settings.takes) > count else None
        self._kept = takes.Kept(take)
        folder = ""
        try:
            discard_preview(scene)
            folder = takes.claim(take)
            take.extended = False
            prepared = yield from preparing(context, take, folder, "bake")
        except BaseException:  # a generator that is left, too
            scene, take = takes.still(scene, take, folder)
            if take is not None:
                self.take_back(scene.matterfit, take)
            raise
        # States of the very same inputs are used again: another output bakes without simulating.
        return start_job(context, translate("Bake {name}").format(name=take.name), prepared,
                         folder, AFRESH_WHERE_CHANGED, lambda: _forget_comparison(folder),
                         resumable=True)

    def take_back(self, settings, take):
        """Removes the take that was added for a bake of which nothing came; another one shows again what
        it was linked to."""
        index = next((i for i, other in enumerate(settings.takes) if other == take), None)
        if self._stood_at is None:
            self._kept.put_back_cache(take)
            if take.frames_done and not attached.objects_of(settings.id_data, take):
                # The reason why the bake ended is reported.
                with contextlib.suppress(JobError):
                    folder = takes.locate(take).folder
                    attach.Attachment(settings.id_data, take, folder, written_document(folder)).update(True)
            visibility.show_take(settings)
            return
        if index is None:
            return
        attached.detach(settings.id_data, take)
        if take.folder:
            # The reason why the bake ended is reported.
            with contextlib.suppress(JobError):
                cache.free(takes.locate(take).folder)
        settings.takes.remove(index)
        if settings.take_index == index:
            settings.take_index = max(min(self._stood_at, len(settings.takes) - 1), 0)
        elif settings.take_index > index:
            settings.take_index -= 1


def _forget_comparison(folder):
    """What was compared is no longer what the folder holds."""
    scene, take = takes.find(folder)
    if scene is None:
        return
    take.compared = False
    if take == scene_props.active_take(scene.matterfit):
        scene.matterfit.compare.done = scene.matterfit.compare.images_done = False


class MATTERFIT_OT_bake_again(bpy.types.Operator):
    bl_idname = "matterfit.bake_again"
    bl_label = "This Take Is Finished"
    bl_description = "Ask whether a bake may replace the active take, which is finished"

    onto: EnumProperty(name="Bake Into", items=ONTO, options={"SKIP_SAVE"},
                       description="Where the bake goes")

    def invoke(self, context, _event):
        return context.window_manager.invoke_props_dialog(self)

    def draw(self, context):
        take = scene_props.active_take(context.scene.matterfit)
        self.layout.label(text=translate("'{name}' holds {n} baked frames.").format(
            name=take.name, n=takes.finished_frames(take)), translate=False)
        self.layout.prop(self, "onto", expand=True)

    def execute(self, _context):
        return bpy.ops.matterfit.bake("INVOKE_DEFAULT", onto=self.onto)


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
        if cache.in_batch(take):
            raise JobError(translate("This take is one of a batch. Press Run Batch to go on."))
        if location.linked:
            raise JobError(takes.linked_text(location))
        written_document(location.folder)
        prepared = yield from preparing(context, take, location.folder, "bake")
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
        separation = transforms.metres(scene) * resolution.for_preview(
            scene, settings.solver.particle_separation * session(context).preview_scale)
        prepared = yield from preparing(context, preview, folder, "bake", quality="preview",
                                        separation=separation, outputs=False)
        return start_job(context, translate("Preview"), prepared, folder, AFRESH)


CLASSES = (MATTERFIT_OT_bake, MATTERFIT_OT_bake_again, MATTERFIT_OT_resume, MATTERFIT_OT_preview)
