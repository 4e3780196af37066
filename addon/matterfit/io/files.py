# SPDX-License-Identifier: GPL-3.0-or-later
"""Files of ours: written atomically, with the same bytes for the same content."""

import contextlib
import io
import json
import os
import unicodedata
import zipfile
import zlib

import bpy
import numpy

from ..compat import translate
from ..jobs import EXIT_COMPUTE, JobError


def absolute(path):
    """A path as Blender keeps it (// is the .blend's folder), absolute and normalised."""
    return os.path.normpath(bpy.path.abspath(path))


def require_file(path, what):
    """JobError, begun with `what`, where an absolute path is no file."""
    if os.path.isdir(path):
        raise JobError(translate("{what}: {path} is a folder. Choose a file in it.").format(
            what=what, path=path))
    if not os.path.isfile(path):
        raise JobError(translate("{what}: the file {path} does not exist. Was it moved?").format(
            what=what, path=path))


def write_bytes(path, content):
    """Writes beside `path` and renames, so that no half-written file has the final name."""
    temporary = path + ".tmp"
    try:
        os.makedirs(os.path.dirname(path), exist_ok=True)
        with open(temporary, "wb") as stream:
            stream.write(content)
            stream.flush()
            os.fsync(stream.fileno())
        os.replace(temporary, path)
    except OSError as error:
        with contextlib.suppress(OSError):
            os.remove(temporary)
        raise JobError(f"{path}: could not be written: {error.strerror or error}. "
                       "Is the disk full, or the folder read-only?", EXIT_COMPUTE) from error
    return path


def copy(source, path):
    """A copy of the file `source` at `path`."""
    try:
        with open(source, "rb") as stream:
            content = stream.read()
    except OSError as error:
        raise JobError(f"{source}: could not be read: {error.strerror or error}") from error
    return write_bytes(path, content)


def stamp(path):
    """Changes whenever the file is written; None where there is none."""
    try:
        found = os.stat(path)
    except OSError:
        return None
    return found.st_mtime_ns, found.st_size, found.st_ino


def json_bytes(document):
    return (json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n").encode()


def write_json(path, document):
    return write_bytes(path, json_bytes(document))


def read_text(path):
    try:
        with open(path, encoding="utf-8") as stream:
            return stream.read()
    except OSError as error:
        raise JobError(f"{path}: could not be read: {error.strerror or error}") from error


def read_json(path):
    """The document, or JobError that names the file and the reason."""
    try:
        return json.loads(read_text(path))
    except ValueError as error:
        raise JobError(f"{path}: is not valid JSON: {error}. Was it edited by hand?") from error


def npz_bytes(arrays):
    """A .npz (stored, dates constant): numpy's own writer puts the time of day in."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_STORED) as archive:
        for name in sorted(arrays):
            member = io.BytesIO()
            numpy.lib.format.write_array(member, numpy.ascontiguousarray(arrays[name]),
                                         allow_pickle=False)
            information = zipfile.ZipInfo(name + ".npy", date_time=(1980, 1, 1, 0, 0, 0))
            information.create_system = 3
            archive.writestr(information, member.getvalue())
    return buffer.getvalue()


def write_npz(path, arrays):
    return write_bytes(path, npz_bytes(arrays))


def safe_name(name):
    """A name that any file system takes: letters with their marks and digits of any script, - and
    _ in place of the rest. A name that has none of these gets a number of its own."""
    composed = unicodedata.normalize("NFC", name)
    kept = "".join(letter if letter in "-_" or unicodedata.category(letter)[0] in "LMN" else " "
                   for letter in composed)
    found = "_".join(kept.split()).strip("_")
    return found or f"unnamed_{zlib.crc32(composed.encode()):08x}"


def number(value):
    """A float32 property as the decimal the user typed (7 digits), a plain int where it is one."""
    value = float(f"{float(value):.7g}")
    return int(value) if value.is_integer() and abs(value) < 1e15 else value


def numbers(values):
    return [number(value) for value in values]
