# SPDX-License-Identifier: GPL-3.0-or-later
"""Bodies of the job document: shape, material, throw, pins, masses, render mesh."""

import numpy
from mathutils import Quaternion, Vector

from .. import laws
from ..jobs import JobError
from . import (
    attached,
    files,
    job_writer,
    material_values,
    meshes,
    refinement,
    shapes,
    splat_files,
    throws,
    transforms,
)
from .files import number, numbers


class BodyPart:
    """One body while the document is written. Source space: the object's rotation and position
    taken off, its scale kept, metres."""

    def __init__(self, writer, body, throw):
        self.writer = writer
        self.body = body
        self.throw = throw
        self.where = f"body '{body.name}'"
        self.arrays = None
        self.shape = None
        self.render = None
        self.refined = False  # `render` is a finer mesh of ours
        self.mirrored = False  # by a negative scale
        self.position = Vector()
        self.rotation = Quaternion()
        self.object_position = Vector()
        self.object_rotation = Quaternion()
        self.pin_points = {}
        self._follow = {}
        self._regions = {}
        self._motion = []
        self._crop = None
        if body.source == "OBJECT":
            self._prepare_object()
        else:
            self.object_rotation = transforms.upright(body.file_up)
        if body.source == "GAUSSIANS" and body.crop is not None:
            self._crop = writer.place(body.crop)
        for index, pin in enumerate(body.pins):
            if pin.follow is not None:
                self._follow[index] = writer.keyed_matrix(pin.follow)
            if pin.kind in {"PLANE", "BOX"} and pin.object is not None:
                self._regions[index] = writer.place(pin.object)
        self._masses = [writer.place(mass.object) if mass.object is not None else None
                        for mass in body.masses]

    # -- sampling ------------------------------------------------------------------------------

    def _prepare_object(self):
        item = self.body.object
        if item is None:
            raise JobError(f"{self.where}: no object is chosen. Choose one in Bodies, or remove "
                           "the row.")
        if item.type not in {"MESH", "CURVE", "SURFACE", "META", "FONT"}:
            raise JobError(f"{self.where}: object '{item.name}' is of type {item.type.lower()}, "
                           "which has no surface. Choose a mesh.")
        attached.refuse(item, self.where)
        self.shape, self.bound = shapes.body_shape(item), shapes.bound_shape(item)
        self.writer.show(item)
        self.writer.at_first(self._sample)
        if throws.velocity_from(self.body, self.throw) == "ANIMATION":
            self._motion = self.writer.timed_matrix(
                item, transforms.velocity_times(self.writer.first))

    def _sample(self, _frame, depsgraph):
        item = self.body.object
        shapes.check(item, depsgraph)
        matrix = job_writer.world_matrix(item, depsgraph)
        scale = self.writer.scale
        self.object_position, self.object_rotation, stretch = transforms.split(matrix, scale)
        self.mirrored = stretch.determinant() < 0.0
        self.arrays = meshes.read_shape(item, self.shape, stretch, scale,
                                        creases=self.shape.kind == "cage")
        meshes.check_faces(item, self.arrays)
        meshes.check_solid(item, self.arrays)
        if self._has_render_mesh():
            self._sample_render_mesh(item, stretch)
        self._sample_pins(item, stretch)

    def _sample_render_mesh(self, item, stretch):
        self.render, self.refined = refinement.read(
            item, stretch, self.writer.separation / self.writer.scale)

    def _sample_pins(self, item, stretch):
        """Rest positions (source space) of the vertices of pinned vertex groups."""
        for index, pin in enumerate(self.body.pins):
            if pin.kind != "VERTEX_GROUP":
                continue
            where = f"{self.where}, pin '{pin.name}'"
            group = item.vertex_groups.get(pin.vertex_group) if item.type == "MESH" else None
            if group is None:
                raise JobError(f"{where}: object '{item.name}' has no vertex group "
                               f"'{pin.vertex_group}'. Choose one of its groups.")
            points = meshes.group_points(item, self.bound, group)
            if not len(points):
                raise JobError(f"{where}: no vertex has a weight of at least .5 in "
                               f"'{pin.vertex_group}'. Paint or assign some.")
            matrix = numpy.array(stretch, dtype=numpy.float64) * self.writer.scale
            points = points @ matrix.T
            self.pin_points[index] = points

    # -- documents -----------------------------------------------------------------------------

    def place(self):
        """Where the source starts: the throw's placement, else where the object is."""
        self.position, self.rotation = self.object_position, self.object_rotation
        if self.throw is not None and self.throw.use_placement:
            self.position, self.rotation = transforms.take_placement(self.throw,
                                                                     self.writer.scale)
            if self.body.source != "OBJECT":
                self.rotation = self.rotation @ self.object_rotation

    def document(self):
        body = self.body
        self.place()
        document = {
            "name": body.name,
            "source": self._source(),
            "density": number(body.density),
            "material": material_values.document(body.material),
            "formulation": body.formulation.lower(),
        }
        velocity, spin = self._velocity()
        document["velocity"] = numbers(velocity)
        document["spin"] = numbers(spin)
        if self.position.length > 0.0 or transforms.quaternion_list(self.rotation) != [1, 0, 0, 0]:
            document["placement"] = transforms.pose(self.position, self.rotation)
        if body.source != "OBJECT" and body.file_scale != 1.0:
            document.setdefault("placement", {})["scale"] = number(body.file_scale)
        if body.pins:
            document["pins"] = [self._pin(index, pin) for index, pin in enumerate(body.pins)]
        if body.masses:
            document["masses"] = [self._mass(mass, place) for mass, place
                                  in zip(body.masses, self._masses, strict=True)]
        if body.seed:
            document["seed"] = body.seed
        seen = material_values.excited(body.material)
        if seen is not None:
            document["excited"] = seen
        return document

    def _source(self):
        body = self.body
        if body.source == "POINTS":
            return {"points": self.writer.external(body.filepath, self.where)}
        if body.source == "GAUSSIANS":
            return {**self._gaussians(), "fill_inside": body.fill_inside,
                    "opacity_threshold": number(body.opacity_threshold)}
        path = self.writer.write_npz("body_" + files.safe_name(body.name), self.arrays)
        if self.shape.kind == "cage":
            return {"cage": path, "level": self.shape.level}
        return {"mesh": path}

    def _gaussians(self):
        """The file and what is kept of it, in its own frame: the crop box stands in the scene, where the
        file lies without a throw's placement."""
        document = {"gaussians": self.writer.external(self.body.filepath, self.where)}
        if self._crop is not None:
            document["crop"] = splat_files.crop(self._crop.box(self.writer.scale), self.body.file_up,
                                                self.body.file_scale, self.body.crop.name, self.where)
        return document

    def splat_output(self):
        """The entry of output.splats, or None."""
        if self.body.source != "GAUSSIANS":
            return None
        document = {"name": files.safe_name(self.body.name), "body": self.body.name, **self._gaussians()}
        if self.body.opacity_threshold > 0.0:
            document["opacity_threshold"] = number(self.body.opacity_threshold)
        if self.writer.settings.output.splat_format == "SPLAT":
            document["format"] = "splat"
        return document

    def _velocity(self):
        body, writer = self.body, self.writer
        thrown = throws.thrown(body, self.throw)
        if thrown.velocity_from == "VALUE":
            return Vector(thrown.velocity) * writer.scale, Vector(thrown.spin)
        if body.source != "OBJECT":
            raise JobError(f"{self.where}: is made from a file and has no animation. Set its "
                           "velocity to Values Below.")
        linear, angular = transforms.motion_velocity(self._motion, writer.scale, writer.fps)
        # The animation moves the object's origin; the job wants the centre of mass.
        arm = self.rotation @ Vector(meshes.center_of_mass(self.arrays))
        return linear + angular.cross(arm), angular

    def _pin(self, index, pin):
        where = f"{self.where}, pin '{pin.name}'"
        document = {"region": self._region(index, pin, where)}
        if index in self._follow:
            document.update(self._pin_motion(self._follow[index]))
        if pin.use_release:
            document["release"] = pin.release
        return document

    def _region(self, index, pin, where):
        scale = self.writer.scale
        if pin.kind == "ALL":
            return {"shape": "all"}
        if pin.kind == "VERTEX_GROUP":
            if index not in self.pin_points:
                raise JobError(f"{where}: bodies made from files have no vertex groups. Use a "
                               "plane or a box.")
            points = transforms.turned(self.rotation, self.pin_points[index])
            points = points + numpy.array(self.position)
            name = f"pin_{files.safe_name(self.body.name)}_{index}"
            path = self.writer.write_npz(name, {"positions": points})
            return {"shape": "points", "file": path, "radius": number(pin.radius * scale)}
        if pin.object is None:
            raise JobError(f"{where}: no object marks the region. Choose an empty.")
        if pin.kind == "PLANE":
            position, rotation, _ = transforms.split(self._regions[index].matrix, scale)
            return {"shape": "plane", "point": numbers(position),
                    "normal": numbers(rotation @ Vector((0.0, 0.0, 1.0)))}
        low, high = self._regions[index].box(scale)
        return {"shape": "box", "low": numbers(low), "high": numbers(high)}

    def _pin_motion(self, matrices):
        """Relative to the first frame, about the followed object's place there."""
        scale = self.writer.scale
        pivot, rotation_0, _ = transforms.split(matrices[0], scale)
        values = []
        for matrix in matrices:
            position, rotation, _ = transforms.split(matrix, scale)
            values.append(transforms.pose(position - pivot, rotation @ rotation_0.conjugated()))
        return {"motion": transforms.keyed(self.writer.frames, values), "pivot": numbers(pivot)}

    def _mass(self, mass, place):
        if place is None:
            raise JobError(f"{self.where}, mass '{mass.name}': no object says where it hangs. "
                           "Choose an empty.")
        document = {"position": numbers(place.matrix.translation * self.writer.scale),
                    "mass": number(mass.mass)}
        if mass.use_attach:
            document["attach"] = mass.attach
        return document

    def _has_render_mesh(self):
        """What pours has left its mesh behind: its surface is the picture."""
        return self.writer.bakes_meshes and not laws.material_flows(self.body.material)

    def mesh_output(self):
        """The entry of output.mesh, or None. PC2 is in Blender units, without the pose."""
        if (not self._has_render_mesh() or self.render is None
                or len(self.render["face_sizes"]) == 0):
            return None
        item = self.body.object
        stop = self.bound.stop
        subdivided = (not self.refined and stop < len(item.modifiers)
                      and shapes.makes_limit_surface(item.modifiers[stop]))
        arrays = dict(self.render)
        if not subdivided:
            del arrays["crease_edges"], arrays["crease_sharpness"]
        if self.mirrored:
            arrays[refinement.MIRRORED] = numpy.array([1], dtype=numpy.int32)
        path = self.writer.write_npz("mesh_" + files.safe_name(self.body.name), arrays)
        entry = {"name": files.safe_name(self.body.name), "body": self.body.name}
        if subdivided:
            entry["cage"] = path
            entry["level"] = shapes.subdivision_level(item.modifiers[stop])
        else:
            entry["mesh"] = path
        placement = transforms.pose(self.position, self.rotation)
        placement["scale"] = number(self.writer.scale)
        entry["transform"] = placement
        return entry
