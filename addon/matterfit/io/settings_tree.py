# SPDX-License-Identifier: GPL-3.0-or-later
"""Our settings, walked through."""

import bpy


def groups(group):
    """The property group itself and all that lie in it, the rows of its lists too."""
    yield group
    for item in group.bl_rna.properties:
        if item.type not in {"POINTER", "COLLECTION"} or item.identifier == "rna_type":
            continue
        inside = getattr(group, item.identifier)
        for row in inside if item.type == "COLLECTION" else (inside,):
            if isinstance(row, bpy.types.PropertyGroup):
                yield from groups(row)
