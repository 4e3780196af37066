# SPDX-License-Identifier: GPL-3.0-or-later
"""What a diagnosis has found, as diagnosis.json in the fit's cache folder says it (docs/formats.md,
«The report of a diagnosis»)."""

import os
import re
from dataclasses import dataclass, field

from .. import effects, quantities
from ..compat import translate
from ..jobs import JobError
from . import files, number_text

REPORT_FILE = "diagnosis.json"
PAGE_FILE = "diagnosis.html"
EXTENDED_FILE = "extended.json"
SCHEMA = "matterfit.report/1"

# Labels of causes that are no kind of effect; an effect's label is that of its kind.
_LABELS = {
    "gravity_size": "Gravity", "gravity_direction": "Gravity's Direction", "friction": "Friction",
    "restitution": "Contact Damping", "ground_tilt": "Sloping Ground",
    "damping_shear": "Shear Damping", "damping_bulk": "Bulk Damping", "relaxation": "Relaxation",
    "attached_mass": "Attached Mass", "velocity": "Velocity", "spin": "Spin",
    "time_offset": "Time Offset", "frame_rate": "Frame Rate", "scale": "Scale",
    "camera_drift": "Camera Drift", "camera_roll": "Camera Roll", "tracker_lag": "Tracker Lag",
    "rolling_shutter": "Rolling Shutter",
    "contact_kind": "Kind of Contact", "yield": "Yielding", "swapped_tracks": "Swapped Tracks",
    "stiffness_change": "Other Stiffness", "law_correction": "Material Law",
}


@dataclass(frozen=True)
class Number:
    """A number that a cause has, SI; `error` is its standard error, None where it is not known."""

    name: str
    value: float
    unit: str = ""
    error: float = None

    @property
    def label(self):
        """Its name as people read it: shear_direction[1] as shear direction Y."""
        name, bracket, index = self.name.replace("_", " ").partition("[")
        return f"{name} {dict(enumerate('XYZ')).get(int(index[:-1]), index[:-1])}" if bracket else name

    @property
    def text(self):
        return number_text.value_text(self.value, self.error, self.unit)


@dataclass(frozen=True)
class Cause:
    """One cause that was tried. Errors in metres; `gain` is the share of the held-out error above
    its floor that the cause takes away, None where it could not be measured."""

    effect: str
    scope: str = "shared"  # or "body NAME", "capture NAME"
    where: str = ""
    sentence: str = ""
    evidence: str = ""
    probability: float = 0.0
    gain: float = None
    gain_interval: tuple = None
    holdout_before: float = None
    holdout_after: float = None
    numbers: tuple = ()
    confused_with: tuple = ()
    observable: bool = True
    accepted: bool = False
    explained: float = None  # share of the excess that it takes away; None where it was not refitted

    @property
    def label(self):
        return label_of(self.effect)


@dataclass(frozen=True)
class WorstFrame:
    """`frame` is the scene's; `where` [m] in the world, `size` [m]."""

    capture: str
    frame: int
    where: tuple
    size: float


@dataclass(frozen=True)
class FrameError:
    """Root mean square distances in one frame of a capture [m]; `after` with what was named, None where
    nothing was; `noise` and `numerical` what noise and the solver's spread make."""

    capture: str
    frame: int
    before: float
    after: float
    noise: float
    numerical: float
    held_out: bool


@dataclass(frozen=True)
class Report:
    verdict: str
    sentence: str
    causes: tuple  # the most probable first
    worst: tuple
    not_observable: tuple = ()
    next_recording: str = ""
    statements: tuple = ()
    model: dict = None  # the scene with what was accepted; None without
    fitted: dict = field(default_factory=dict)  # path: value of the fit that was diagnosed
    frames: tuple = ()  # FrameErrors, capture after capture
    captures: tuple = ()  # entries of the document with what a camera did taken back


def label_of(effect):
    """The panel's words for a cause, in English."""
    if any(kind.name == effect for kind in effects.KINDS):
        return effects.find(effect).title
    stated = quantities.find(effect)  # a number of the material, by its document path
    if stated is not None:
        return stated.title
    return _LABELS.get(effect) or effect.replace("_", " ").title()


# In it the library names causes as the report does: gravity_size and frame_rate stay alike …
_ALIKE = re.compile(r"\b(\w+) and (\w+)(?= stay alike in each recording that was tried\.)")


