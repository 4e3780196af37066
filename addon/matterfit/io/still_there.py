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
    """A function that says whether all that is held now is there still, and the same scene is shown:
    what is evaluated is of that."""
    objects, rows = _objects(), _rows()
    return lambda: objects <= _objects() and _rows() == rows


def _objects():
    """Where they lie, whatever they are called; others may be added."""
    return {item.as_pointer() for item in bpy.data.objects}


def _rows():
    """Where the shown scene lies, and the rows of our settings and the objects that they name; not what
    batches and comparisons list."""
    context = bpy.context
    found = [_undone[0], context.scene.as_pointer(), context.view_layer.as_pointer()]
    for scene in bpy.data.scenes:
        settings = scene.matterfit
        found += [scene.as_pointer(), settings.as_pointer()]
        for name in ("solver", "output", "bodies", "captures", "effects", "pairs"):
            inside = getattr(settings, name)
            for row in inside if hasattr(inside, "add") else (inside,):
                found += [place for group in settings_tree.groups(row) for place in _named(group)]
        for take in (*settings.takes, settings.preview, settings.fit.run, settings.batch.run, settings.batch.fits):
            found += [take.as_pointer(), *(row.as_pointer() for row in (*take.throws, *take.colliders))]
    return found


def _named(group):
    """Where the group lies, and each data-block that it names."""
    yield group.as_pointer()
    for item in group.bl_rna.properties:
        if item.type == "POINTER" and item.identifier != "rna_type":
            value = getattr(group, item.identifier)
            if isinstance(value, bpy.types.ID):
                yield value.as_pointer()
            elif value is None:
                yield 0
