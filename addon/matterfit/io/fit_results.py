# SPDX-License-Identifier: GPL-3.0-or-later
"""What a fit has found, as the files in its cache folder say it, and its curve while it runs."""

import json
import math
import os
from dataclasses import dataclass, field

from ..compat import translate
from ..jobs import JobError
from . import files, fit_outlines, job_fit, number_text, presets

RESULT_FILE = "result.json"
SCENE_FILE = "scene.json"
MATERIAL_FILE = "material.json"
HISTORY_FILE = os.path.join("fit", "history.jsonl")
CHECKPOINT_FILE = os.path.join("fit", "checkpoint.json")


@dataclass
class Estimate:
    """One fitted number, SI. `error` and the interval are None where nothing observes it, and where
    the fit was cancelled before they were known; `grid_error`, what the particle separation makes
    it wrong by, also where it was not examined. The interval is of both errors."""

    path: str
    unit: str = ""
    start: float = 0.0
    value: float = 0.0
    error: float = None
    grid_error: float = None
    interval: tuple = None
    at_bound: bool = False
    observable: bool = True
    statement: str = ""

    @property
    def text(self):
        return number_text.value_text(self.value, self.error, self.unit)


@dataclass
class Measure:
    """Errors of a simulation against the captures, in mm; None where nothing was held out."""

    before: dict = None
    after: dict = None


@dataclass(frozen=True)
class Like:
    """The known law that a fitted one without a formula is nearest to. `distance`: the mean relative
    difference of their stresses over what the recording excites; `others`: [(law, distance)] of the
    next ones."""

    law: str
    distance: float
    sentence: str
    others: tuple = ()
    parameters: dict = field(default_factory=dict)  # of the nearest law, in a document's words


@dataclass(frozen=True)
class Predicted:
    """How sure a fit's prediction of what was held out is: half of a 95 % band of a coordinate, root
    mean square, in mm, and the share of the samples within the band and the noise."""

    half_width_mm: float
    coverage: float


@dataclass
class FitResult:
    status: str
    law: str
    converged: bool
    reason: str
    seconds: float
    iterations: int
    noise_scale: float
    estimates: list
    fitted: Measure
    held_out: Measure
    statements: list = field(default_factory=list)
    models: list = field(default_factory=list)
    correlation: list = field(default_factory=list)
    warning: str = ""  # why the values are not to be used as they stand
    likes: dict = field(default_factory=dict)  # {body: Like} of laws that have no formula
    predicted: Predicted = None  # where something was held out and the fit knows its errors
    outlines: fit_outlines.Outlines = None  # of a fit to images


def load(folder):
    """The result in a fit's cache folder; JobError where it cannot be read."""
    path = os.path.join(folder, RESULT_FILE)
    document = files.read_json(path)
    found = document.get("fit") if isinstance(document, dict) else None
    if not isinstance(found, dict):
        raise JobError(translate("{path}: holds no result of a fit. Fit again.")
                       .format(path=path))
    try:
        return _result(document, found)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise JobError(translate(
            "{path}: is not a result of a fit that this version reads ({error}). Fit again.").format(
                path=path, error=f"{type(error).__name__}: {error}")) from error


def _result(document, found):
    before, after = found.get("before") or {}, found.get("after") or {}
    return FitResult(
        status=document.get("status", ""),
        law=found.get("law", ""),
        converged=bool(found.get("converged")),
        reason=found.get("reason", ""),
        seconds=found.get("seconds") or 0.0,
        iterations=found.get("iterations") or 0,
        noise_scale=found.get("noise_scale") or 0.0,
        estimates=[_estimate(entry) for entry in found["parameters"]],
        fitted=Measure(before.get("fitted"), after.get("fitted")),
        held_out=Measure(before.get("held_out"), after.get("held_out")),
        statements=[str(text) for text in found.get("statements") or []],
        models=list(found.get("models") or []),
        correlation=list(found.get("correlation") or []),
        warning=str(found.get("warning") or ""),
        likes={str(name): _like(entry) for name, entry in (found.get("like") or {}).items()},
        predicted=_predicted(found.get("predicted")),
        outlines=fit_outlines.read(found))


def _predicted(entry):
    if not entry:
        return None
    return Predicted(half_width_mm=float(entry["half_width_mm"]), coverage=float(entry["coverage"]))


def _like(entry):
    return Like(law=str(entry["law"]), distance=float(entry["distance"]),
                sentence=str(entry["sentence"]),
                others=tuple((str(other["law"]), float(other["distance"]))
                             for other in entry.get("others") or ()),
                parameters=dict(entry.get("parameters") or {}))


def _estimate(entry):
    interval = entry.get("interval")
    if not interval or None in interval:
        interval = None
    return Estimate(
        path=entry["path"], unit=entry.get("unit", ""), start=entry.get("start") or 0.0,
        value=float(entry["value"]), error=entry.get("standard_error"),
        grid_error=entry.get("grid_error"),
        interval=tuple(interval) if interval else None,
        at_bound=bool(entry.get("at_bound")), observable=entry.get("observable") is not False,
        statement=entry.get("statement") or "")


