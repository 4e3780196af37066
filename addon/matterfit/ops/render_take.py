# SPDX-License-Identifier: GPL-3.0-or-later
"""The active take drawn by the rasteriser, frame by frame, behind the view of the scene's camera."""

import bpy

from .. import native
from ..compat import translate
from ..io import job_render, takes
from .base import greyed
from .job_operator import JobOperator
from .launch import AFRESH_WHERE_CHANGED, GO_ON, preparing, start_job


class MATTERFIT_OT_render_take(JobOperator, bpy.types.Operator):
    bl_idname = "matterfit.render_take"
    bl_label = "Render Take"
    bl_description = ("Draw the active take through the scene's camera, frame by frame, and show the pictures "
                      "behind its view: a body that was filled of splats by these, carried along and blended as "
                      "they were trained, another by its particles; simulates first where the take has no result "
                      "of the same settings")

    @classmethod
    def poll(cls, context):
        return greyed(cls, context.scene.camera is None, "The scene has no camera")

    def begin(self, context):
        takes.require_saved()
        native.require()
        take = takes.ensure_active(context.scene.matterfit)
        takes.require_own(take)
        with takes.claiming(context.scene, take) as folder:
            prepared = yield from preparing(context, take, folder, "render")
        self.camera = context.scene.camera.name
        restart = GO_ON if take.frames_done else AFRESH_WHERE_CHANGED
        return start_job(context, translate("Render {name}").format(name=take.name), prepared, folder, restart)

    def stopped(self, context, job):
        job_render.hide_removed(job.folder)

    def ended(self, context, job):
        for note in job.result["render"]["notes"]:
            self.report({"WARNING"}, note)
        scene, _take = takes.find(job.folder)
        camera = scene.objects.get(self.camera) if scene is not None else None
        if camera is not None:  # else it was removed meanwhile
            job_render.show(camera, job.folder, job.result)


CLASSES = (MATTERFIT_OT_render_take,)
