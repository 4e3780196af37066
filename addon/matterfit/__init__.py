# SPDX-License-Identifier: GPL-3.0-or-later
"""Matterfit: fits materials to captured motion, simulates them, bakes caches.

The version shown is the native library's; bl_info serves Blender up to 4.1 and is read by no code.
"""

import atexit

import bpy

from . import handlers, i18n, jobs, native, ops, props, ui
from .ops.job_operator import cancel_modal_operators

bl_info = {
    "name": "Matterfit",
    "author": "Matterfit developers",
    "version": (0, 1, 0),
    "blender": (3, 4, 0),
    "location": "3D View > Sidebar > Matterfit",
    "description": "Fit materials to captured motion, simulate them, bake caches",
    "category": "Physics",
}

_CLASSES = (*props.CLASSES, *ops.CLASSES, *ui.CLASSES)


def register():
    for cls in _CLASSES:
        bpy.utils.register_class(cls)
    props.attach()
    handlers.register()
    i18n.register(__package__)
    ui.register()
    # Blender may quit without unregistering; a job must not outlive the interpreter.
    atexit.register(jobs.registry.stop_all)
    native.load()
    handlers.migrate_open_file()


def unregister():
    cancel_modal_operators(bpy.context)
    jobs.registry.stop_all()
    atexit.unregister(jobs.registry.stop_all)
    ui.unregister()
    i18n.unregister(__package__)
    handlers.unregister()
    props.detach()
    for cls in reversed(_CLASSES):
        bpy.utils.unregister_class(cls)
    native.unload()
