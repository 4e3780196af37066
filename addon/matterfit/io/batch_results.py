# SPDX-License-Identifier: GPL-3.0-or-later
"""What came of a batch: its members as takes beside each other, with their errors."""

import contextlib
import os

import bpy

from ..compat import translate, translate_label
from ..jobs import JobError
from ..props import reactions
from ..props import scene as scene_props
from . import (
    attach,
    batch,
    cache,
    files,
    fit_results,
    job_document,
    takes,
    visibility,
    words,
)

_filling = []  # not empty while rows are filled in: nobody has chosen one then


def axis_name(settings, path):
    """What is varied, in the panel's words."""
    if path == batch.SEPARATION:
        return translate_label("Particle Separation")
    return words.named(settings, path)


def take_name(settings, member):
    """What a member's take is called: Velocity Z = -1, Young's Modulus = 2e4."""
    parts = [assignment.rpartition("=") for assignment in member["set"]]
    return ", ".join(f"{axis_name(settings, path)} = {value}" for path, _equals, value in parts)


def values_text(member):
    """The values alone, in the order of the axes: -1, 5e4."""
    return ", ".join(assignment.rpartition("=")[2] for assignment in member["set"])


def error_text(error):
    """An error [mm] with three digits; – where it is not known (below 0)."""
    if error < 0.0:
        return "–"
    return f"{error:.3g} mm" if error >= 1e-3 else "< 0.001 mm"


def show(scene, task):
    """Every member that is baked becomes a take, and all are listed with the error that is known of
    them, the best first. `task` is the one that they were made with: another may be chosen by now.
    Returns (how many have results, of how many)."""
    settings = scene.matterfit
    run = batch.home(settings, task)
    folder, wedge = batch.written(run)
    rows, shown = [], 0
    for member in wedge["members"]:
        home = os.path.join(folder, member["folder"])
        name = f"{cache.name_of(run)}/{member['folder']}"
        error = None
        if task == "FIT":
            error = fit_error(home)
            shown += error is not None
        elif _is_baked(home):
            shown += 1
            if not any(cache.name_of(take) == name and take.baked for take in settings.takes):
                _attach(scene, name, home, take_name(settings, member))
        if task == "COMPARE":
            error = compare_error(home)
            for take in settings.takes:
                if cache.name_of(take) == name:
                    take.compared = error is not None
        rows.append((values_text(member), f"//{name}/", error))
    settings.batch.varied = ", ".join(axis_name(settings, axis["path"]) for axis in wedge["axes"])
    _list(settings, rows)
    visibility.show_take(settings)
    return shown, len(wedge["members"])


def _is_baked(home):
    manifest = {}
    with contextlib.suppress(JobError):
        manifest = cache.manifest(home)
    return bool(manifest.get("complete") and manifest.get("frames_baked"))


def _attach(scene, name, home, label):
    settings = scene.matterfit
    index = next((i for i, take in enumerate(settings.takes) if cache.name_of(take) == name), None)
    if index is None:
        takes.add(settings, label)
        index = len(settings.takes) - 1
    take = settings.takes[index]
    take.folder, take.owner = f"//{name}/", os.path.abspath(bpy.data.filepath)
    document = files.read_json(os.path.join(home, job_document.JOB_FILE))
    take.first_frame, end = document["scene"]["frames"]
    take.frame_count = end - take.first_frame
    take.frames_done = attach.Attachment(scene, take, home, document).update(final=True)
    take.baked = True


def compare_error(home):
    """The mean error [mm] of all samples of all captures of a member; None before it is compared."""
    captures = _read(os.path.join(home, "report.json")).get("compare", {}).get("captures", [])
    known = [(entry["mean_mm"], entry["samples"]) for entry in captures
             if entry.get("samples") and isinstance(entry.get("mean_mm"), int | float)]
    samples = sum(count for _mean, count in known)
    return sum(mean * count for mean, count in known) / samples if samples else None


def fit_error(home):
    """The mean error [mm] that a member's fit has on what was held out, else on what was fitted;
    None before there is a result."""
    if not os.path.isfile(os.path.join(home, fit_results.RESULT_FILE)):
        return None
    with contextlib.suppress(JobError):
        result = fit_results.load(home)
        for measure in (result.held_out.after, result.fitted.after):
            mean = (measure or {}).get("mean_mm")
            if isinstance(mean, int | float):
                return float(mean)
    return None


def fit_of_active(settings):
    """(folder of the active row's fit, paths of what was varied there and can be set); JobError where
    there is none."""
    row = scene_props.active_item(settings.batch.results, settings.batch.result_index)
    folder, wedge = batch.written(settings.batch.fits)
    for member in wedge["members"]:
        home = os.path.join(folder, member["folder"])
        if row is not None and row.folder.strip("/").endswith("/" + member["folder"]):
            paths = [assignment.rpartition("=")[0] for assignment in member["set"]]
            return home, [path for path in paths if path != batch.SEPARATION]
    raise JobError(translate("This combination is not in the batch any more. Press Load Results."))


def _read(path):
    """A JSON object; {} where there is none, or half of one."""
    if os.path.isfile(path):
        with contextlib.suppress(JobError):
            found = files.read_json(path)
            if isinstance(found, dict):
                return found
    return {}


def error_of(settings, take):
    """The error [mm] that the list has of a take; -1 where it has none."""
    if not cache.in_batch(take):
        return -1.0
    return next((row.error for row in settings.batch.results if row.folder == take.folder), -1.0)


def _list(settings, rows):
    """Fills the list: the smallest error first, what has none yet at the end."""
    shown = settings.batch.results
    active = scene_props.active_take(settings)
    _filling.append(settings)
    try:
        shown.clear()
        for name, folder, error in sorted(rows, key=lambda row: (row[2] is None, row[2] or 0.0)):
            row = shown.add()
            row.name, row.folder = name, folder
            row.error = -1.0 if error is None else error
        for index, row in enumerate(shown):
            if active is not None and row.folder == active.folder:
                settings.batch.result_index = index
    finally:
        _filling.pop()


@reactions.batch_result_chosen.done_by
def choose(settings):
    """The take of the active row is shown, with its heat-map where it was compared."""
    row = scene_props.active_item(settings.batch.results, settings.batch.result_index)
    if row is None or _filling:
        return
    index = next((i for i, take in enumerate(settings.takes) if take.folder == row.folder), None)
    if index is None:
        return
    settings.take_index = index
