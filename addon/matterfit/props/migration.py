# SPDX-License-Identifier: GPL-3.0-or-later
"""Brings the settings of older files up to date: property defaults are not stored in a .blend."""

from .. import laws
from . import reactions
from .scene import SCHEMA_VERSION


def _from_1(settings):
    """Version 1 had no preview and its takes did not know their owner: a cache beside the file is
    this file's."""
    import os

    import bpy
    for take in settings.takes:
        if take.folder and not take.owner and bpy.data.filepath:
            take.owner = os.path.abspath(bpy.data.filepath)


def _from_2(settings):
    """Version 2 had no fit: its bodies have no list of parameters yet."""
    reactions.fit_list_outdated(settings)


def _from_3(settings):
    """Version 3 chose the separation of what pours as of any other body; what its file says stays."""
    settings.solver.for_flows = laws.any_flows(settings.bodies)


STEPS = {1: _from_1, 2: _from_2, 3: _from_3}


def is_used(settings):
    """Whether the scene holds anything of ours."""
    return bool(settings.captures or settings.bodies or settings.takes)


def migrate_scene(scene):
    """Returns a message where the scene comes from a newer version, else ""."""
    settings = scene.matterfit
    version = settings.schema_version
    if version == 0:
        # Never saved with us: new. (Version 1 stored its number.)
        settings.schema_version = SCHEMA_VERSION
        return ""
    if version > SCHEMA_VERSION:
        return (f"Scene '{scene.name}' was saved by a newer Matterfit (settings {version}, this "
                f"one knows {SCHEMA_VERSION}). Some settings may be missing: update the add-on.")
    while version < SCHEMA_VERSION:
        STEPS[version](settings)
        version += 1
    settings.schema_version = SCHEMA_VERSION
    return ""
