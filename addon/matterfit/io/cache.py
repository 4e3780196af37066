# SPDX-License-Identifier: GPL-3.0-or-later
"""What lies in a take's cache folder."""

import contextlib
import os
import re
import struct
from dataclasses import dataclass, field

import bpy

from ..jobs import EXIT_COMPUTE, JobError
from . import files, job_writer

LOCK_FILE = ".lock"
FIT_TASKS = ("fit", "diagnose")  # of a job in a fit's cache
# Files that a fit, and the diagnosis of it, leave whether or not they came to their end.
FIT_FILES = ("fit/checkpoint.json", "fit/fitted.json", "fit/history.jsonl", "material.json",
             "scene.json", "result.json", "report.json", "diagnosis.json", "diagnosis.html",
             "extended.json")
PC2_HEADER = struct.Struct("<12siiffi")
# Files of a batch's folder that lie beside its members' caches.
BATCH_FILES = re.compile(r"^(wedge\.json|slurm\.sh|slurm_\d+\.log|flamenco\.json"
                         r"|matterfit_wedge\.js)$")
FRAME_FILE = re.compile(r"^(?P<name>.+)_(?P<frame>\d{4,})\.(?P<kind>vdb|ply|exr)$")


def name_of(take):
    """The name of the take's cache folder, "" where it has none; a batch's members lie in the
    batch's: "cache_matterfit_…/velocity.2=-1"."""
    return take.folder.strip("/\\").replace("\\", "/")


def in_batch(take):
    """Whether the take shows a member of a batch."""
    return "/" in name_of(take)


def every_take():
    """(scene, take) of every take, preview, fit and batch in this file: all that have a cache."""
    for scene in bpy.data.scenes:
        settings = scene.matterfit
        for take in (*settings.takes, settings.preview, settings.fit.run,
                     settings.batch.run, settings.batch.fits):
            yield scene, take


def is_shared(take):
    """Whether another take of this file has the same folder: Blender copied its scene."""
    name = name_of(take)
    return bool(name) and any(
        other != take and name_of(other) == name for _scene, other in every_take())


@dataclass
class Sequence:
    """Files of one name, a frame each."""

    folder: str
    name: str
    kind: str
    frames: list = field(default_factory=list)

    def path(self, frame):
        return os.path.join(self.folder, f"{self.name}_{frame:04d}.{self.kind}")

    @property
    def first(self):
        return self.frames[0]

    @property
    def last(self):
        """Last frame of the unbroken run from the first."""
        last = self.frames[0]
        for frame in self.frames[1:]:
            if frame != last + 1:
                break
            last = frame
        return last


@dataclass(frozen=True)
class PointCache:
    """A PC2 file's header."""

    path: str
    points: int
    samples: int


def sequences(folder, sub):
    """{name: Sequence} of the frame files in <folder>/<sub>."""
    base = os.path.join(folder, sub)
    found = {}
    try:
        names = os.listdir(base)
    except OSError:
        return found
    for file_name in names:
        match = FRAME_FILE.match(file_name)
        if match:
            name = match.group("name")
            sequence = found.setdefault(name, Sequence(base, name, match.group("kind")))
            sequence.frames.append(int(match.group("frame")))
    for sequence in found.values():
        sequence.frames.sort()
    return dict(sorted(found.items()))


def read_pc2(path):
    """The header, checked against the file's size; Blender itself says nothing about either."""
    try:
        size = os.path.getsize(path)
        with open(path, "rb") as stream:
            header = stream.read(PC2_HEADER.size)
    except OSError as error:
        raise JobError(f"{path}: could not be read: {error.strerror or error}") from error
    if len(header) < PC2_HEADER.size:
        raise JobError(f"{path}: has {len(header)} bytes, a PC2 header has {PC2_HEADER.size}. "
                       "It is truncated: bake again.")
    magic, version, points, _start, _rate, samples = PC2_HEADER.unpack(header)
    if magic != b"POINTCACHE2\0" or version != 1:
        raise JobError(f"{path}: is not a PC2 file (it begins with {magic!r}).")
    expected = PC2_HEADER.size + 12 * points * samples
    if points < 0 or samples < 0 or size != expected:
        raise JobError(f"{path}: has {size} bytes; {points} points at {samples} frames take "
                       f"{expected}. It is truncated: bake again.")
    return PointCache(path, points, samples)


def point_caches(folder, sub):
    """{name: PointCache} of the finished PC2 files in <folder>/<sub>."""
    base = os.path.join(folder, sub)
    try:
        names = sorted(os.listdir(base))
    except OSError:
        return {}
    return {name[:-4]: read_pc2(os.path.join(base, name))
            for name in names if name.endswith(".pc2")}


def exr_size(path):
    """(width, height) from an EXR file's header: Blender gives no size of an image sequence."""
    with open(path, "rb") as stream:
        head = stream.read(65536)
    place = head.find(b"dataWindow\0box2i\0")
    if head[:4] != b"v/1\x01" or place < 0 or len(head) < place + 37:
        raise JobError(f"{path}: is not an OpenEXR file. Bake again.")
    low_x, low_y, high_x, high_y = struct.unpack_from("<4i", head, place + 21)
    return high_x - low_x + 1, high_y - low_y + 1