def stamp(folder):
    """Changes whenever a result is written; None where there is none."""
    return files.stamp(os.path.join(folder, RESULT_FILE))


def is_unfinished(folder):
    """Whether a fit lies there that Resume can go on with."""
    return os.path.isfile(os.path.join(folder, CHECKPOINT_FILE))


_known = {}


def load_quietly(folder):
    """load(), or None, for drawing: the file is read again only when it has changed."""
    path = os.path.join(folder, RESULT_FILE)
    key = (path, files.stamp(path))
    if _known.get("key") != key:
        try:
            found = load(folder)
        except JobError:
            found = None
        _known.update(key=key, value=found)
    return _known["value"]


def fitted_bodies(folder):
    """Names of the bodies whose materials the result in `folder` is of, in its order."""
    scene = files.read_json(os.path.join(folder, SCENE_FILE)).get("scene", {})
    found = {}
    for estimate in load(folder).estimates:
        owner, key, _axis = job_fit.split_path(estimate.path, scene)
        if key.startswith("material."):
            found[owner] = True
    return list(found)


def material(folder, body):
    """The document of a body's fitted material; "" is the only one. For a law without a formula its
    source says what it is like, and its provenance too. JobError where it was not fitted."""
    path, name = _material_file(folder, body)
    document = presets.read(path)
    like = load(folder).likes.get(name)
    if like is not None:
        document["source"] = f"{document['source']} {like.sentence}"
        document.setdefault("provenance", {})["like"] = {"law": like.law, "distance": like.distance}
    return document


def _material_file(folder, body):
    """(path, body's name) of a fitted material."""
    names = fitted_bodies(folder)
    if not names:
        raise JobError(translate("The fit found no material: none of its parameters belongs to "
                                 "one."))
    if not body and len(names) == 1:
        body = names[0]
    if body not in names:
        raise JobError(translate(
            "The fit found the material of {names}, not of '{name}'. Make that body the active one "
            "in Bodies.").format(names=", ".join(f"'{name}'" for name in names), name=body))
    # Another file than that of the first may be of an earlier fit.
    own = MATERIAL_FILE if body == names[0] else f"material_{body}.json"
    return os.path.join(folder, own), body


# -- the curve ---------------------------------------------------------------------------------

def history(folder):
    """The lines of fit/history.jsonl, a dictionary an iteration; the last may be half written."""
    path = os.path.join(folder, HISTORY_FILE)
    found = []
    try:
        with open(path, encoding="utf-8") as stream:
            for line in stream:
                if not line.endswith("\n"):
                    break
                try:
                    entry = json.loads(line)
                except ValueError:
                    continue
                if isinstance(entry, dict):
                    found.append(entry)
    except (OSError, UnicodeDecodeError):
        pass
    return found


def history_stamp(folder):
    """Changes whenever the history grows; None where there is none."""
    return files.stamp(os.path.join(folder, HISTORY_FILE))


@dataclass
class Segment:
    """A stretch of the curve: one stage of one law, of a fit to images one search. `places` count the lines of
    the history."""

    stage: str
    law: str
    places: list = field(default_factory=list)
    errors: list = field(default_factory=list)  # rms [mm]; of images the misfit over that of the first step
    of_images: bool = False


def segments(entries):
    """The accepted iterations of a history as Segments, that of the last one at the end; refused
    steps, and laws that are fitted side by side, leave gaps in `places`."""
    if not any("rms_mm" in entry for entry in entries):
        return _searches(entries)
    found = {}
    for place, entry in enumerate(entries):
        stage, law = str(entry.get("stage", "")), str(entry.get("law", ""))
        segment = found.setdefault((stage, law), Segment(stage, law))
        rms = entry.get("rms_mm")
        if entry.get("accepted", True) and _above_zero(rms):
            segment.places.append(place)
            segment.errors.append(float(rms))
    return sorted((segment for segment in found.values() if segment.places),
                  key=lambda segment: segment.places[-1])


def _searches(entries):
    """The stretches of a fit to images, which tells no error in mm. Each of its searches has residuals of its own, of
    other frames or another blur: the root of its cost is compared with that after its first step."""
    found, first, last = [], 1.0, None
    for place, entry in enumerate(entries):
        stage, iteration, cost = str(entry.get("stage", "")), entry.get("iteration", 0), entry.get("cost")
        if not _above_zero(cost):
            continue
        # The step by which a search ends is told twice, of a refined plan with another cost.
        if last is None or stage != last[0] or iteration < last[1] or iteration == last[1] == 1 and cost != last[2]:
            found.append(Segment(stage, "", of_images=True))
            first = cost
        found[-1].places.append(place)
        found[-1].errors.append(math.sqrt(cost / first))
        last = stage, iteration, cost
    return found


def _above_zero(value):
    return isinstance(value, int | float) and math.isfinite(value) and value > 0.0
