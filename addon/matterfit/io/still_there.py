# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether objects and settings that are held from one look at the window to the next are there still.

Undo, and removing an object or a row, leave Python with places in memory that hold something else.
"""

import bpy

from . import settings_tree

_undone = [0]


def undone():
    """Undo has put other data in place of all that is held."""
    _undone[0] += 1


def watch():
    """A function that says whether all that is held now is there still."""
    before = _places()
    return lambda: _places() == before


def _places():
    """Scenes, objects and our settings by name, and where they lie."""
    found = [_undone[0], *((item.name, item.as_pointer()) for item in bpy.data.objects)]
    for scene in bpy.data.scenes:
        found += [scene.name, scene.as_pointer()]
        found += [group.as_pointer() for group in settings_tree.groups(scene.matterfit)]
    return found
