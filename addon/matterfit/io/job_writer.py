# SPDX-License-Identifier: GPL-3.0-or-later
"""What the parts of a job document share while it is written."""

import contextlib
import math
import os
import time

from mathutils import Matrix, Vector

from ..compat import translate
from ..jobs import JobError, Snapshot, drained
from . import files, frames, meshes, transforms

INPUT_FOLDER = "input"
INPUT_LIST = "files.json"
SLICE = 0.15  # [s] of sampling between two looks at the window
KEPT_FOLDER = "input_before"  # the inputs that a run replaces, until it has results of its own


def listed_inputs(folder):
    """Our input files in a cache folder by its own list, and the list; paths below the folder."""
    listing = f"{INPUT_FOLDER}/{INPUT_LIST}"
    if not os.path.isfile(os.path.join(folder, listing)):
        return []
    known = files.read_json(os.path.join(folder, listing))
    old = known.get("files", []) if isinstance(known, dict) else []
    inside = os.path.join(folder, INPUT_FOLDER) + os.sep
    return [*(str(relative) for relative in old
              if os.path.normpath(os.path.join(folder, str(relative))).startswith(inside)), listing]


def kept_input(folder, relative):
    """Where the old one of an input file is kept."""
    return os.path.join(folder, KEPT_FOLDER, os.path.basename(relative))


def kept_inputs(folder):
    """The input files that are kept, by the paths that they had."""
    try:
        names = sorted(os.listdir(os.path.join(folder, KEPT_FOLDER)))
    except OSError:
        return []
    return [f"{INPUT_FOLDER}/{name}" for name in names]


def world_matrix(item, depsgraph):
    matrix = Matrix(item.evaluated_get(depsgraph).matrix_world)
    if not all(math.isfinite(value) for row in matrix for value in row):
        raise JobError(translate("object '{name}': its location, rotation or scale is not a number. Look at "
                                 "its keys, drivers and constraints.").format(name=item.name))
    return matrix


