# SPDX-License-Identifier: GPL-3.0-or-later
"""Stress against stretch in the 3D View: of the fitted material with the nearest known law, and of the
active body's. Pulled along one axis, along two, sheared; what the recording showed is shaded."""

import json
import math
from dataclasses import dataclass

from .. import native
from ..compat import translate_label
from ..io import fit_results, material_check, material_values, takes
from ..jobs import JobError
from ..props import scene as scene_props
from . import drawing, fit_overlay

LEFT, BOTTOM, WIDTH, HEIGHT, ACROSS, STEP = 124, 56, 150, 110, 180, 190  # pixels
COLORS = (drawing.WHITE, (0.95, 0.75, 0.3, 1.0), (0.5, 0.85, 0.45, 1.0))
PULLS = (("uniaxial", "stretch", "Pulled"), ("equibiaxial", "stretch", "Pulled Two Ways"),
         ("shear", "shear", "Sheared"))

_known = {}


@dataclass(frozen=True)
class Line:
    """The curves of one law, as the library gives them."""

    label: str
    curve: dict


@dataclass(frozen=True)
class Curves:
    title: str
    lines: tuple
    strain: float = 0.0  # that was seen; 0: none is known


def forget():
    _known.clear()


def of_material(document, title, beside=None):
    """The Curves of a material as files hold it, with those of a second `material` beside it; None
    where the library does not give them. Asked for once: the texts are the key."""
    key = json.dumps((document, beside), sort_keys=True)
    if key not in _known:
        if len(_known) > 16:  # a slider that is dragged leaves one at each step
            _known.clear()
        try:
            _known[key] = _found(document, beside)
        except JobError:
            _known[key] = None
    found = _known[key]
    return None if found is None else Curves(title, *found)


def _found(document, beside):
    # The search for the nearest law takes seconds; a correction is shown without it at once.
    neural = document["material"]["law"] in ("neural_isotropic", "latent")
    own = native.curves(document, beside=not neural)["material"]
    lines = [Line(curve["label"], curve) for curve in own["curves"]]
    if beside is not None:
        other = native.curves({**document, "material": beside}, beside=False, strain=own["strain"],
                              rate=own["rate"])["material"]
        lines += [Line(curve["label"], curve) for curve in other["curves"]]
    return tuple(lines), (own["excited"] or {}).get("strain", 0.0)


def of_fit(settings):
    """The Curves of the first fitted material; None without a result."""
    fit = settings.fit
    if not (fit.show_curves and fit.done and fit.run.folder) or fit_overlay.running_fit(settings):
        return None
    folder = takes.locate(fit.run).folder
    result = fit_results.load_quietly(folder)
    try:
        names = fit_results.fitted_bodies(folder) if result is not None else []
        if not names:
            return None
        document = fit_results.material(folder, names[0])
    except JobError:
        return None
    like = result.likes.get(names[0])
    beside = {"law": like.law, **like.parameters} if like is not None and like.parameters else None
    return of_material(_asked(document), names[0], beside)


def of_body(settings):
    """The Curves of the active body's material."""
    body = scene_props.active_body(settings)
    if not settings.show_curves or body is None or body.role != "BODY":
        return None
    if body.material.law == "NEURAL" and not material_values.weights_of(body.material):
        return None
    document = {"material": material_values.document(body.material)}
    seen = material_values.excited(body.material)
    if seen is not None:
        document["excited"] = seen
    return of_material(_asked(document), body.name)


def _asked(document):
    """What the library needs of it."""
    asked = {"schema": material_check.SCHEMA, "material": document["material"]}
    if document.get("excited"):
        asked["excited"] = document["excited"]
    return asked


def draw(context, place):
    settings = context.scene.matterfit
    scale = context.preferences.system.ui_scale
    for found in (of_fit(settings), of_body(settings)):
        if found is not None:
            _draw(found, BOTTOM + place * STEP, scale)
            place += 1


def _draw(found, bottom, scale):
    graph = None
    for column, (pull, along, name) in enumerate(PULLS):
        curves = [line.curve[pull] for line in found.lines]
        shown = [curve for curve in curves if curve is not None]
        if not shown:
            continue
        stresses = [value for curve in shown for value in curve["nominal"]]
        places = [value for curve in shown for value in curve[along]]
        low, high = min(0.0, *stresses), max(1e-9, *stresses)
        graph = drawing.Graph((LEFT + column * ACROSS, bottom, WIDTH, HEIGHT), scale,
                              (min(places), max(places)), (low, high))
        begin, end = seen(pull, found.strain)
        if end > begin:
            graph.shade(max(begin, min(places)), min(end, max(places)), drawing.HELD_OUT)
        for curve, color in zip(curves, COLORS, strict=False):
            if curve is not None:
                graph.curve(curve[along], curve["nominal"], color)
        graph.labels(translate_label(name), stress_text(high), f"{min(places):.3g}",
                     f"{max(places):.3g}")
    if graph is not None:
        graph.legend([(f"{found.title}: {translate_label(line.label)}" if index == 0
                       else translate_label(line.label), color)
                      for index, (line, color) in enumerate(zip(found.lines, COLORS, strict=False))])


def seen(pull, strain):
    """From where to where a pull stays within a strain |dev ε|, if it keeps its volume."""
    if strain <= 0.0:
        return (0.0, 0.0)
    if pull == "shear":
        return (0.0, 2.0 * math.sinh(strain / math.sqrt(2.0)))
    most = strain * math.sqrt(2.0 / 3.0) if pull == "uniaxial" else strain / math.sqrt(6.0)
    return (math.exp(-most), math.exp(most))


def stress_text(stress):
    for size, unit in ((1e9, "GPa"), (1e6, "MPa"), (1e3, "kPa")):
        if stress >= size:
            return f"{stress / size:.3g} {unit}"
    return f"{stress:.3g} Pa"
