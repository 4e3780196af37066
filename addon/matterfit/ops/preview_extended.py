# SPDX-License-Identifier: GPL-3.0-or-later
"""Preview of what a diagnosis has found: its extended model as a take beside the fitted one."""

import contextlib

import bpy

from .. import native
from ..compat import translate
from ..io import attached, cache, diagnosis, fit_results, job_document, preview_extended, takes
from ..jobs import JobError
from .diagnose import HasReport, fit_folder
from .launch import AFRESH, start_job
from .simulate import BakeJob


class MATTERFIT_OT_preview_extended(HasReport, BakeJob, bpy.types.Operator):
    bl_idname = "matterfit.preview_extended"
    bl_label = "Preview Extended"
    bl_description = ("Bake the particles of the model with all causes that were accepted into a take of "
                      "their own, beside the fitted one. Nothing else in the scene is changed")

    _stood_at = 0  # the take that was active before

    def begin(self, context):
        takes.require_saved()
        native.require()
        settings = context.scene.matterfit
        source = fit_folder(context)
        report = diagnosis.load(source)
        if not diagnosis.is_of_fit(report, fit_results.load(source)):
            raise JobError(translate("The diagnosis is of an earlier fit. Diagnose again."))
        self._stood_at = settings.take_index
        self._remove_old(settings)
        take = takes.add(settings, translate("{name}, extended").format(name=settings.fit.run.name))
        take.extended = True
        settings.take_index = len(settings.takes) - 1
        folder = ""
        try:
            folder = takes.claim(take)
            replaced = job_document.Replaced(folder, "bake")
            document = preview_extended.document(source, folder)
        except BaseException:
            scene, take = takes.still(context.scene, take, folder)
            if take is not None:
                self.take_back(scene.matterfit, take)
            raise
        return start_job(context, translate("Preview {name}").format(name=take.name), (document, replaced),
                         folder, AFRESH)

    def _remove_old(self, settings):
        """An earlier preview makes room."""
        for index in reversed(range(len(settings.takes))):
            take = settings.takes[index]
            if take.extended and not takes.locate(take).linked:
                self._remove(settings, index)

    def take_back(self, settings, take):
        index = next((i for i, other in enumerate(settings.takes) if other == take), None)
        if index is not None:
            self._remove(settings, index)
            settings.take_index = max(min(self._stood_at, len(settings.takes) - 1), 0)

    @staticmethod
    def _remove(settings, index):
        take = settings.takes[index]
        attached.detach(settings.id_data, take)
        if take.folder:
            # The reason why the bake ended is reported.
            with contextlib.suppress(JobError):
                cache.free(takes.locate(take).folder)
        settings.takes.remove(index)
        settings.take_index = max(min(settings.take_index, len(settings.takes) - 1), 0)


CLASSES = (MATTERFIT_OT_preview_extended,)
