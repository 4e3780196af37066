# SPDX-License-Identifier: GPL-3.0-or-later
"""Causes of a diagnosis that are things in the scene, or the camera's: colliders that were not listed,
a ground that slopes, a recording's first frame, rate and lengths."""

import bpy
import numpy
from mathutils import Matrix, Quaternion, Vector

from ..compat import translate, translate_label
from ..jobs import JobError
from ..names import unique
from . import comparison, fit_values, transforms
from .job_captures import UNIT_NAMES

HIDDEN = "hidden collider"  # as the extended model calls it
_FOUND = "Found Collider"
_SLOPE = "Sloping Ground"
_METRES = dict(zip(UNIT_NAMES.values(), (1.0, 1e-2, 1e-3), strict=True))
OF_CAPTURE = ("time_offset", "frame_rate", "scale")  # what a capture has a setting for


def acts_on_body(report):
    """Whether lengths of a recording that are wrong are seen in gravity: points of a body that is thrown
    are tied to it where the first frame shows them."""
    return not any(body.get("pins") for body in (report.model or {}).get("bodies", ()))


class Surroundings:
    """`model`: the extended scene; `report`: the diagnosis of the fit in `folder`."""

    def __init__(self, scene, folder, report, cause):
        self.scene, self.settings, self.folder = scene, scene.matterfit, folder
        self.report, self.model, self.cause = report, report.model, cause
        self.scale = transforms.metres(scene)

    def hidden_collider(self):
        found = [item for item in self.model["colliders"] if item["name"] == HIDDEN]
        given = found[-1]
        body = self._collider(_FOUND)
        if given["shape"] == "sphere":
            self._set_sphere(body, given["radius"] / self.scale)
            place = Matrix.Translation(Vector(given["transform"]["position"]) / self.scale)
        else:
            place = self._plane(body, given)
        body.object.matrix_world = place
        _set_contact(body.contact, given["contact"])

    def ground_tilt(self):
        """The panel's ground is level: a plane takes its place."""
        given = self._slopes()[0]
        ground = self.settings.solver.ground
        body = self._collider(_SLOPE)
        body.object.matrix_world = self._plane(body, given)
        for key in ("kind", "mu", "use_stiffness", "stiffness", "use_damping", "damping"):
            setattr(body.contact, key, getattr(ground, key))
        _set_contact(body.contact, given.get("contact", {}))
        self.settings.solver.use_ground = False

    def _slopes(self):
        return [item for item in self.model.get("colliders", ())
                if item["name"] == fit_values.GROUND and item.get("shape") == "plane"]

    def has_slope(self):
        return bool(self._slopes())

    def _collider(self, label):
        """The row of that name, made where there is none, with an object to place."""
        name = translate_label(label)
        fitted = {item["name"] for item in self.model.get("colliders", ())}  # is in the scene that was diagnosed
        body = next((row for row in self.settings.bodies if row.role == "COLLIDER"
                     and row.name.startswith(name) and row.name not in fitted), None)
        if body is None:
            name = unique(name, self.settings.bodies)
            body = self.settings.bodies.add()
            body.name, body.role = name, "COLLIDER"
            self.settings.body_index = len(self.settings.bodies) - 1
        body.enabled = True
        return body

    def _object(self, body, data=None):
        """The row's object, where it has what it should show; else a new one."""
        if body.object is None or (body.object.data is None) != (data is None):
            if data is None:
                item = bpy.data.objects.new(body.name, None)
                item.empty_display_type, item.empty_display_size = "SINGLE_ARROW", 0.2 / self.scale
            else:
                item = bpy.data.objects.new(body.name, data)
                item.display_type = "WIRE"
            self.scene.collection.objects.link(item)
            body.object = item
        elif data is not None:
            body.object.data = data
        return body.object

    def _plane(self, body, given):
        self._object(body)
        body.collider_shape = "PLANE"
        turn = Vector((0.0, 0.0, 1.0)).rotation_difference(Vector(given["normal"]))
        return Matrix.Translation(Vector(given["point"]) / self.scale) @ turn.to_matrix().to_4x4()

    def _set_sphere(self, body, radius):
        import bmesh
        mesh, shape = bpy.data.meshes.new(body.name), bmesh.new()
        try:
            bmesh.ops.create_uvsphere(shape, u_segments=32, v_segments=16, radius=radius)
            shape.to_mesh(mesh)
        finally:
            shape.free()
        self._object(body, mesh)
        body.collider_shape = "SPHERE"

    def captures(self):
        """[(capture, its entry in the extended document)] of those that the cause is of."""
        name = self.cause.scope.removeprefix("capture ") if self.cause.scope.startswith("capture ") else ""
        entries = [entry for entry in self.report.captures if name in ("", entry.get("name"))]
        found = []
        for entry in entries:
            capture = fit_values.find_capture(self.settings, entry["name"])
            if capture is None:
                raise JobError(translate(
                    "The diagnosis is of the capture '{name}', which is not in the scene any more. Name it so "
                    "again, or diagnose again.").format(name=entry["name"]))
            found.append((capture, entry))
        if not found:
            raise KeyError("model_captures")
        return found

    def time_offset(self):
        for capture, entry in self.captures():
            capture.use_start_frame = True
            capture.start_frame = entry["start_frame"]

    def frame_rate(self):
        """Times of the recording are the stated ones times 1 + the factor."""
        factor = next((number.value for number in self.cause.numbers if number.name == "factor"), None)
        if factor is None:
            raise KeyError("factor")
        rates = [self._rate(capture) for capture, _entry in self.captures()]
        for (capture, _entry), rate in zip(self.captures(), rates, strict=True):
            capture.use_fps = True
            capture.fps = rate / (1.0 + factor)

    def _rate(self, capture):
        """What the fit took its samples to be apart, whatever has been set since."""
        compared = comparison.load(self.folder, capture.name)
        apart = numpy.diff(compared.frames)
        fps = self.model["fps"]
        return float((fps[0] / fps[1] if isinstance(fps, list) else fps) / apart.mean())

    def scale_of_capture(self):
        """The extended document lays a scaling over the capture's placement."""
        rows = []
        for capture, entry in self.captures():
            if "unit" not in entry:
                raise JobError(translate(
                    "'{name}': Unit is Automatic, so there is no number that could be scaled. Choose the unit "
                    "of its file in Capture, and diagnose again.").format(name=capture.name))
            matrix = numpy.array(entry["transform"], dtype=float)
            rows.append((capture, matrix, _METRES.get(entry["unit"], entry["unit"])))
        for capture, matrix, metres in rows:
            share = float(numpy.cbrt(numpy.linalg.det(matrix[:3, :3])))
            capture.unit, capture.scale = "CUSTOM", metres * share
            capture.location = Vector(matrix[:3, 3]) / self.scale
            turn = Matrix((matrix[:3, :3] / share).tolist()).to_quaternion()
            capture.rotation = Quaternion(turn).to_euler()


def set_contact_kind(contact, given):
    """That of a document's contact; one that it does not say stays."""
    kind = given.get("kind", contact.kind).upper()
    contact.kind = {"STICKY": "GLUE"}.get(kind, kind)  # its former name


def _set_contact(contact, given):
    set_contact_kind(contact, given)
    for key in ("mu", "stiffness", "damping"):
        if key in given:
            setattr(contact, key, given[key])
    contact.use_stiffness = contact.use_stiffness or "stiffness" in given
    contact.use_damping = contact.use_damping or "damping" in given
