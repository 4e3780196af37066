# SPDX-License-Identifier: GPL-3.0-or-later
"""Shortcuts, in the add-on's own key map: the user's preferences list and change them."""

import bpy

_added = []


def register():
    keys = bpy.context.window_manager.keyconfigs.addon
    if keys is None:  # in the background
        return
    keymap = keys.keymaps.new(name="3D View", space_type="VIEW_3D")
    _added.append((keymap, keymap.keymap_items.new("matterfit.flip_photograph", "B", "PRESS", shift=True,
                                                   alt=True)))


def unregister():
    for keymap, item in _added:
        keymap.keymap_items.remove(item)
    _added.clear()
