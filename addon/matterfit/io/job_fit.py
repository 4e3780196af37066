# SPDX-License-Identifier: GPL-3.0-or-later
"""The `fit` object of the job document, and the paths of what is fitted."""

import re

from .. import laws
from ..compat import translate, translate_label
from ..jobs import JobError
from ..quantities import LINEAR, LOGIT
from . import fit_rows
from .files import number, numbers

# Simulations at the end of a fit to tracks that say how sure what is held out is predicted.
_DRAWS = 16
_PLAIN = re.compile(r"^[\w-]+$")
_STEP = re.compile(r"""\[(\d+)\]|"([^"]*)"|'([^']*)'|([^.\[\]"']+)""")


def document(settings, scene_document, captures):
    """What is to be found and how; JobError with what to change.

    `scene_document` and `captures` are those of the same job: what they hold is where the search
    starts.
    """
    fit = settings.fit
    _check_captures(captures)
    images = ["cameras" in capture for capture in captures]
    if any(images) and fit.law != "BODY":
        raise JobError(translate("Fit: laws are compared by points only, and '{name}' is by images. Set Law to The "
                                 "Body's Law, or disable captures by images.").format(
                                     name=captures[images.index(True)]["name"]))
    scene_document = {**scene_document, "captures": captures}
    tried = tried_laws(fit)
    if fit.law == "FIND" and not tried:
        raise JobError(translate("Fit: no law is chosen to be tried. Choose some under "
                                 "Candidates."))
    entries = []
    for row in fit.parameters:
        if (row.enabled and owner_document(scene_document, row) is not None
                and takes_part(fit, row.key)):
            entries += _Entry(settings, row, scene_document).entries()
    if fit.law == "UNKNOWN":
        entries = [*_stiffness(settings, scene_document, entries), *entries]
    if not entries:
        raise JobError(translate("Fit: no parameter is switched on. Switch on at least one in the "
                                 "list."))
    found = {"parameters": entries}
    if not all(images):
        found["loss"] = fit.loss.lower()
    found["huber"] = number(fit.huber) if fit.use_huber else 0
    found["iterations"] = fit.iterations
    if not any(images):
        found.update(_of_tracks(fit))
    if tried:
        found["laws"] = "all" if len(tried) == len(laws.CANDIDATES) else [law.lower() for law in tried]
    if fit.weight_steps and has_weights(settings):
        found["weights"] = fit.weight_steps
    elif fit.correction_steps and not any(images):
        found["correction"] = fit.correction_steps
    return found


def _of_tracks(fit):
    """What means nothing where images are fitted."""
    found = {"windows": fit.windows}
    if fit.loss == "TRACKS":
        found["draws"] = _DRAWS
    if fit.levels:
        found["levels"] = [2**level for level in reversed(range(fit.levels))]
    return found


def has_weights(settings):
    """Whether weights of the neural law take part in a fit."""
    fit = settings.fit
    if fit.law == "FIND":
        return "NEURAL_ISOTROPIC" in fit.laws
    return fit.law == "BODY" and any(
        body.material.law in ("NEURAL_ISOTROPIC", "NEURAL") for body in settings.bodies
        if body.enabled and body.role == "BODY")


def _stiffness(settings, scene_document, entries):
    """Paths of the stiffness of each body that captures show, where it is not among `entries`: a law
    without a class is looked for in units of it, whatever the body's own law calls its stiffness."""
    listed = {entry if isinstance(entry, str) else entry["path"] for entry in entries}
    bodies = [item["name"] for item in scene_document["bodies"]]
    found = [owned_path(scene_document, name, "material.E")
             for name in bodies if name in fit_rows.observed_bodies(settings)]
    return [path for path in found if path not in listed]


def _check_captures(captures):
    if not captures:
        raise JobError(translate("There is no capture to fit to. Import one in Capture, or enable "
                                 "it."))
    if all(capture.get("holdout", {}).get("capture") for capture in captures):
        raise JobError(translate("Every capture is held out whole, so nothing is left to fit to. "
                                 "Set Hold-out of one to Nothing or Last Frames."))


