# SPDX-License-Identifier: GPL-3.0-or-later
"""The open scene as what cli.py runs: its take as a document, and what becomes of the result."""

import contextlib
import os
import sys

import bpy

from .io import attach, cache, files, fit_apply, fit_results, fit_rows, job_document, job_render, takes
from .jobs import EXIT_INPUT, JobError
from .ops.launch import prepare
from .props import scene as scene_props


class SceneJob:
    """The open scene's active take as job.json in its cache folder; a fit has a cache of its own.
    With `save` the .blend file knows the folder before anything runs."""

    def __init__(self, verb, save):
        self._save = save
        self._verb = verb
        takes.require_saved()
        settings = bpy.context.scene.matterfit
        self._fit = settings.fit if verb in cache.FIT_TASKS else None
        if self._fit is None:
            take = takes.ensure_active(settings)
            if verb != "bake" or cache.in_batch(take):
                takes.require_own(take)
        else:
            fit_rows.refresh(settings)
            take = self._fit.run
            self._before, self._done_before = takes.Kept(take), self._fit.done
            takes.for_fit(settings)
        task = "bake" if self._fit is None and verb != "render" else verb
        self.folder = takes.claim(take)
        try:
            self._document, self._replaced = prepare(bpy.context, take, self.folder, task)
        except Exception:
            self._take_back()
            raise
        self._result_before = fit_results.stamp(self.folder)
        try:
            self.path = job_document.write(self._document, self.folder)
        except Exception:
            self._replaced.put_back()
            self._take_back()
            raise
        if save:
            if self._fit is not None:
                self._fit.done = False
            bpy.ops.wm.save_mainfile()

    def _show_and_save(self, result):
        if self._verb == "render":
            job_render.show(bpy.context.scene, self.folder, self._document["render"], result)
            bpy.ops.wm.save_mainfile()
            return
        if self._fit is None:
            attach_and_save(self.folder)
            return
        self._fit.done = True
        if self._verb == "fit":
            for sentence in fit_apply.apply_run(bpy.context.scene, self.folder):
                print(f"matterfit: {sentence}", file=sys.stderr)
        bpy.ops.wm.save_mainfile()

    def _take_back(self):
        """The fit's take as it was; of the folder prepare() and Replaced see to that."""
        if self._fit is not None:
            self._before.put_back(self._fit.run)
            self._fit.done = self._done_before

    def end(self, job):
        """Saves what there is, and says what to go on with where the job is not done."""
        if job.status == 0:
            self._replaced.end()
            if self._save:
                self._show_and_save(job.result)
            return
        untouched = self._replaced.untouched()
        with contextlib.suppress(JobError):
            self._replaced.put_back()
        if untouched:
            self._take_back()
        elif self._fit is not None:
            self._fit.done = fit_results.stamp(self.folder) != self._result_before
        if self._save:
            bpy.ops.wm.save_mainfile()
        if (job.status != EXIT_INPUT and os.path.isfile(self.path)
                and files.read_text(self.path).encode() == files.json_bytes(self._document)):
            print(f"matterfit: to go on: {self._verb} {self.path}", file=sys.stderr)


def choose_take(name):
    """Makes a take of the open scene the active one; JobError where there is none of that name."""
    settings = bpy.context.scene.matterfit
    names = [take.name for take in settings.takes]
    if name not in names:
        known = ", ".join(f"'{other}'" for other in names) or "none"
        raise JobError(f"--take {name}: the scene has no such take; its takes: {known}.")
    settings.take_index = names.index(name)


def question(folder):
    """The open scene's active take as a document in a temporary folder; returns its path."""
    takes.require_saved()
    scene = bpy.context.scene
    folder = os.path.realpath(folder)  # the document's paths climb from it by ..
    take = scene_props.active_take(scene.matterfit)
    return job_document.write(job_document.build(scene, take, folder, "bake"), folder)


def attach_and_save(folder):
    scene, take = takes.find(folder)
    document = files.read_json(os.path.join(folder, "job.json"))
    take.first_frame, end = document["scene"]["frames"]
    take.frame_count = end - take.first_frame
    take.frames_done = attach.Attachment(scene, take, folder, document).update(final=True)
    take.baked = True
    bpy.ops.wm.save_mainfile()
