# SPDX-License-Identifier: GPL-3.0-or-later
"""What the scripts share that run in a real window."""

import bpy


def only_ours():
    """Without the other tabs ours is the active one (3.4 has no call that switches tabs)."""
    for cls in list(bpy.types.Panel.__subclasses__()):
        if (getattr(cls, "bl_space_type", "") == "VIEW_3D"
                and getattr(cls, "bl_region_type", "") == "UI"
                and getattr(cls, "bl_category", "") != "Matterfit"
                and hasattr(bpy.types, cls.__name__)):
            try:
                bpy.utils.unregister_class(cls)
            except RuntimeError:
                pass


def view():
    """(window, area) of the 3D view."""
    window = bpy.context.window_manager.windows[0]
    area = max((area for area in window.screen.areas if area.type == "VIEW_3D"),
               key=lambda area: area.width)
    return window, area
