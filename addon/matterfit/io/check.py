# SPDX-License-Identifier: GPL-3.0-or-later
"""What a check says before a fit: which values the recording will identify, and how well (docs/formats.md,
«check»). The scene keeps it as text, in `fit.check`."""

import json
import math
from dataclasses import dataclass, replace

from .. import quantities
from ..compat import translate
from ..quantities import LOG
from . import frames, number_text, words

SCHEMA = "matterfit.check/1"
_KEPT = ("schema", "parameters", "ties", "enough", "record_instead", "noise", "notes")
MANY = 100.0  # times as uncertain: how many more does not matter


@dataclass(frozen=True)
class Parameter:
    """One number that a fit would look for, SI. `error` is the standard error that it will have,
    None where nothing that was recorded depends on it; `known`: that is small enough."""

    path: str
    unit: str
    start: float
    error: float
    known: bool


@dataclass(frozen=True)
class Enough:
    """Whether the frame rate, the duration, the noise suffice. `ratio`: how much more uncertain
    `parameter` would be with half of the frames or of the time; of noise its error over what would
    be small enough."""

    what: str
    enough: bool
    ratio: float
    parameter: str


@dataclass(frozen=True)
class Report:
    """What was found, and for which recordings, frames [first, end) and rows of the list."""

    parameters: tuple
    ties: tuple  # lists of paths of which only a combination is identified
    enough: tuple
    record_instead: str
    sigma: float  # noise of a coordinate [m]; None where it is not known
    notes: tuple
    asked: dict

    @property
    def known(self):
        return sum(parameter.known for parameter in self.parameters)


def stored(result, about):
    """The text that a scene keeps of a check's result; `about`: asked() when it began."""
    return json.dumps({**{key: result.get(key) for key in _KEPT}, "asked": about})


def asked(scene):
    """What a check is about, as JSON has it: another one of these makes it stale."""
    settings = scene.matterfit
    return {"captures": [capture.name for capture in settings.captures if capture.enabled],
            "bodies": [body.name for body in settings.bodies if body.enabled],
            "frames": list(frames.frame_range(scene)),
            "rows": [[row.owner, row.key, list(row.axes)] for row in settings.fit.parameters
                     if row.enabled]}


def read(text):
    """The Report that a scene keeps; None where there is none, or none that this version reads."""
    try:
        found = json.loads(text) if text else None
        if not isinstance(found, dict) or found.get("schema") != SCHEMA:
            return None
        return _report(found)
    except (ValueError, KeyError, TypeError, AttributeError):
        return None


def _report(found):
    return Report(
        parameters=tuple(_parameter(entry) for entry in found["parameters"]),
        ties=tuple(tuple(str(path) for path in tie["parameters"]) for tie in found["ties"]),
        enough=tuple(Enough(str(entry["what"]), bool(entry["enough"]), _finite(entry.get("ratio")),
                            str(entry.get("parameter") or "")) for entry in found["enough"]),
        record_instead=str(found.get("record_instead") or ""),
        sigma=_finite((found.get("noise") or {}).get("sigma")),
        notes=tuple(str(note) for note in found.get("notes") or ()),
        asked=dict(found.get("asked") or {}))


def _parameter(entry):
    error = _finite(entry.get("error"))
    return Parameter(str(entry["path"]), str(entry.get("unit") or ""), _finite(entry.get("start")),
                     error, bool(entry["known"]) and error is not None)


def _finite(value):
    """A number, or None: JSON has neither infinity nor NaN, and neither is shown."""
    return float(value) if isinstance(value, int | float) and math.isfinite(value) else None


# -- words -------------------------------------------------------------------------------------

def listed(settings, paths):
    """Names as people list them: A, B and C; each once."""
    names = list(dict.fromkeys(words.named(settings, path) for path in paths))
    if len(names) == 1:
        return names[0]
    return translate("{names} and {last}").format(names=", ".join(names[:-1]), last=names[-1])


def rows(settings, report):
    """[(Parameter, name)] as they are shown: three axes that are all identified are one row, with the
    largest of their errors, and so are the numbers of a code that are identified, or are not."""
    found, joined = [], {}
    for parameter in report.parameters:
        owner, key, axis = words.split(settings, parameter.path)
        code = _is_code(key)
        if axis is None or not parameter.known and not code:
            found.append((parameter, words.named(settings, parameter.path)))
            continue
        base = parameter.path[:parameter.path.rindex("[")]
        place = (owner, key, parameter.known)
        if place not in joined:
            joined[place] = len(found)
            found.append(([], base))
        found[joined[place]][0].append(parameter)
    shown = []
    for parameter, label in found:
        if isinstance(parameter, Parameter):
            shown.append((parameter, label))
        elif _is_code(words.split(settings, label)[1]):
            shown.append(_of_code(settings, parameter, label))
        elif len(parameter) == 3:
            worst = max(parameter, key=lambda each: each.error)
            shown.append((replace(worst, path=label), words.named(settings, label)))
        else:
            shown += [(each, words.named(settings, each.path)) for each in parameter]
    return shown


def _is_code(key):
    row = quantities.find(key)
    return row is not None and row.is_code


def _of_code(settings, parameters, path):
    """The row of a code's numbers, which are all identified or are all not."""
    worst = max(parameters, key=lambda each: math.inf if each.error is None else each.error)
    label = translate("{name}: {n} of {total}").format(
        name=words.named(settings, path), n=len(parameters),
        total=quantities.find(words.split(settings, path)[1]).size)
    return replace(worst, path=path), label


def error_text(settings, parameter):
    """To what error a parameter is identified: ± 440 Pa (0.44 %)."""
    if parameter.error is None:
        return translate("nothing recorded shows it")
    unit = f" {parameter.unit}" if parameter.unit else ""
    text = f"± {number_text.rounded(parameter.error, parameter.error)}{unit}"
    key = words.split(settings, parameter.path)[1]
    row = quantities.find(key)
    if row is not None and row.scale == LOG and parameter.start:
        text += f" ({percent(parameter.error / abs(parameter.start))})"
    return text if parameter.known else translate("unknown: {error}").format(error=text)


def percent(share):
    """Two digits, and no power of ten."""
    share *= 100.0
    if share >= 1000.0:
        return "> 1000 %"
    return f"{share:.0f} %" if share >= 10.0 else f"{share:.2g} %"


def verdict(settings, enough, sigma):
    """What one of the three Enough says, for people."""
    who = words.named(settings, enough.parameter) if enough.parameter else ""
    times = f"{enough.ratio:.2g}" if enough.ratio is not None and enough.ratio < MANY else (
        translate("more than 100"))
    if enough.what == "frame rate":
        return translate("The frame rate suffices.") if enough.enough else translate(
            "The frame rate hardly suffices: at half of it {name} would be {times} times as "
            "uncertain. Record more frames a second.").format(name=who, times=times)
    if enough.what == "duration":
        return translate("The recording is long enough.") if enough.enough else translate(
            "The recording is short: its second half identifies {name} the most. Record longer.").format(
                name=who)
    if enough.enough:
        return translate("The noise is small enough.")
    if sigma is None or not enough.ratio:
        return translate("The noise hides {name}.").format(name=who)
    return translate(
        "The noise hides {name}: it is {noise} mm, and would have to be {wanted} mm.").format(
            name=who, noise=f"{1e3 * sigma:.2g}", wanted=f"{1e3 * sigma / enough.ratio:.2g}")
