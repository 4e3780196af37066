# SPDX-License-Identifier: GPL-3.0-or-later
"""Puts a cause that a diagnosis has accepted into the scene: its own properties where it has one for
it, else the list of effects; and with it the numbers that were fitted, as they are beside the cause. The
values are those of the report's extended model, so that doing it twice changes nothing more."""

import os

import bpy
from mathutils import Vector

from .. import effects, names, quantities
from ..compat import translate, translate_label
from ..jobs import JobError
from ..props.diagnosis import is_ignored
from . import (
    diagnosis,
    files,
    fit_results,
    fit_values,
    job_fit,
    material_values,
    transforms,
)
from .extend_surroundings import OF_CAPTURE, Surroundings, acts_on_body, set_contact_kind
from .fit_apply import Application

# Quantities of the scene and of the body that a cause changes, applied as those of a fit are.
_OF_SCENE = {"gravity_size": "gravity", "gravity_direction": "gravity"}
_OF_BODY = {"velocity": "velocity", "spin": "spin"}
_CONTACT = {"friction": "mu", "restitution": "damping"}
_MATERIAL = ("damping_shear", "damping_bulk")
_SURROUNDINGS = ("hidden_collider", "ground_tilt", "camera_roll", *OF_CAPTURE)
_STATED = "material."  # parameters of the law, by their document paths
_MASS = "Attached Mass"  # the row's name, by which it is found again


def _of_one_recording(cause, report):
    """Whether it is in the scene of one recording alone, which is the document's and not the panel's."""
    return cause.scope.startswith("capture ") and (
        cause.effect not in OF_CAPTURE or (cause.effect == "scale" and acts_on_body(report)))


def has_place(cause):
    """Whether the panel has a setting for the cause."""
    return (cause.effect in {*_OF_SCENE, *_OF_BODY, *_CONTACT, *_MATERIAL, *_SURROUNDINGS, "contact_kind",
                             "yield", "relaxation", "attached_mass", "law_correction"}
            or cause.effect.startswith(_STATED)
            or any(kind.name == cause.effect for kind in effects.KINDS))


def extend(scene, folder, report, cause):
    """Sets what `cause` of the Report in `folder` changes, and what was fitted. Returns what could not be
    set, a sentence each; JobError where nothing is set."""
    label = translate_label(cause.label)
    if not cause.accepted or report.model is None:
        raise JobError(translate("{name} was not accepted as a cause: {evidence}").format(
            name=label, evidence=cause.evidence or cause.sentence))
    if is_ignored(scene.matterfit, cause.effect):
        raise JobError(translate("{name} is ignored. Press Accept beside it first.").format(name=label))
    if _of_one_recording(cause, report):
        raise JobError(translate(
            "{name} acts in the recording '{capture}' alone, and settings of the panel are those of all. The "
            "model that was extended by what was accepted is the job {path}, which the matterfit tool runs."
            ).format(name=label, capture=cause.scope.removeprefix("capture "),
                     path=os.path.join(folder, diagnosis.EXTENDED_FILE)))
    if not has_place(cause):
        raise _without_place(folder, label)
    return _Extension(scene, folder, report, cause).run()


def _without_place(folder, label):
    return JobError(translate(
        "{name} has no setting in the panel. The model that was extended by what was accepted "
        "is the job {path}, which the matterfit tool runs.").format(
            name=label, path=os.path.join(folder, diagnosis.EXTENDED_FILE)))


def _is_whole(material, given):
    """Whether a fitted material is one as a whole: of a law that the fit found, or with its weights."""
    return material.law != given["law"].upper() or "weights" in given


def _set_number(material, key, given):
    """`key` of a body's material, from the document's `material`."""
    branch = quantities.branch_of(key)
    if branch is not None:
        index, name = branch
        setattr(material.maxwell[index], name, given["maxwell"][index][name])
        return
    name = key.removeprefix("material.")
    if name == "latent":
        material.use_latent = True
    setattr(material, name, given[name])


