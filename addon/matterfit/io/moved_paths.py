# SPDX-License-Identifier: GPL-3.0-or-later
"""Paths relative to the .blend (//…) of captures, bodies and weights, when that is saved elsewhere.

Blender rewrites those that it knows as it writes the file. Where it tells us before where that goes,
ours are rewritten then. 3.4 does not: the scene remembers what its paths are relative to, and they are
rewritten once the file has its new place, and where it is opened there.
"""

import filecmp
import os

import bpy

from ..props import reactions
from . import settings_tree

_KINDS = {"FILE_PATH", "DIR_PATH"}


def _here():
    return os.path.dirname(os.path.abspath(bpy.data.filepath)) if bpy.data.filepath else ""


def remember(settings, target=""):
    """Before the file is written, to `target` where that is known. After a copy the open file is where it
    was: follow() takes this back."""
    if not settings.saved_in:
        settings.saved_in = _here()
    if target and settings.saved_in:
        _rewrite(settings, os.path.dirname(os.path.abspath(target)))


def follow(settings, moved_along=False):
    """Rewrites paths that are relative to another folder than the file is in. `moved_along`: a file that
    lies where the path says as it stands, with what the other one holds or in its place, was moved or
    copied together with the .blend."""
    _rewrite(settings, _here(), moved_along)


def _rewrite(settings, here, moved_along=False):
    before = settings.saved_in
    if not here or here == before:
        return
    settings.saved_in = here
    if not before:
        return
    with reactions.paths_rewritten():
        for owner, name in _paths(settings):
            relative = getattr(owner, name)[2:]
            there = os.path.normpath(os.path.join(before, relative))
            if os.path.exists(there) and not (moved_along and _same(there, os.path.join(here, relative))):
                setattr(owner, name, _relative(there, here) + "/" * relative.endswith("/"))


def _same(path, other):
    """Whether both hold the same; of folders what they list and its sizes."""
    try:
        if os.path.isdir(path):
            return _listed(path) == _listed(other)
        return filecmp.cmp(path, other, shallow=False)
    except OSError:
        return False


def _listed(folder):
    return sorted((entry.name, entry.stat().st_size) for entry in os.scandir(folder) if entry.is_file())


def _relative(path, folder):
    try:
        return bpy.path.relpath(path, start=folder)
    except ValueError:  # another drive
        return path


def _paths(settings):
    """[(owner, name)] of every path in the settings that begins with //."""
    return [(group, item.identifier) for group in settings_tree.groups(settings)
            for item in group.bl_rna.properties
            if item.type == "STRING" and item.subtype in _KINDS
            and getattr(group, item.identifier).startswith("//")]