def _with_labels(text):
    """What the next recording would be, with causes called as in the panel."""
    return _ALIKE.sub(lambda match: f"{label_of(match[1])} and {label_of(match[2])}", text)


def stamp(folder):
    """Changes whenever a report is written; None where there is none."""
    return files.stamp(os.path.join(folder, REPORT_FILE))


def load(folder):
    """The report in a fit's cache folder, None where there is none; JobError where it is damaged."""
    if stamp(folder) is None:
        return None
    path = os.path.join(folder, REPORT_FILE)
    document = files.read_json(path)
    if not isinstance(document, dict) or document.get("schema") != SCHEMA:
        raise JobError(translate("{path}: holds no report of a diagnosis that this version reads. "
                                 "Diagnose again.").format(path=path))
    try:
        return _report(document)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise JobError(translate("{path}: the report of the diagnosis is damaged ({error}). "
                                 "Diagnose again.").format(
                                     path=path,
                                     error=f"{type(error).__name__}: {error}")) from error


def _report(document):
    return Report(
        verdict=str(document["verdict"]),
        sentence=str(document["sentence"]),
        causes=_causes(document),
        worst=tuple(WorstFrame(str(entry["capture"]), int(entry["frame"]),
                               tuple(float(value) for value in entry["where"]),
                               float(entry["size"]))
                    for entry in document["residual"]["worst"]),
        not_observable=tuple(str(name) for name in document.get("not_observable") or ()),
        next_recording=_with_labels(str(document.get("next_recording") or "")),
        statements=tuple(str(text) for text in document.get("statements") or ()),
        model=dict(document["model"]) if document.get("model") else None,
        frames=tuple(_frame(entry) for entry in document["residual"].get("by_frame", ())),
        captures=tuple(document.get("model_captures") or ()),
        fitted={entry["path"]: float(entry["value"])
                for entry in (document.get("fit") or {}).get("parameters", ())})


def _causes(document):
    """The table's rows; a law that improves the extended model is one, after what was accepted."""
    causes = [_cause(entry) for entry in document["causes"]]
    law = document.get("law") or {}
    if law.get("improves"):
        place = sum(cause.accepted for cause in causes)
        causes.insert(place, _cause({**law, "effect": "law_correction", "accepted": True, "probability": 1.0}))
    return tuple(causes)


def _cause(entry):
    interval = entry.get("gain_interval")
    return Cause(
        effect=str(entry["effect"]),
        scope=str(entry.get("scope") or "shared"),
        where=str(entry.get("where") or ""),
        sentence=str(entry.get("sentence") or ""),
        evidence=str(entry.get("evidence") or ""),
        probability=float(entry.get("probability") or 0.0),
        gain=_known(entry.get("gain")),
        gain_interval=tuple(interval) if interval and None not in interval else None,
        holdout_before=_known(entry.get("holdout_before")),
        holdout_after=_known(entry.get("holdout_after")),
        numbers=tuple(Number(name, float(found["value"]), str(found.get("unit") or ""),
                             _known(found.get("stderr")))
                      for name, found in entry["parameters"].items()
                      if found["value"] is not None),
        confused_with=tuple(str(rival["effect"]) for rival in entry.get("confused_with") or ()),
        observable=bool(entry.get("observable", True)),
        accepted=bool(entry.get("accepted")),
        explained=_known(entry.get("explained")) if entry.get("refitted") else None)


def _frame(entry):
    return FrameError(
        str(entry["capture"]), int(entry["frame"]), float(entry["before"] or 0.0),
        _known(entry.get("after")), float(entry.get("noise") or 0.0),
        float(entry.get("numerical") or 0.0), bool(entry.get("held_out")))


def _known(value):
    """A number, or None: JSON has no infinity, so what was not finite is null."""
    return None if value is None else float(value)


_cached = {}


def load_quietly(folder):
    """load(), or None, for drawing: the file is read again only when it has changed."""
    key = (folder, stamp(folder))
    if _cached.get("key") != key:
        try:
            found = load(folder)
        except JobError:
            found = None
        _cached.update(key=key, value=found)
    return _cached["value"]


def is_of_fit(report, result):
    """Whether the fit that was diagnosed is the one whose FitResult lies there now."""
    return result is not None and report.fitted == {
        estimate.path: estimate.value for estimate in result.estimates}
