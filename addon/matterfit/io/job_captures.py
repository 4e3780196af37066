# SPDX-License-Identifier: GPL-3.0-or-later
"""Captures of the job document, and sampling an animated object into one."""

import contextlib
import os
import re

import bpy
import numpy
from mathutils import Euler, Vector

from ..compat import translate
from ..jobs import JobError
from . import attached, files, meshes, shapes, transforms
from .files import number, numbers

UNIT_NAMES = {"M": "m", "CM": "cm", "MM": "mm"}


def numbered_pattern(path):
    """cloud_0012.ply -> cloud_####.ply; the path itself where its name has no number."""
    folder, name = os.path.split(path)
    stem, extension = os.path.splitext(name)
    found = list(re.finditer(r"\d+", stem))
    if not found:
        return path
    last = found[-1]
    stem = stem[:last.start()] + "#" * len(last.group()) + stem[last.end():]
    return os.path.join(folder, stem + extension)


def is_numbered(path):
    """Point clouds come as one file a frame."""
    return os.path.splitext(path)[1].lower() == ".ply"


def refuse_result(item, where):
    """JobError where the object shows a cache of other points at every frame."""
    if not item.get(attached.TAG, "mesh:").startswith("mesh:"):
        raise JobError(f"{where}: object '{item.name}' shows a cache whose points are others "
                       "at every frame, or no mesh. Choose the take's mesh, or the file itself.")


class ObjectTrack:
    """The world positions [m] of an object's vertices at every frame."""

    def __init__(self, writer, item, where):
        self.writer = writer
        self.item = item
        self.where = where
        self.positions = []
        # The result of a take moves by modifiers of ours, which are off for all else.
        self.is_result = attached.TAG in item
        refuse_result(item, self.where)
        writer.show(item)
        writer.at_every(self._visit)

    def _visit(self, frame, _depsgraph):
        with (contextlib.nullcontext() if self.is_result else
              shapes.modifiers_limited(self.item, len(self.item.modifiers))):
            depsgraph = bpy.context.evaluated_depsgraph_get()
            with meshes.evaluated_mesh(self.item, depsgraph) as mesh:
                points = numpy.empty(len(mesh.vertices) * 3, dtype=numpy.float32)
                mesh.vertices.foreach_get("co", points)
            matrix = numpy.array(self.item.evaluated_get(depsgraph).matrix_world,
                                 dtype=numpy.float64)
        points = points.reshape(-1, 3).astype(numpy.float64)
        if self.positions and len(points) != len(self.positions[0]):
            raise JobError(f"{self.where}: object '{self.item.name}' has {len(points)} vertices at "
                           f"frame {frame} and {len(self.positions[0])} at the first. Remove the "
                           "modifier that changes their number.")
        self.positions.append((points @ matrix[:3, :3].T + matrix[:3, 3]) * self.writer.scale)

    def arrays(self):
        """The keys of a capture file."""
        times = numpy.arange(len(self.positions), dtype=numpy.float64) / self.writer.fps
        return {"positions": numpy.stack(self.positions).astype(numpy.float32), "times": times,
                "up": numpy.array("z")}


class CapturePart:
    """One capture while the document is written."""

    def __init__(self, writer, capture):
        self.writer = writer
        self.capture = capture
        self.where = f"capture '{capture.name}'"
        self.track = None
        if capture.source == "OBJECT":
            if capture.object is None:
                raise JobError(f"{self.where}: no object is chosen. Choose an animated object.")
            self.track = ObjectTrack(writer, capture.object, self.where)
        self.places = {}
        if capture.align is not None:
            self.places = {item.name: writer.place(item)
                           for item in sorted(capture.align.objects, key=lambda item: item.name)}

    def document(self):
        capture, writer = self.capture, self.writer
        document = {"name": capture.name}
        if self.track is not None:
            name = "capture_" + files.safe_name(capture.name)
            document["tracks"] = writer.write_npz(name, self.track.arrays())
        else:
            path = writer.external(capture.filepath, self.where)
            document["tracks"] = {"pattern": numbered_pattern(path)} if is_numbered(path) else path
            document.update(reading_options(capture))
        document["body"] = capture.body or first_body(writer.settings)
        if capture.align is not None:
            document["align"] = self._align()
        else:
            transform = placement(capture, writer.scale)
            if transform is not None:
                document["transform"] = transform
        if capture.use_release:
            document["release"] = capture.release
        if capture.use_start_frame:
            document["start_frame"] = number(capture.start_frame)
        if capture.use_noise:
            document["noise"] = number(capture.noise * writer.scale)
        holdout = self._holdout()
        if holdout:
            document["holdout"] = holdout
        return document

    def _holdout(self):
        capture = self.capture
        if capture.holdout == "CAPTURE":
            return {"capture": True}
        found = held_out_frames(capture, self.writer, self.where)
        if capture.holds_out_tracks:
            found["tracks"] = point_names(capture.holdout_tracks)
            if not found["tracks"]:
                raise JobError(f"{self.where}: no point is named to be held out. Name some, "
                               "separated by commas, or choose another Hold-out.")
        return found

    def _align(self):
        """The rigid transform from the markers' quiet places to the empties of the same names."""
        capture, writer = self.capture, self.writer
        if len(self.places) < 3:
            raise JobError(f"{self.where}: the collection '{capture.align.name}' holds "
                           f"{len(self.places)} objects; aligning needs at least three, named like "
                           "markers.")
        end = capture.release if capture.use_release else writer.first + 1
        return {"markers": list(self.places),
                "positions": [numbers(place.matrix.translation * writer.scale)
                              for place in self.places.values()],
                "frames": [writer.first, max(end, writer.first + 1)]}


def reading_options(capture):
    """What the reader of a file is told: unit, up axis, rate, markers."""
    document = {}
    if capture.unit == "CUSTOM":
        document["unit"] = number(capture.scale)
    elif capture.unit != "AUTO":
        document["unit"] = UNIT_NAMES[capture.unit]
    if capture.up != "AUTO":
        document["up"] = capture.up.lower()
    if capture.use_fps:
        document["fps"] = number(capture.fps)
    markers = point_names(capture.markers)
    if markers:
        document["markers"] = markers
    return document


def held_out_frames(capture, writer, where):
    """From the frame that is typed to the last one, where frames are held out; JobError where that is none."""
    if not capture.holds_out_frames:
        return {}
    if capture.holdout_start >= writer.end:
        raise JobError(translate(
            "{where}: the hold-out starts at frame {n}, after the last frame {last}. Set From, below "
            "Hold-out, to an earlier frame, or let the frame range reach further.").format(
                where=where, n=capture.holdout_start, last=writer.end - 1))
    return {"frames": [capture.holdout_start, writer.end]}


def point_names(text):
    """Names and indices of points from a text with commas."""
    names = [name.strip() for name in text.split(",") if name.strip()]
    return [int(name) if name.isdecimal() else name for name in names]


def placement(capture, scale):
    """{position, rotation}, or None where the capture stays where it is."""
    position, rotation = Vector(capture.location), Euler(capture.rotation)
    if position.length == 0.0 and not any(rotation):
        return None
    return {"position": numbers(position * scale),
            "rotation": transforms.quaternion_list(rotation.to_quaternion())}


def first_body(settings):
    for body in settings.bodies:
        if body.role == "BODY" and body.enabled:
            return body.name
    return ""