def partial_points(folder, sub):
    """{name: PointCache} of PC2 files that are still being written."""
    base = os.path.join(folder, sub)
    found = {}
    try:
        names = sorted(os.listdir(base))
    except OSError:
        return found
    for name in names:
        if not name.endswith(".pc2.partial"):
            continue
        path = os.path.join(base, name)
        with open(path, "rb") as stream:
            header = stream.read(PC2_HEADER.size)
        if len(header) == PC2_HEADER.size:
            points = PC2_HEADER.unpack(header)[2]
            if points > 0:
                samples = (os.path.getsize(path) - PC2_HEADER.size) // (12 * points)
                found[name[:-len(".pc2.partial")]] = PointCache(path, points, samples)
    return found


def read_pc2_frame(cache, sample):
    """(points, 3) float32 of one sample."""
    import numpy
    with open(cache.path, "rb") as stream:
        stream.seek(PC2_HEADER.size + 12 * cache.points * sample)
        return numpy.fromfile(stream, dtype="<f4", count=3 * cache.points).reshape(-1, 3)


def size_of(folder):
    """(bytes, files) below the folder."""
    total, count = 0, 0
    for base, _folders, names in os.walk(folder):
        for name in names:
            try:
                total += os.path.getsize(os.path.join(base, name))
                count += 1
            except OSError:
                pass
    return total, count


def manifest(folder):
    """The manifest's document, or {} where none was written yet."""
    path = os.path.join(folder, "manifest.json")
    if not os.path.isfile(path):
        return {}
    document = files.read_json(path)
    if not isinstance(document, dict) or not isinstance(document.get("files", {}), dict):
        raise JobError(f"{path}: is damaged: 'files' is not an object. Bake again.")
    return document


def listed_files(folder):
    """Paths below the folder that are ours: by the manifest, the input list, and fixed names."""
    names = set(manifest(folder).get("files", {}))
    names.update(job_writer.listed_inputs(folder))
    names.update(f"{job_writer.KEPT_FOLDER}/{os.path.basename(name)}"
                 for name in job_writer.kept_inputs(folder))
    names.update(_unfinished(folder, names))
    names.update(name for name in ("job.json", "manifest.json", LOCK_FILE)
                 if os.path.isfile(os.path.join(folder, name)))
    if os.path.isfile(os.path.join(folder, "wedge.json")):
        names.update(name for name in os.listdir(folder) if BATCH_FILES.match(name))
    return sorted(name for name in names if _inside(folder, name))


def _unfinished(folder, listed):
    """What a cancelled or killed bake or fit leaves of files it would have listed."""
    found = {name + ".tmp" for name in listed}
    path = os.path.join(folder, "job.json")
    if os.path.isfile(path):
        document = files.read_json(path)
        if document.get("task") in FIT_TASKS:
            found.update(FIT_FILES)
            found.update(name + ".tmp" for name in FIT_FILES)
            found.update(f"material_{body['name']}.json"
                         for body in document.get("scene", {}).get("bodies", []))
        bodies = [body["name"] for body in document.get("scene", {}).get("bodies", [])]
        meshes = [entry["name"] for entry in document.get("output", {}).get("mesh", [])]
        for sub, names in (("points", bodies), ("mesh", meshes)):
            found.update(f"{sub}/{name}.pc2.partial" for name in names)
    return {name for name in found if os.path.isfile(os.path.join(folder, name))}


def _inside(folder, name):
    path = os.path.normpath(os.path.join(folder, name))
    return path.startswith(os.path.normpath(folder) + os.sep)


def free(folder, only=""):
    """Deletes what listed_files() names below `only`, the manifest last; then empty folders.

    Returns the files that stay because they are not ours.
    """
    if not os.path.isdir(folder):
        return []
    names = [name for name in listed_files(folder) if name.startswith(only)]
    names.sort(key=lambda name: (name == "manifest.json", name))
    for name in names:
        path = os.path.join(folder, name)
        try:
            os.remove(path)
        except FileNotFoundError:
            pass
        except OSError as error:
            raise JobError(f"{path}: could not be deleted: {error.strerror or error}. Close the "
                           "program that uses it, or change the folder's permissions.",
                           EXIT_COMPUTE) from error
    if only:
        _forget(folder, names)
    left = []
    for base, _folders, found in os.walk(folder, topdown=False):
        left.extend(os.path.relpath(os.path.join(base, name), folder) for name in found)
        with contextlib.suppress(OSError):
            os.rmdir(base)
    return sorted(left)


def _forget(folder, names):
    """Takes removed files out of the manifest; Resume then bakes them again."""
    document = manifest(folder)
    if not document:
        return
    document["files"] = {name: entry for name, entry in document["files"].items()
                         if name not in names}
    document.update(frames_baked=0, complete=False, output_hash="")
    files.write_json(os.path.join(folder, "manifest.json"), document)
