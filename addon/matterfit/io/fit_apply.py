# SPDX-License-Identifier: GPL-3.0-or-later
"""Puts what a fit has found into the scene: Bodies, the take's throw, Solver, colliders, Capture.

The result names what was looked for; the values are those of scene.json, the fitted scene.
"""

import os

from mathutils import Matrix, Quaternion, Vector

from .. import quantities
from ..compat import translate, translate_label
from ..jobs import JobError
from . import (
    blender_cameras,
    camera_poses,
    files,
    fit_results,
    fit_values,
    job_fit,
    material_values,
    number_text,
    presets,
    resolution,
    transforms,
)


def apply_run(scene, folder, run=None, given=()):
    """Sets the scene's values to those of the fit in `folder`, `run` its take where that is not the
    Fit panel's. Returns what could not be set, a sentence each; JobError where nothing is set.
    `given`: paths of what was not fitted but had a value of its own there."""
    settings = scene.matterfit
    run = settings.fit.run if run is None else run
    # The take that was fitted gets what it throws; it was named after it.
    take = settings.takes.get(run.name)
    if take is None:
        raise JobError(translate(
            "The fit is of the take '{name}', which is not among the Takes any more. Name it so "
            "again, or fit again.").format(name=run.name))
    result = fit_results.load(folder)
    left = apply(scene, result, folder, run, take, given)
    return [result.warning, *left] if result.warning else left


def apply(scene, result, folder, fitted_take, take, given=()):
    """The same for a result. `fitted_take` is what the fit threw (a copy of a take's settings),
    `take` the take that gets fitted throws."""
    found = files.read_json(os.path.join(folder, fit_results.SCENE_FILE))
    document = {**found.get("scene", {}), "captures": found.get("captures", [])}
    work = Application(scene, document, fitted_take, take)
    for estimate in (*result.estimates, *(fit_results.Estimate(path) for path in given)):
        work.note(estimate)
    if not (work.wanted or work.starts or work.posed):
        raise JobError(translate("The fit found no value that could be applied. Fit again."))
    work.check()
    with resolution.kept(scene):
        work.materials(folder)
        work.densities()
    work.motions()
    work.surroundings()
    work.captures()
    work.say_clamped()
    return work.left


def _saved(folder, body):
    """What the material's own file says of it; empty where that cannot be read."""
    try:
        return fit_results.material(folder, body)
    except JobError:
        return {}


def _is_surface(key):
    """Whether it is of the ground or of a collider."""
    return key == "height" or key.startswith("contact.")


