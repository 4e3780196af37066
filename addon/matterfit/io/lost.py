# SPDX-License-Identifier: GPL-3.0-or-later
"""What undo brings back of caches that were deleted: files do not come back with it."""

import os

from ..props import reactions
from . import attached, cache, fit_results, job_render, takes


def forget(scene):
    """Nothing is left of what the scene says of caches of its own that are gone, nor the objects that
    would play them. What is there stays as undo has made it."""
    settings = scene.matterfit
    changed = False
    for take in (*settings.takes, settings.preview):
        location = takes.locate(take)
        if not location.folder or location.linked and not cache.in_batch(take):
            continue
        job_render.hide_removed(location.folder)
        # Files that are not ours may have kept the folder.
        if not os.path.isfile(os.path.join(location.folder, "manifest.json")):
            changed = _forget_take(scene, take) or changed
        elif take.collection is not None:
            _forget_kinds(take, location.folder)
    fit, location = settings.fit, takes.locate(settings.fit.run)
    if fit.done and not location.linked:
        fit.done = bool(location.folder) and fit_results.stamp(location.folder) is not None
    if not any(takes.locate(run).exists for run in (settings.batch.run, settings.batch.fits)):
        settings.batch.results.clear()
    if changed:
        reactions.comparison_switched(settings)


def _forget_take(scene, take):
    """Whether there was something to forget."""
    if not (take.baked or take.frames_done or take.compared or attached.objects_of(scene, take)):
        return False
    take.baked = take.compared = False
    take.frames_done = 0
    attached.detach(scene, take)
    return True


def _forget_kinds(take, folder):
    for kind in attached.KIND_TAGS:
        if not os.path.isdir(os.path.join(folder, kind)):
            attached.detach_kind(take, kind)
