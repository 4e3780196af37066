# SPDX-License-Identifier: GPL-3.0-or-later
"""Paths relative to the .blend (//…) of captures, bodies and weights, when that is saved elsewhere.

Blender rewrites those that it knows as it writes the file, and tells before that neither us nor, in 3.4,
where the file goes. So the scene remembers what its paths are relative to; they are rewritten once the
file has its new place, and where it is opened there.
"""

import os

import bpy

from ..props import reactions
from . import settings_tree

_KINDS = {"FILE_PATH", "DIR_PATH"}


def _here():
    return os.path.dirname(os.path.abspath(bpy.data.filepath)) if bpy.data.filepath else ""


def remember(settings):
    """Before the file is written, perhaps to another folder."""
    if not settings.saved_in:
        settings.saved_in = _here()


def follow(settings, moved_along=False):
    """Rewrites paths that are relative to another folder than the file is in. `moved_along`: a file that
    lies where the path says as it stands was moved or copied together with the .blend."""
    here, before = _here(), settings.saved_in
    if not here or here == before:
        return
    settings.saved_in = here
    if not before:
        return
    with reactions.paths_rewritten():
        for owner, name in _paths(settings):
            relative = getattr(owner, name)[2:]
            there = os.path.normpath(os.path.join(before, relative))
            if moved_along and os.path.exists(os.path.join(here, relative)):
                continue
            if os.path.exists(there):
                setattr(owner, name, _relative(there, here))


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