class Place:
    """Where an object is at the scene's first frame; filled by JobWriter.walk()."""

    def __init__(self):
        self.matrix = Matrix()
        self._corners = []

    def sample(self, item, depsgraph):
        self.matrix = world_matrix(item, depsgraph)
        if item.type == "EMPTY":
            size = item.empty_display_size
            self._corners = [Vector((x, y, z)) * size
                             for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
        else:
            self._corners = [Vector(corner)
                             for corner in item.evaluated_get(depsgraph).bound_box]

    def box(self, scale):
        """(low, high) of the bounding box in the world [m]; an empty is a box of its size."""
        points = [self.matrix @ corner * scale for corner in self._corners]
        low = Vector([min(point[axis] for point in points) for axis in range(3)])
        high = Vector([max(point[axis] for point in points) for axis in range(3)])
        return low, high


class JobWriter:
    """Collects what has to be sampled, walks the frames once, and writes the input files.

    A part registers `at_first(visitor)` for what is needed once and `at_every(visitor)` for what
    is needed at every frame; both get (frame, depsgraph). Lengths leave here in metres.
    """

    def __init__(self, scene, take, folder):
        self.scene = scene
        self.settings = scene.matterfit
        self.bakes_meshes = self.settings.output.mesh  # what is not written need not be sampled
        self.take = take
        self.folder = folder
        self.scale = transforms.metres(scene)
        self.separation = self.settings.solver.particle_separation * self.scale  # [m]
        self.first, self.end = frames.frame_range(scene)
        fps = frames.frames_per_second(scene)
        self.fps = fps[0] / fps[1] if isinstance(fps, list) else float(fps)
        self.fps_document = fps
        self.written = []
        self._first_visitors = []
        self._visitors = []
        self._timed_visitors = []
        self._shown = []

    # -- sampling ------------------------------------------------------------------------------

    def at_first(self, visitor):
        self._first_visitors.append(visitor)

    def at_every(self, visitor):
        self._visitors.append(visitor)

    def at_times(self, times, visitor):
        """`visitor` at each of `times`, which are frames and parts of frames."""
        self._timed_visitors.append((times, visitor))

    def show(self, item):
        """`item` is evaluated even if it is hidden (a hidden object has no evaluated mesh)."""
        if item not in self._shown:  # a second entry would remember it as shown
            self._shown.append(item)
        return item

    def walk(self):
        """All at once."""
        drained(self.walking())

    def walking(self):
        """In slices: yields Snapshots, and may be left for good at any of them. The playhead is where it
        was in between, unless that would break a simulation of Blender's off."""
        todo = [(self.first, self._first_visitors)]
        if self._visitors:
            todo += [(frame, self._visitors) for frame in self.frames]
        todo += [(at, [visitor]) for times, visitor in self._timed_visitors for at in times]
        done = 0
        running = frames.follow_each_other(self.scene)
        with frames.frame_kept(self.scene) if running else contextlib.nullcontext():
            while done < len(todo):
                with (contextlib.nullcontext() if running else frames.frame_kept(self.scene),
                      meshes.shown(self._shown)):
                    end = time.monotonic() + SLICE
                    while True:
                        frames.visit(self.scene, *todo[done])
                        done += 1
                        if done == len(todo) or time.monotonic() >= end:
                            break
                yield Snapshot(fraction=done / len(todo), stage="Reading the scene",
                               frame=int(todo[done - 1][0]), last_frame=self.end - 1)

    def keyed_matrix(self, item):
        """A list that holds the object's world matrix at every frame after walk()."""
        matrices = []
        self.show(item)
        self.at_every(lambda _frame, depsgraph: matrices.append(world_matrix(item, depsgraph)))
        return matrices

    def timed_matrix(self, item, times):
        """A list that holds the object's world matrix at each of `times` after walk()."""
        matrices = []
        self.show(item)
        self.at_times(times, lambda _time, depsgraph: matrices.append(
            world_matrix(item, depsgraph)))
        return matrices

    def place(self, item):
        """A Place, valid after walk()."""
        place = Place()
        self.show(item)
        self.at_first(lambda _frame, depsgraph: place.sample(item, depsgraph))
        return place

    @property
    def frames(self):
        return range(self.first, self.end)

    # -- files ---------------------------------------------------------------------------------

    def write_npz(self, name, arrays):
        """Writes <folder>/input/<name>.npz; returns the path for the document."""
        relative = f"{INPUT_FOLDER}/{name}.npz"
        files.write_npz(os.path.join(self.folder, INPUT_FOLDER, name + ".npz"), arrays)
        self.written.append(relative)
        return relative

    def put_input(self, name, source):
        """Copies a file to <folder>/input/<name>; returns the path for the document."""
        relative = f"{INPUT_FOLDER}/{name}"
        files.copy(source, os.path.join(self.folder, relative))
        self.written.append(relative)
        return relative

    def external(self, path, what):
        """A file that exists, as a path relative to the document."""
        absolute = files.absolute(path)
        if not path:
            raise JobError(f"{what}: no file is chosen. Choose one, or remove the row.")
        files.require_file(absolute, what)
        return self.relative(absolute)

    def relative(self, absolute):
        try:
            return os.path.relpath(absolute, self.folder).replace(os.sep, "/")
        except ValueError:  # another drive on Windows
            return absolute.replace(os.sep, "/")

    def discard(self):
        """Takes back what was written so far and no list names: Free would take it for a stranger's."""
        # The refusal is reported, not a list that cannot be read.
        with contextlib.suppress(JobError):
            for relative in set(self.written) - set(listed_inputs(self.folder)):
                with contextlib.suppress(OSError):
                    os.remove(os.path.join(self.folder, relative))
        with contextlib.suppress(OSError):
            os.rmdir(os.path.join(self.folder, INPUT_FOLDER))

    def finish_inputs(self):
        """Lists our input files for Free, and removes those of an older run that are not used."""
        listing = os.path.join(self.folder, INPUT_FOLDER, INPUT_LIST)
        for relative in listed_inputs(self.folder):
            path = os.path.join(self.folder, relative)
            if path != listing and relative not in self.written and os.path.isfile(path):
                os.remove(path)
        if self.written or os.path.isfile(listing):
            files.write_json(listing, {"files": sorted(self.written)})
