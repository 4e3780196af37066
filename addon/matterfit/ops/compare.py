# SPDX-License-Identifier: GPL-3.0-or-later
"""Compare the active take with its captures."""

import bpy

from .. import jobs, native
from ..compat import translate
from ..io import (
    blender_cameras,
    camera_frames,
    comparison,
    fit_outlines,
    image_comparison,
    job_render,
    takes,
    words,
)
from ..jobs import JobError
from ..props import scene as scene_props
from ..props.compare import store
from .base import PlainOperator, greyed, session
from .job_operator import JobOperator
from .launch import AFRESH_WHERE_CHANGED, GO_ON, preparing, start_job


def require_capture(settings):
    """JobError where there is nothing to compare with."""
    if not any(capture.enabled for capture in settings.captures):
        raise JobError(translate("There is no capture to compare with. Import one in Capture."))


class MATTERFIT_OT_compare(JobOperator, bpy.types.Operator):
    bl_idname = "matterfit.compare"
    bl_label = "Compare"
    bl_description = ("Compare the simulation with the captures, frame by frame: points with points, "
                      "outlines with the mattes of images; simulates first where the take has no "
                      "result of the same settings")

    def begin(self, context):
        takes.require_saved()
        native.require()
        settings = context.scene.matterfit
        require_capture(settings)
        take = takes.ensure_active(settings)
        takes.require_own(take)
        with takes.claiming(context.scene, take) as folder:
            prepared = yield from preparing(context, take, folder, "compare")
        # Frames that only a comparison simulated are nobody's result: after Apply to Body they are
        # simulated anew. Baked frames are kept, and the difference is told.
        restart = GO_ON if take.frames_done else AFRESH_WHERE_CHANGED
        return start_job(context, translate("Compare {name}").format(name=take.name), prepared,
                         folder, restart)

    def stopped(self, context, job):
        job_render.hide_removed(job.folder)

    def ended(self, context, job):
        job_render.hide_removed(job.folder)
        scene, take = takes.find(job.folder)
        if scene is None:
            return
        settings = scene.matterfit
        take.compared = True
        name = scene_props.compared_capture(settings)
        images = image_comparison.load(job.folder, name)
        found = comparison.load(job.folder, name) if images is None else None
        if take == scene_props.active_take(settings):
            store(settings.compare, found, images)
        for area in context.screen.areas if context.screen else ():
            if area.type == "VIEW_3D":
                area.tag_redraw()  # the heat-map lies in the scene
        line = summary(found, job) if images is None else image_summary(images, job)
        session(context).last_report = words.in_panel(
            "\n".join([line, *job.result.get("notes", [])]), settings)


def summary(found, job):
    """What a finished comparison says in one line."""
    time = jobs.duration_text(job.elapsed)
    if not found.is_seen:
        return translate("No point of the recording is seen in the simulated frames; compared in {time}"
                         ).format(time=time)
    return translate("Mean error {mean} mm, 95 % below {p95} mm, in {time}").format(
        mean=f"{found.mean:.4g}", p95=f"{found.percentile95:.4g}", time=time)


def image_summary(found, job):
    """The same of images."""
    time, held_out = jobs.duration_text(job.elapsed), found.held_out
    if found.seen.iou is None and (held_out is None or held_out.iou is None):
        return translate("No image shows the body, in the recording or the simulation; compared in {time}"
                         ).format(time=time)
    share = fit_outlines.percent(found.seen.iou)
    if held_out is None:
        return translate("Outlines overlap by {share} %, in {time}").format(share=share, time=time)
    return translate("Outlines overlap by {share} %, held-out ones by {held_out} %, in {time}").format(
        share=share, held_out=fit_outlines.percent(held_out.iou), time=time)


class MATTERFIT_OT_show_overlays(PlainOperator, bpy.types.Operator):
    bl_idname = "matterfit.show_overlays"
    bl_label = "Show in Cameras"
    bl_description = ("Show in the views of the capture's cameras where the simulation lies outside of "
                      "the recorded outline (orange) and where it is missing (blue), with the "
                      "frame's number")

    @classmethod
    def poll(cls, context):
        return greyed(cls, not context.scene.matterfit.compare.images_done,
                      "Press Compare first")

    def act(self, context):
        scene = context.scene
        settings = scene.matterfit
        name = settings.compare.capture
        take = scene_props.active_take(settings)
        found = image_comparison.overlays(takes.locate(take).folder, name)
        if not found:
            raise JobError(translate("There are no overlays of '{name}' in the take's folder. Compare "
                                     "again.").format(name=name))
        cameras = blender_cameras.of_capture(scene, name)
        shown = [number for number in sorted(found) if number in cameras]
        if not shown:
            raise JobError(translate("The scene has no cameras of '{name}'. Import the images with "
                                     "Add Cameras.").format(name=name))
        for number in shown:
            blender_cameras.set_overlays(cameras[number], found[number])
        camera_frames.fill(scene)
        if scene.camera not in cameras.values():
            scene.camera = cameras[shown[0]]


CLASSES = (MATTERFIT_OT_compare, MATTERFIT_OT_show_overlays)
