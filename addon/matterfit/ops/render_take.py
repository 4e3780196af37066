# SPDX-License-Identifier: GPL-3.0-or-later
"""The active take drawn by the rasteriser, frame by frame, behind the view of the scene's camera."""

import bpy

from .. import native
from ..compat import translate
from ..io import job_render, takes
from ..jobs import EXIT_INPUT
from .base import greyed
from .job_operator import JobOperator
from .launch import AFRESH_WHERE_CHANGED, GO_ON, preparing, start_job, written_document


class MATTERFIT_OT_render_take(JobOperator, bpy.types.Operator):
    bl_idname = "matterfit.render_take"
    bl_label = "Render Take"
    bl_description = ("Draw the active take through the scene's camera, and anew through others that show it "
                      "already, frame by frame, and show the pictures behind their views: a body that was filled "
                      "of splats by these, carried along and blended as they were trained, another by its "
                      "particles; simulates first where the take has no result of the same settings")

    _kept = None  # the take before it got a folder

    @classmethod
    def poll(cls, context):
        return greyed(cls, context.scene.camera is None, "The scene has no camera")

    def begin(self, context):
        takes.require_saved()
        native.require()
        take = takes.ensure_active(context.scene.matterfit)
        takes.require_own(take)
        self._kept = takes.Kept(take)
        with takes.claiming(context.scene, take) as folder:
            prepared = yield from preparing(context, take, folder, "render")
        restart = GO_ON if take.frames_done else AFRESH_WHERE_CHANGED
        return start_job(context, translate("Render {name}").format(name=take.name), prepared, folder, restart)

    def stopped(self, context, job):
        _scene, take = takes.find(job.folder)
        refused = not job.begun or job.status == EXIT_INPUT and job.untouched
        if refused and take is not None:
            self._kept.put_back_cache(take)
        job_render.hide_removed(job.folder)

    def ended(self, context, job):
        for note in job.result["render"]["notes"]:
            self.report({"WARNING"}, note)
        scene, _take = takes.find(job.folder)
        if scene is None:  # the take was removed meanwhile
            return
        gone = job_render.show(scene, job.folder, written_document(job.folder)["render"], job.result)
        if gone:
            self.report({"WARNING"}, translate(
                "The pictures behind the view of {names} are gone: this take was not drawn through it again. It "
                "moves, is no perspective camera, or is not of the same capture as the scene's camera.").format(
                    names=", ".join(gone)))


CLASSES = (MATTERFIT_OT_render_take,)
