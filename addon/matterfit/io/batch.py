# SPDX-License-Identifier: GPL-3.0-or-later
"""A batch: what can be varied, the assignments that the library takes, and its caches.

A cache folder of it holds job.json, which is what is varied, wedge.json, and a cache for each member.
"""

import contextlib
import math
import os
import re

from .. import quantities
from ..compat import translate, translate_label
from ..jobs import JobError
from . import attached, cache, files, fit_rows, job_checks, job_fit, number_text, takes, visibility

WEDGE_FILE = "wedge.json"
AXES = "XYZ"
# Not in the document by themselves, or there in another form.
_NOT_VARIED = {"material.latent", "start_frame", "height", "placement.position", "placement.rotation"}
_COMPONENT = re.compile(r"^(?P<key>.+)\[(?P<axis>[012])\]$")
_IN_JSON = re.compile(r"-?(0|[1-9]\d*)(\.\d+)?([eE][-+]?\d+)?$")  # not so .5 and +2
_LONGEST = 120  # characters of the name that the library gives to a member's folder
_ASSIGNMENT = r"[A-Za-z0-9.+-]+=[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?"
_MEMBER = re.compile(rf"{_ASSIGNMENT}(_{_ASSIGNMENT})*$", re.ASCII)
SEPARATION = "particle_separation"
MOST = 10000  # combinations, as the library takes them


def candidates(settings):
    """[(owner, key, label)] of what can be varied: numbers, and each component of vectors."""
    found = []
    for owner, quantity in fit_rows.candidates(settings):
        if quantity.key in _NOT_VARIED:
            continue
        label = translate_label(quantity.title)
        if quantity.is_vector:
            found += [(owner, f"{quantity.key}[{i}]", f"{label} {AXES[i]}") for i in range(3)]
        else:
            found.append((owner, quantity.key, label))
    if found:
        found.append(("", SEPARATION, translate_label("Particle Separation")))
    return found


def unit(key):
    """The unit of a quantity, "" without one."""
    row = _row(key)
    return "m" if key == SEPARATION else row.unit if row is not None else ""


def _row(key):
    """The Quantity of a key, or of the vector that it is a component of; None where there is none."""
    match = _COMPONENT.match(key)
    return quantities.find(match.group("key") if match else key)


def assignments(settings, scene_document):
    """One "path=value,value" an axis, as --set of the tool; JobError with what to change."""
    axes = settings.batch.axes
    if not axes:
        raise JobError(translate("Batch: nothing is varied. Press Vary, and type values."))
    known = {(owner, key) for owner, key, _label in candidates(settings)}
    count = combinations(settings)
    if count > MOST:
        raise JobError(translate("Batch: {n} combinations are more than {most}. Take out some values.")
                       .format(n=count, most=MOST))
    found = []
    for axis in axes:
        if (axis.owner, axis.key) not in known:
            raise JobError(translate("Batch: '{name}' is not in the scene any more. Remove it.")
                           .format(name=axis.name))
        if job_fit.owner_document(scene_document, axis) is None:
            raise JobError(translate("Batch: '{name}' takes no part in this take.").format(
                name=axis.owner))
        if not axis.owner and axis.key.startswith("gravity") and isinstance(
                scene_document["gravity"], dict):
            raise JobError(translate("Batch: gravity is animated. Remove its keys, or vary "
                                     "something else."))
        found.append(f"{job_fit.path(scene_document, axis)}={','.join(_values(axis))}")
    return found


def value_texts(axis):
    """What was typed between the commas of an axis, where something was."""
    return [text for text in map(str.strip, axis.values.split(",")) if text]


def combinations(settings):
    """How many there are of what is typed."""
    axes = settings.batch.axes
    return math.prod(len(value_texts(axis)) for axis in axes) if axes else 0


def _values(axis):
    known = {}
    texts = [text.strip() for text in axis.values.split(",")]
    while texts and not texts[-1]:
        texts.pop()
    if "" in texts:
        raise JobError(translate("Batch: {name} has a comma with nothing before it. Type the value that is "
                                 "missing, or remove the comma.").format(name=axis.name))
    for text in texts:
        value = _number(text)
        if value is None:
            raise JobError(translate(
                "Batch: {name} has '{text}' among its values; numbers separated by commas are "
                "expected, such as 1, 2, 3.").format(name=axis.name, text=text))
        row = _row(axis.key)
        if row is not None and not row.takes(value):
            raise JobError(translate("Batch: {name} has the value {text}; its field takes from {least} to "
                                     "{most}.").format(name=axis.name, text=text,
                                                       least=number_text.short(row.least, 6),
                                                       most=number_text.short(row.most, 6)))
        if axis.key == SEPARATION:
            job_checks.separation(value, typed=True)
        if value in known:
            raise JobError(translate("Batch: {name} has the value {text} twice.").format(
                name=axis.name, text=text))
        # -0 would be a value and a take of its own name.
        known[value] = "0" if value == 0.0 else text if _IN_JSON.match(text) else repr(value)
    if not known:
        raise JobError(translate("Batch: {name} has no values yet. Type numbers separated by commas, "
                                 "such as 1, 2, 3.").format(name=axis.name))
    return list(known.values())


def _number(text):
    """A finite number, else None: 1_000 and nan are numbers for Python alone."""
    try:
        value = float(text)
    except ValueError:
        return None
    return value if math.isfinite(value) and "_" not in text else None


def home(settings, task):
    """The take whose cache a batch goes into: fits lie apart from what is baked."""
    return settings.batch.fits if task == "FIT" else settings.batch.run


def written(run):
    """(folder, wedge.json's document) of a batch's cache, or JobError."""
    location = takes.locate(run)
    path = os.path.join(location.folder, WEDGE_FILE)
    if not location.folder or not os.path.isfile(path):
        raise JobError(translate("This batch was not run or written yet."))
    return location.folder, files.read_json(path)


def _every_member(folder):
    """The caches of all members that the batch ever had: wedge.json lists those of its last values. The
    library calls them after these and nothing else, velocity.2=-1; a copy under another name is of who
    made it."""
    return [entry.path for entry in os.scandir(folder) if entry.is_dir() and _is_member(entry.name)
            and os.path.isfile(os.path.join(entry.path, "job.json"))]


def _is_member(name):
    # Long ones are cut, and numbered where that makes them alike.
    return bool(_MEMBER.match(name) or len(name) >= _LONGEST and re.match(r"[\w.+=-]+$", name, re.ASCII))


def free(scene):
    """Removes the batch's takes and deletes its caches. Returns the files that are not ours."""
    settings = scene.matterfit
    batch = settings.batch
    run_name = cache.name_of(batch.run)
    for index in reversed(range(len(settings.takes))):
        take = settings.takes[index]
        if run_name and cache.name_of(take).startswith(run_name + "/"):
            attached.detach(scene, take)
            settings.takes.remove(index)
    settings.take_index = max(0, min(settings.take_index, len(settings.takes) - 1))
    batch.results.clear()
    left = []
    for run in (batch.run, batch.fits):
        location, stays = takes.locate(run), []
        if location.exists and not location.linked:
            for member in _every_member(location.folder):
                # The others go; the rest of a damaged one is named.
                with contextlib.suppress(JobError):
                    cache.free(member)
            stays = cache.free(location.folder)
        if not stays:
            run.folder = ""
        left += [os.path.join(location.folder, name) for name in stays]
    visibility.show_take(settings)
    return left