def tried_laws(fit):
    """The candidates; none where the body's own law is fitted."""
    if fit.law == "UNKNOWN":
        return ["LATENT"]
    return [law[0] for law in laws.CANDIDATES if law[0] in fit.laws] if fit.law == "FIND" else []


def takes_part(fit, key):
    """Whether one of the candidates has the parameter; without candidates the body's law has."""
    tried = tried_laws(fit)
    if not tried or key not in fit_rows.law_keys():
        return True
    return any(key[len("material."):] in laws.PARAMETERS[law] for law in tried)


class _Entry:
    """One row of the list as entries of `fit.parameters`."""

    def __init__(self, settings, row, scene_document):
        self.row = row
        self.quantity = fit_rows.quantity_of(settings, row)
        self.where = f"{row.owner}: " if row.owner else ""
        if self.quantity is None:
            raise JobError(translate("Fit: '{name}' is not in the scene any more. Press List "
                                     "Parameters beside the list.").format(name=row.name))
        self.where += translate_label(self.quantity.label)
        self.path = path(scene_document, row)
        self.now = _lookup(owner_document(scene_document, row), row.key)
        if row.key == "placement.rotation":
            self.now = None  # it is looked for on top of what is given, from none
        elif row.key == "start_frame" and self.now is None:
            self.now = scene_document["frames"][0]

    def entries(self):
        row = self.row
        if self.quantity.is_code:
            return [f"{self.path}[{index}]" for index in range(self.quantity.size)]
        if self.quantity.is_vector:
            return self._vector()
        start = self.now if not row.use_start else row.start
        if start is None:
            raise JobError(translate(
                "Fit: {where} has no value yet to start from. Switch on its Start, or give it a "
                "value in Bodies or Solver.").format(where=self.where))
        self._check_start(start)
        entry = {"path": self.path}
        if row.use_start:
            entry["start"] = number(row.start)
        if row.use_bounds:
            self._check_bounds(start)
            entry["bounds"] = numbers((row.low, row.high))
        if row.use_prior:
            self._check_prior()
            entry["prior"] = {"mean": number(row.mean), "sigma": number(row.sigma)}
        return [self.path if len(entry) == 1 else entry]

    def _check_start(self, start):
        if self.quantity.scale != LINEAR and start <= 0.0:
            raise JobError(translate(
                "Fit: {where} would start at {start}, and must start above 0. Switch on its Start "
                "and type a value.").format(where=self.where, start=f"{start:g}"))
        if self.quantity.scale == LOGIT and start >= 0.5:
            raise JobError(translate(
                "Fit: {where} would start at {start}, and must start below .5. Switch on its "
                "Start and type a value.").format(where=self.where, start=f"{start:g}"))

    def _check_bounds(self, start):
        low, high = self.row.low, self.row.high
        if low >= high:
            raise JobError(translate(
                "Fit: {where}: Lowest is {low} and Highest is {high}. Lowest must be the smaller "
                "one.").format(where=self.where, low=f"{low:g}", high=f"{high:g}"))
        if self.quantity.scale != LINEAR and low <= 0.0:
            raise JobError(translate(
                "Fit: {where}: Lowest is {low}, and must be above 0.").format(
                    where=self.where, low=f"{low:g}"))
        if not low <= start <= high:
            raise JobError(translate(
                "Fit: {where} would start at {start}, outside its bounds {low} to {high}. Widen "
                "the bounds, or change Start.").format(
                    where=self.where, start=f"{start:g}", low=f"{low:g}", high=f"{high:g}"))

    def _check_prior(self):
        mean = self.row.mean
        if self.quantity.scale != LINEAR and mean <= 0.0:
            raise JobError(translate(
                "Fit: {where}: Expected is {mean}, and must be above 0.").format(
                    where=self.where, mean=f"{mean:g}"))
        if self.quantity.scale == LOGIT and mean >= 0.5:
            raise JobError(translate(
                "Fit: {where}: Expected is {mean}, and must be below .5.").format(
                    where=self.where, mean=f"{mean:g}"))

    def _vector(self):
        row = self.row
        axes = [axis for axis in range(3) if row.axes[axis]]
        if not axes:
            raise JobError(translate("Fit: {where} has no axis that is looked for. Switch on one, "
                                     "or switch it off.").format(where=self.where))
        own = row.use_start or row.use_bounds or row.use_prior
        if len(axes) == 3 and not own:
            return [self.path]
        start = tuple(row.start_vector) if row.use_start else self.now
        if isinstance(start, dict):
            raise JobError(translate("Fit: {where} is animated. Remove its keys, or switch it off "
                                     "in the list.").format(where=self.where))
        start = start or (0.0, 0.0, 0.0)
        entries = []
        for axis in axes:
            entry = {"path": f"{self.path}[{axis}]"}
            if row.use_start:
                entry["start"] = number(start[axis])
            if row.use_bounds:
                entry["bounds"] = numbers((start[axis] - row.reach, start[axis] + row.reach))
            if row.use_prior:
                entry["prior"] = {"mean": number(row.mean_vector[axis]),
                                  "sigma": number(row.sigma)}
            entries.append(entry if own else entry["path"])
        return entries