class _Extension:
    def __init__(self, scene, folder, report, cause):
        self.scene = scene
        self.settings = scene.matterfit
        self.folder = folder
        self.report = report
        self.model = report.model
        self.cause = cause
        self.scale = transforms.metres(scene)

    def _application(self):
        run = self.settings.fit.run
        take = self.settings.takes.get(run.name)
        return Application(self.scene, {**self.model, "captures": list(self.report.captures)}, run, take)

    def _what_was_fitted(self):
        work = self._application()
        starts = {item.get("name"): item.get("start_frame") for item in self.report.captures}
        for path in self.report.fitted:
            owner, key, _axis = job_fit.split_path(path, work.document)
            if key == "start_frame" and starts.get(owner) is None:
                continue
            work.note(fit_results.Estimate(path, value=starts.get(owner, 0.0)))
        work.check()
        return work

    def run(self):
        effect = self.cause.effect
        try:
            fitted = self._what_was_fitted()
            if effect in _OF_SCENE:
                self._as_fitted("", _OF_SCENE[effect])
            elif effect in _OF_BODY:
                self._as_fitted(self._body_document()["name"], _OF_BODY[effect])
            elif effect in _CONTACT:
                self._contact(_CONTACT[effect])
            elif effect == "contact_kind":
                self._contact("mu")
            elif effect in ("yield", "law_correction") or effect.startswith(_STATED):
                self._body()
                self._law()
            elif effect in _MATERIAL:
                setattr(self._body().material, effect, self._body_document()["material"][effect])
            elif effect == "relaxation":
                self._relaxation()
            elif effect == "attached_mass":
                self._mass()
            elif effect in _SURROUNDINGS:
                self._surroundings(effect)
            else:
                self._effect(effects.find(effect))
            self._set_fitted(fitted)
            return fitted.left
        except (KeyError, IndexError, TypeError) as error:
            raise JobError(translate(
                "{path}: its model holds nothing of {name} ({error}). Diagnose again.").format(
                    path=os.path.join(self.folder, diagnosis.REPORT_FILE), name=self.cause.label,
                    error=f"{type(error).__name__}: {error}")) from error

    def _set_fitted(self, work):
        """Of a material the numbers that were fitted alone: the rest may be another cause's."""
        for owner, keys in work.wanted.items():
            numbers = [key for key in keys if key.startswith("material.")]
            if not numbers:
                continue
            given, material = work.item(owner), fit_values.find_body(self.settings, owner).material
            if _is_whole(material, given["material"]):
                self._law(given)
                continue
            for key in numbers:
                _set_number(material, key, given["material"])
        work.densities()
        work.motions()
        work.surroundings()
        work.captures()
        work.say_clamped()

    def _body_document(self):
        """Causes of a body are those of the first one."""
        return self.model["bodies"][0]

    def _body(self):
        name = self._body_document()["name"]
        body = fit_values.find_body(self.settings, name)
        if body is None or body.role != "BODY":
            raise JobError(translate(
                "The diagnosis is of '{name}', which is not among the Bodies any more. Name it so "
                "again, or diagnose again.").format(name=name))
        return body

    def _as_fitted(self, owner, key):
        if owner:
            self._body()
        work = self._application()
        work.wanted[owner] = [key]
        work.motions()
        work.surroundings()

    def _contact(self, key):
        """Which surface it is of: the one whose number the extended model has otherwise than the
        fitted scene has, though the fit did not look for it."""
        path = os.path.join(self.folder, fit_results.SCENE_FILE)
        before = {item["name"]: item for item in
                  files.read_json(path)["scene"].get("colliders", [])}
        fitted = {job_fit.split_path(path, self.model)[:2] for path in self.report.fitted}
        found = 0
        for item in self.model.get("colliders", []):
            name, now = item["name"], item.get("contact", {}).get(key)
            if now is None or now == before.get(name, {}).get("contact", {}).get(key):
                continue
            if (name, f"contact.{key}") in fitted:
                continue
            contact = fit_values.contact_of(self.settings, name)
            if contact is None:
                raise JobError(translate(
                    "The diagnosis is of the collider '{name}', which is not in the scene any "
                    "more. Name it so again, or diagnose again.").format(name=name))
            set_contact_kind(contact, item["contact"])
            setattr(contact, key, now)
            if key == "damping":
                contact.use_damping = True
            found += 1
        if not found:
            raise KeyError(key)

    def _law(self, given=None):
        """The law and its parameters as the extended model has them, of one of its bodies."""
        given = given or self._body_document()
        body = fit_values.find_body(self.settings, given["name"])
        values = dict(given["material"])
        material_values.resolve(values, self.folder)
        body.material.preset = "CUSTOM"
        material_values.fill(body.material, values)
        body.formulation = given.get("formulation", body.formulation).upper()

    def _relaxation(self):
        """Branches of the extended model that the body has not are those that were found."""
        branches = self._body().material.maxwell
        given = self._body_document()["material"]["maxwell"]
        before = len(branches)
        while len(branches) < len(given):
            branches.add().name = translate("Found")
        # The last one again where all are there: it may have been found otherwise since.
        for index in range(min(before, len(given) - 1), len(given)):
            branch = branches[index]
            branch.modulus, branch.time = given[index]["modulus"], given[index]["time"]

    def _surroundings(self, effect):
        work = Surroundings(self.scene, self.folder, self.report, self.cause)
        if effect == "camera_roll" or (effect == "scale" and acts_on_body(self.report)):
            self._as_fitted("", "gravity")
            if work.has_slope():
                work.ground_tilt()
        elif effect == "scale":
            work.scale_of_capture()
        else:
            getattr(work, effect)()

    def _mass(self):
        body, given = self._body(), self._body_document()["masses"][-1]
        row = next((row for row in body.masses if row.name == _MASS), None)
        if row is None:
            row = body.masses.add()
            row.name = _MASS
            body.mass_index = len(body.masses) - 1
        if row.object is None:
            row.object = bpy.data.objects.new(f"{body.name} {_MASS}", None)
            self.scene.collection.objects.link(row.object)
        row.object.location = Vector(given["position"]) / self.scale
        row.mass = given["mass"]

    def _effect(self, kind):
        """A scene in which an effect of the kind acts is not examined for another one, so that rows
        that are switched on are these; what is switched off stays as it is."""
        given = [item for item in self.model["effects"] if item["effect"] == kind.name]
        if any(isinstance(item.get(key), dict) for item in given for key in kind.numbers):
            raise _without_place(self.folder, translate_label(self.cause.label))  # keyed, for a while
        if not given:
            raise KeyError(kind.name)
        rows = self.settings.effects
        for place, item in enumerate(given):
            same = [row for row in rows if row.enabled and row.kind == kind.identifier]
            if place < len(same):
                row = same[place]
            else:
                name = names.unique(translate_label(kind.title), rows)
                row = rows.add()
                row.name, row.kind = name, kind.identifier
            row.body, row.place = item.get("body", ""), None
            self.settings.effect_index = next(i for i, other in enumerate(rows) if other == row)
            for key in kind.numbers:
                if key in item:
                    setattr(row, key, self._in_scene(key, item[key]))

    def _in_scene(self, key, value):
        """A number of the document in the scene's unit."""
        scale = self.scale if key in effects.LENGTHS else 1.0
        if key in effects.AREAS:
            scale = self.scale * self.scale
        return [part / scale for part in value] if isinstance(value, list) else value / scale
