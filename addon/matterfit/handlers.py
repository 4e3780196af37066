# SPDX-License-Identifier: GPL-3.0-or-later
"""What happens around opening and saving files. No frame handlers: results play natively."""

import bpy
from bpy.app.handlers import persistent

from . import jobs
from .io import camera_frames, comparison, lost, moved_paths, resolution, still_there, takes
from .props import migration
from .ui import overlay, solver


@persistent
def stop_jobs(*_arguments):
    """A job belongs to the file that started it."""
    jobs.registry.stop_all()


@persistent
def migrate_all(*_arguments):
    messages = [migration.migrate_scene(scene) for scene in bpy.data.scenes]
    for scene in bpy.data.scenes:
        moved_paths.follow(scene.matterfit, moved_along=True)
        takes.look_at_disk(scene.matterfit)
        comparison.show_again(scene.matterfit)
        camera_frames.fill(scene)
    camera_frames.subscribe()
    state = bpy.context.window_manager.matterfit
    state.last_report = state.estimate = state.verify = ""  # of another file
    state.last_error = next((message for message in messages if message), "")
    overlay.forget()
    resolution.forget()
    solver.forget()


def migrate_open_file():
    """For a file that was opened before the add-on was enabled. At start-up there is none yet."""
    if hasattr(bpy.data, "scenes"):
        migrate_all()


@persistent
def stamp_version(*arguments):
    """Scenes made since the file was opened get the version before they are saved. From 4.0 on Blender
    says to which file."""
    target = arguments[0] if arguments and isinstance(arguments[0], str) else ""
    for scene in bpy.data.scenes:
        if migration.is_used(scene.matterfit) and scene.matterfit.schema_version == 0:
            scene.matterfit.schema_version = migration.SCHEMA_VERSION
        moved_paths.remember(scene.matterfit, target)


@persistent
def follow_paths(*_arguments):
    """Save As to another folder: Blender rewrites the paths of images, and not ours."""
    for scene in bpy.data.scenes:
        moved_paths.follow(scene.matterfit)


@persistent
def look_after_undo(*_arguments):
    """Free and its like delete files, which undo cannot bring back; what was said of a bake is not so of
    what undo leaves of it."""
    still_there.undone()
    bpy.context.window_manager.matterfit.last_report = ""
    for scene in bpy.data.scenes:
        lost.forget(scene)


_HANDLERS = (("load_pre", stop_jobs), ("load_post", migrate_all), ("save_pre", stamp_version),
             ("save_post", follow_paths), ("save_post_fail", follow_paths),
             ("undo_post", look_after_undo), ("redo_post", look_after_undo))


def register():
    for name, function in _HANDLERS:
        getattr(bpy.app.handlers, name, []).append(function)  # that of a failure came with 4.0
    camera_frames.subscribe()


def unregister():
    camera_frames.unsubscribe()
    for name, function in _HANDLERS:
        handlers = getattr(bpy.app.handlers, name, [])
        if function in handlers:
            handlers.remove(function)