# -- paths -------------------------------------------------------------------------------------

def owner_document(scene_document, row):
    """The part of the scene, or the capture, that the row is about; None where it does not take
    part."""
    if not row.owner:
        return scene_document
    listed = scene_document[_list_of(row.key)]
    return next((item for item in listed if item["name"] == row.owner), None)


def _list_of(key):
    if key == "start_frame":
        return "captures"
    return "colliders" if key == "height" or key.startswith("contact.") else "bodies"


def path(scene_document, row):
    """The path of a row in the job document, as in --set; names that need quotes stand in them."""
    return owned_path(scene_document, row.owner, row.key) if row.owner else row.key


def owned_path(scene_document, owner, key):
    """The path of a quantity of a body, a collider or a capture."""
    where = _list_of(key)
    if _PLAIN.match(owner):
        return f"{where}.{owner}.{key}"
    for quote in "\"'":
        if quote not in owner:
            return f"{where}.{quote}{owner}{quote}.{key}"
    index = next(index for index, item in enumerate(scene_document[where])
                 if item["name"] == owner)
    return f"{where}[{index}].{key}"


def split_path(text, scene_document):
    """(owner, key, axis) of a path in a result: ('Cube', 'velocity', 2). The owner is "" for what
    belongs to the scene, the axis None for what is a number or all three. Where `scene_document`
    lists them, numbers stand for bodies, colliders and captures."""
    steps = [next(part for part in match.groups() if part is not None)
             for match in _STEP.finditer(text)]
    if steps and steps[0] == "scene":
        steps = steps[1:]
    owner = ""
    if len(steps) > 1 and steps[0] in ("bodies", "colliders", "captures"):
        listed, owner = scene_document.get(steps[0], []), steps[1]
        names = [item.get("name", "") for item in listed]
        if owner not in names and owner.isdigit() and int(owner) < len(names):
            owner = names[int(owner)]
        steps = steps[2:]
    elif steps and steps[0] != "gravity" and len(scene_document.get("bodies", [])) == 1:
        owner = scene_document["bodies"][0].get("name", "")
    axis = None
    if steps and steps[-1].isdigit():
        axis = int(steps.pop())
    key = ".".join(steps)
    return owner, re.sub(r"(^|\.)(maxwell|poses)\.(\d+)", r"\1\2[\3]", key), axis


def _lookup(item, key):
    """The value at `key` of a part of the document; None where it has none."""
    for step in _STEP.finditer(key):
        index = step.group(1)
        if index is not None:
            item = item[int(index)]
        elif isinstance(item, dict) and step.group(0) in item:
            item = item[step.group(0)]
        else:
            return None
    return item
