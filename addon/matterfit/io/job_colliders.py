# SPDX-License-Identifier: GPL-3.0-or-later
"""Colliders, ground and walls of the job document."""

import bpy
import numpy
from mathutils import Vector

from ..jobs import JobError
from . import attached, files, job_writer, meshes, motion, transforms
from .files import number, numbers


def contact_document(contact):
    document = {"kind": contact.kind.lower()}
    if contact.kind == "FRICTION":
        document["mu"] = number(contact.mu)
    if contact.use_stiffness:
        document["stiffness"] = number(contact.stiffness)
    if contact.use_damping:
        document["damping"] = number(contact.damping)
    return document


def pair_documents(settings):
    """Contacts between bodies that the artist has set, of those that take part."""
    known = {body.name: body.enabled for body in settings.bodies if body.role == "BODY"}
    found, seen = [], set()
    for pair in settings.pairs:
        names = (pair.first, pair.second)
        for name in names:
            if name not in known:
                raise JobError(f"Contact between Bodies: '{name}' is not among the Bodies. Choose "
                               "another one, or remove the pair.")
        if names[0] == names[1] or frozenset(names) in seen:
            raise JobError(f"Contact between Bodies: the pair of '{names[0]}' and '{names[1]}' is no "
                           "pair, or listed twice. Remove it.")
        seen.add(frozenset(names))
        if all(known[name] for name in names):
            found.append({"bodies": list(names), **contact_document(pair.contact)})
    return found


def ground_document(solver, scale):
    return {"name": "ground", "shape": "ground", "height": number(solver.ground_height * scale),
            "contact": contact_document(solver.ground)}


def walls_document(solver, scale):
    if solver.container is None:
        raise JobError("Solver, Container: no object is chosen. Choose one whose box is the "
                       "container, or switch Container off.")
    writer = job_writer.JobWriter(solver.id_data, None, "")
    place = writer.place(solver.container)
    writer.walk()
    low, high = place.box(scale)
    document = {"low": numbers(low), "high": numbers(high),
                "contact": contact_document(solver.walls)}
    if solver.open_top:
        document["high"][2] = None
    return document


class ColliderPart:
    """One collider while the document is written."""

    def __init__(self, writer, body):
        self.writer = writer
        self.body = body
        self.where = f"collider '{body.name}'"
        item = body.object
        if item is None:
            raise JobError(f"{self.where}: no object is chosen. Choose one in Bodies, or remove "
                           "the row.")
        if item.type == "EMPTY" and body.collider_shape != "PLANE":
            raise JobError(f"{self.where}: object '{item.name}' is an empty and has no surface. "
                           "Choose a mesh, or the shape Plane.")
        attached.refuse(item, self.where)
        self.kind = motion.collider_kind(body)
        self.arrays = None
        self.matrices = []
        self.mesh_files = []
        writer.show(item)
        if self.kind == "DEFORMING":
            writer.at_every(self._sample_deforming)
            return
        writer.at_first(self._sample_static)
        if self.kind == "RIGID":
            self.matrices = writer.keyed_matrix(item)

    def _read(self, stretch):
        with meshes.evaluated_mesh(self.body.object, bpy.context.evaluated_depsgraph_get()) as mesh:
            arrays = meshes.read_arrays(mesh, stretch, self.writer.scale)
        meshes.check_faces(self.body.object, arrays)
        return arrays

    def _sample_static(self, _frame, depsgraph):
        item = self.body.object
        matrix = job_writer.world_matrix(item, depsgraph)
        if self.kind == "STATIC":
            self.matrices = [matrix]
        if item.type != "EMPTY":
            self.stretch = transforms.split(matrix, self.writer.scale)[2]
            self.arrays = self._read(self.stretch)

    def _sample_deforming(self, frame, depsgraph):
        matrix = job_writer.world_matrix(self.body.object, depsgraph)
        arrays = self._read(matrix.to_3x3())
        shift = numpy.array(matrix.translation, dtype=numpy.float64) * self.writer.scale
        arrays["vertices"] = (arrays["vertices"] + shift).astype(numpy.float32)
        name = f"collider_{files.safe_name(self.body.name)}_{frame:04d}"
        self.mesh_files.append(self.writer.write_npz(name, arrays))

    def document(self):
        body = self.body
        document = {"name": body.name}
        if self.kind == "DEFORMING":
            document["meshes"] = self.mesh_files
            document["first_frame"] = self.writer.first
        else:
            document.update(getattr(self, "_" + body.collider_shape.lower())())
        document["contact"] = contact_document(body.contact)
        return document

    def _transform(self, offset=None, turn=None):
        """The pose (keyed where it moves) of a point `offset` [m] of the shape's own space."""
        scale = self.writer.scale
        values = []
        for matrix in self.matrices:
            position, rotation, stretch = transforms.split(matrix, scale)
            if self.arrays is not None:
                change = max(abs(stretch[i][j] - self.stretch[i][j])
                             for i in range(3) for j in range(3))
                if change > 1e-4 * max(abs(value) for row in self.stretch for value in row):
                    raise JobError(f"{self.where}: its scale is animated, so it is not rigid. "
                                   "Set Motion to Deforming.")
            if offset is not None:
                position = position + rotation @ offset
            values.append(transforms.pose(position,
                                          rotation if turn is None else rotation @ turn))
        return transforms.keyed(self.writer.frames, values)

    def _box_of(self):
        low = self.arrays["vertices"].min(axis=0).astype(float)
        high = self.arrays["vertices"].max(axis=0).astype(float)
        return Vector((low + high) / 2.0), (high - low) / 2.0

    def _mesh(self):
        path = self.writer.write_npz("collider_" + files.safe_name(self.body.name), self.arrays)
        return {"mesh": path, "transform": self._transform()}

    def _plane(self):
        return {"shape": "plane", "point": [0, 0, 0], "normal": [0, 0, 1],
                "transform": self._transform()}

    def _sphere(self):
        middle, half = self._box_of()
        return {"shape": "sphere", "radius": number(max(half)),
                "transform": self._transform(middle)}

    def _box(self):
        middle, half = self._box_of()
        if min(half) <= 0.0:
            raise JobError(f"{self.where}: its bounding box is flat. Choose the shape Plane.")
        return {"shape": "box", "half_extents": numbers(half),
                "transform": self._transform(middle)}

    def _capsule(self):
        middle, half = self._box_of()
        long_axis = int(numpy.argmax(half))
        radius = max(value for axis, value in enumerate(half) if axis != long_axis)
        axis = Vector([1.0 if index == long_axis else 0.0 for index in range(3)])
        turn = Vector((0.0, 0.0, 1.0)).rotation_difference(axis)
        return {"shape": "capsule", "radius": number(radius),
                "half_length": number(max(half[long_axis] - radius, 0.0)),
                "transform": self._transform(middle, turn)}
