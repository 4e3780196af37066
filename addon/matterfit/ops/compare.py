# SPDX-License-Identifier: GPL-3.0-or-later
"""Compare the active take with its captures."""

import bpy

from .. import jobs, native
from ..compat import translate
from ..io import comparison, takes, words
from ..jobs import JobError
from ..props import scene as scene_props
from ..props.compare import store
from .base import JobOperator, session
from .launch import AFRESH_WHERE_CHANGED, GO_ON, prepare, start_job


def require_capture(settings):
    """JobError where there is nothing to compare with."""
    if not any(capture.enabled for capture in settings.captures):
        raise JobError(translate("There is no capture to compare with. Import one in Capture."))


class MATTERFIT_OT_compare(JobOperator, bpy.types.Operator):
    bl_idname = "matterfit.compare"
    bl_label = "Compare"
    bl_description = ("Compare the simulation with the captures, point by point and frame by frame; "
                      "simulates first where the take has no result of the same settings")

    def begin(self, context):
        takes.require_saved()
        native.require()
        settings = context.scene.matterfit
        require_capture(settings)
        take = takes.ensure_active(settings)
        takes.require_own(take)
        folder = takes.claim(take)
        prepared = prepare(context, take, folder, "compare")
        # Frames that only a comparison simulated are nobody's result: after Apply to Body they are
        # simulated anew. Baked frames are kept, and the difference is told.
        restart = GO_ON if take.frames_done else AFRESH_WHERE_CHANGED
        return start_job(context, translate("Compare {name}").format(name=take.name), prepared,
                         folder, restart)

    def ended(self, context, job):
        scene, take = takes.find(job.folder)
        if scene is None:
            return
        settings = scene.matterfit
        take.compared = True
        found = comparison.load(job.folder, scene_props.compared_capture(settings))
        if take == scene_props.active_take(settings):
            store(settings.compare, found)
        for area in context.screen.areas if context.screen else ():
            if area.type == "VIEW_3D":
                area.tag_redraw()  # the heat-map lies in the scene
        session(context).last_report = words.in_panel(
            "\n".join([summary(found, job), *job.result.get("notes", [])]), settings)


def summary(found, job):
    """What a finished comparison says in one line."""
    time = jobs.duration_text(job.elapsed)
    if not found.is_seen:
        return translate("No point of the recording is seen in the simulated frames; compared in {time}"
                         ).format(time=time)
    return translate("Mean error {mean} mm, 95 % below {p95} mm, in {time}").format(
        mean=f"{found.mean:.4g}", p95=f"{found.percentile95:.4g}", time=time)


CLASSES = (MATTERFIT_OT_compare,)