class Application:
    """What of `document`, a scene, is put where: `wanted` says it by owners and keys."""

    def __init__(self, scene, document, fitted_take, take):
        self.settings = scene.matterfit
        self.document = document
        self.scale = transforms.metres(scene)
        self.fitted_take = fitted_take
        self.take = take
        self.wanted = {}  # owner: keys, in the order of the result
        self.starts = {}  # capture: the scene frame of its first sample
        self.posed = {}  # capture: its cameras' poses, as the document has them
        self.left = []

    def note(self, estimate):
        owner, key, _axis = job_fit.split_path(estimate.path, self.document)
        if key == "start_frame":
            self.starts[owner] = estimate.value
            return
        if quantities.camera_of(key) is not None:
            self.posed[owner] = (self.item(owner, "captures") or {}).get("poses", [])
            return
        keys = self.wanted.setdefault(owner, [])
        if key not in keys:
            keys.append(key)

    def check(self):
        """Before anything is changed: everything that was fitted must still be here."""
        for name in (*self.starts, *self.posed):
            if fit_values.find_capture(self.settings, name) is None:
                raise JobError(translate(
                    "The fit is to '{name}', which is not among the Captures any more. Name it so "
                    "again, or fit again.").format(name=name))
        for owner, keys in self.wanted.items():
            for key in keys if owner else ():
                self._check_owner(owner, key)

    def _check_owner(self, owner, key):
        if _is_surface(key):
            if fit_values.contact_of(self.settings, owner) is None:
                raise JobError(translate(
                    "The fit is of '{name}', which is not among the colliders any more. Name it so "
                    "again, or fit again.").format(name=owner))
        else:
            body = fit_values.find_body(self.settings, owner)
            if body is None or body.role != "BODY":
                raise JobError(translate(
                    "The fit is of '{name}', which is not among the Bodies any more. Name it so "
                    "again, or fit again.").format(name=owner))
        if self.item(owner, "colliders" if _is_surface(key) else "bodies") is None:
            raise JobError(translate("scene.json holds nothing of '{name}'. Fit again.")
                           .format(name=owner))

    def item(self, owner, listed="bodies"):
        return next((item for item in self.document.get(listed, [])
                     if item.get("name") == owner), None)

    def materials(self, folder):
        for owner, keys in self.wanted.items():
            if not any(key.startswith("material.") for key in keys):
                continue
            body = fit_values.find_body(self.settings, owner)
            found = _saved(folder, owner)
            values = dict(self.item(owner)["material"])
            material_values.resolve(values, folder)
            values = material_values.with_weights_kept(values, folder)
            body.material.preset = "CUSTOM"
            material_values.fill(body.material, values, presets.like_of(found),
                                 self.item(owner).get("excited"))
            body.material.source = found.get("source") or translate("Fitted")

    def densities(self):
        for owner, keys in self.wanted.items():
            if "density" in keys:
                body = fit_values.find_body(self.settings, owner)
                body.density = self.item(owner)["density"]

    def motions(self):
        for owner, keys in self.wanted.items():
            item = self.item(owner)
            if "velocity" in keys or "spin" in keys:
                self._velocity(owner, item)
            if any(key.startswith("placement.") for key in keys):
                self._placement(owner, item)

    def _throw(self, owner):
        """(throw that the fit ran with, that of the take that gets its values)."""
        def find(take):
            return next((throw for throw in take.throws if throw.name == owner), None)
        return find(self.fitted_take), find(self.take) if self.take is not None else None

    def _velocity(self, owner, item):
        target = fit_values.find_body(self.settings, owner)
        fitted, throw = self._throw(owner)
        if fitted is not None and fitted.velocity_from != "BODY" and throw is not None:
            throw.velocity_from = "VALUE"
            target = throw
        if target == fit_values.find_body(self.settings, owner):
            target.velocity_from = "VALUE"
        target.velocity = Vector(item.get("velocity", (0, 0, 0))) / self.scale
        target.spin = item.get("spin", (0, 0, 0))

    def _placement(self, owner, item):
        body = fit_values.find_body(self.settings, owner)
        fitted, throw = self._throw(owner)
        placement = item.get("placement", {})
        position = Vector(placement.get("position", (0, 0, 0))) / self.scale
        rotation = Quaternion(placement.get("rotation", (1, 0, 0, 0)))
        if fitted is not None and fitted.use_placement and throw is not None:
            if body.source != "OBJECT":
                # The document turns a file's own axes to Blender's beneath the throw.
                rotation = rotation @ transforms.upright(body.file_up).conjugated()
            throw.location, throw.rotation = position, rotation.to_euler()
            return
        if body.source != "OBJECT" or body.object is None:
            self.left.append(translate(
                "'{name}' is made from a file and has no object to move: its fitted placement is in "
                "scene.json").format(name=owner))
            return
        # The stretch (scale, shear) belongs to the shape and stays.
        stretch = transforms.split(body.object.matrix_world, self.scale)[2]
        body.object.matrix_world = (Matrix.Translation(position)
                                    @ (rotation.to_matrix() @ stretch).to_4x4())
        if body.object.animation_data is not None:
            self.left.append(translate(
                "'{name}' is animated, so its keys move it back: remove them, or give the take a "
                "throw with its fitted placement").format(name=owner))

    def surroundings(self):
        solver = self.settings.solver
        if "gravity" in self.wanted.get("", ()):
            own = self.fitted_take.use_gravity and self.take is not None
            (self.take if own else solver).gravity = self.document["gravity"]
        for owner, keys in self.wanted.items():
            if not any(_is_surface(key) for key in keys):
                continue
            item = self.item(owner, "colliders")
            contact = fit_values.contact_of(self.settings, owner)
            if "contact.mu" in keys:
                contact.mu = item["contact"]["mu"]
            if "contact.stiffness" in keys:
                contact.use_stiffness = True
                contact.stiffness = item["contact"]["stiffness"]
            if "height" in keys:
                solver.ground_height = item["height"] / self.scale

    def say_clamped(self):
        """What fields could not hold: they end at their bounds."""
        for owner, keys in self.wanted.items():
            for key in keys:
                row = quantities.find(key)
                if row is None or row.size > 1:
                    continue
                found = self._number(owner, key)
                if found is not None and not row.takes(found):
                    self.left.append(translate(
                        "'{name}': {label} is {found} in the fit; its field takes from {least} to {most}").format(
                            name=owner, label=translate_label(row.title), found=number_text.short(found, 6),
                            least=number_text.short(row.least, 6), most=number_text.short(row.most, 6)))

    def _number(self, owner, key):
        """What the fit's scene has of a quantity that is one number; None where it has none."""
        branch = quantities.branch_of(key)
        part = self.item(owner, "colliders" if _is_surface(key) else "bodies")
        if branch is not None:
            branches = (part or {}).get("material", {}).get("maxwell", [])
            part, key = (branches[branch[0]] if branch[0] < len(branches) else {}), branch[1]
        for step in key.split("."):
            part = part.get(step) if isinstance(part, dict) else None
        return part

    def captures(self):
        for name, frame in self.starts.items():
            capture = fit_values.find_capture(self.settings, name)
            capture.use_start_frame = True
            capture.start_frame = frame
        for name, poses in self.posed.items():
            capture = fit_values.find_capture(self.settings, name)
            capture.poses = camera_poses.text_of(poses)
            blender_cameras.place(capture)
