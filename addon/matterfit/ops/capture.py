# SPDX-License-Identifier: GPL-3.0-or-later
"""Importing captures."""

import contextlib
import os

import bpy
from bpy.props import CollectionProperty, EnumProperty, StringProperty
from bpy_extras.io_utils import ImportHelper

from .. import native
from ..compat import translate
from ..io import blender_cameras, camera_frames, files, fit_rows, job_captures, job_images
from ..jobs import JobError
from ..names import unique
from ..props import choices
from ..props import scene as scene_props
from .base import PlainOperator, greyed, redraw, remove_active

EXTENSIONS = (".npz", ".npy", ".c3d", ".pc2", ".ply")


def add_capture(settings, name):
    capture = settings.captures.add()
    capture.name = unique(name, [other for other in settings.captures if other != capture])
    settings.capture_index = len(settings.captures) - 1
    fit_rows.refresh(settings)
    return capture


def read_summary(scene, capture):
    """Reads the file, fills in the summary and returns it; JobError where it cannot be read."""
    path = files.absolute(capture.filepath)
    images = capture.source == "IMAGES"
    if not (images and os.path.isdir(path)):
        files.require_file(path, f"capture '{capture.name}'")
    if images:
        found = job_images.read_summary(capture, native.capture_summary)
    else:
        if job_captures.is_numbered(path):
            path = job_captures.numbered_pattern(path)
        options = job_captures.reading_options(capture)
        # Files without times play at the scene's rate.
        options.setdefault("fps", scene.render.fps / scene.render.fps_base)
        found = native.capture_summary(path, options)
    capture.summary = "\n".join(found.get("text", []))
    return found


def blend_relative(path):
    """A path relative to the .blend, where that is saved and on the same drive."""
    if path and bpy.data.filepath:
        with contextlib.suppress(ValueError):
            return bpy.path.relpath(path)
    return path


def import_file(context, name, filepath, **properties):
    """Adds a capture of a file and returns the file's summary; nothing is added where it cannot be
    read."""
    settings = context.scene.matterfit
    index = settings.capture_index
    capture = add_capture(settings, name)
    for key, value in properties.items():
        setattr(capture, key, value)
    capture.filepath = blend_relative(filepath)
    try:
        return read_summary(context.scene, capture)
    except JobError:
        settings.captures.remove(len(settings.captures) - 1)
        settings.capture_index = index
        fit_rows.refresh(settings)
        raise


class MATTERFIT_OT_import_capture(PlainOperator, bpy.types.Operator, ImportHelper):
    bl_idname = "matterfit.import_capture"
    bl_label = "Import Capture"
    bl_description = "Add a recording: .npz, .npy, .c3d, .pc2, or the first of numbered .ply files"

    filter_glob: StringProperty(default=";".join("*" + kind for kind in EXTENSIONS),
                                options={"HIDDEN"})
    files: CollectionProperty(type=bpy.types.OperatorFileListElement,
                              options={"HIDDEN", "SKIP_SAVE"})
    unit: EnumProperty(
        name="Unit", default="AUTO", description="What one unit of the file's positions is",
        items=choices.UNITS[:4])

    def act(self, context):
        extension = os.path.splitext(self.filepath)[1].lower()
        if extension not in EXTENSIONS:
            raise JobError(translate("{path}: captures are {kinds} files. Choose one of them.")
                           .format(path=self.filepath, kinds=", ".join(EXTENSIONS)))
        import_file(context, os.path.splitext(os.path.basename(self.filepath))[0], self.filepath,
                    unit=self.unit)


class MATTERFIT_OT_add_capture_object(PlainOperator, bpy.types.Operator):
    bl_idname = "matterfit.add_capture_object"
    bl_label = "Use Active Object"
    bl_description = "Use the active object's animation as a capture: its mesh at every frame"

    @classmethod
    def poll(cls, context):
        item = context.active_object
        return greyed(cls, item is None or item.type != "MESH", "Select a mesh object first")

    def act(self, context):
        item = context.active_object
        job_captures.refuse_result(item, "Capture")
        capture = add_capture(context.scene.matterfit, item.name)
        capture.source = "OBJECT"
        capture.object = item
        capture.summary = translate("{n} points, sampled at every frame of the range").format(
            n=len(item.data.vertices))


class MATTERFIT_OT_remove_capture(PlainOperator, bpy.types.Operator):
    bl_idname = "matterfit.remove_capture"
    bl_label = "Remove Capture"
    bl_description = "Remove the active capture from the list; no file is deleted"

    @classmethod
    def poll(cls, context):
        return greyed(cls, scene_props.active_capture(context.scene.matterfit) is None,
                      "There is no capture")

    def act(self, context):
        settings = context.scene.matterfit
        blender_cameras.let_go(scene_props.active_capture(settings))
        remove_active(settings, "captures", "capture_index")
        fit_rows.refresh(settings)


class MATTERFIT_OT_check_capture(PlainOperator, bpy.types.Operator):
    bl_idname = "matterfit.check_capture"
    bl_label = "Check Capture"
    bl_description = ("Read the active capture again: frames, spacing in time, size, missing "
                      "samples, jumps, noise")

    @classmethod
    def poll(cls, context):
        capture = scene_props.active_capture(context.scene.matterfit)
        return greyed(cls, capture is None or capture.source == "OBJECT",
                      "The capture is not read from a file")

    def act(self, context):
        capture = scene_props.active_capture(context.scene.matterfit)
        found = read_summary(context.scene, capture)
        if capture.source == "IMAGES":
            blender_cameras.read_again(capture, found["places"])
            camera_frames.told(capture, found["places"])
        redraw(context)


class MATTERFIT_OT_forget_poses(PlainOperator, bpy.types.Operator):
    bl_idname = "matterfit.forget_poses"
    bl_label = "Forget Camera Poses"
    bl_description = ("Let the active capture's cameras stand where their file says again; what a fit "
                      "has found of them is lost")

    @classmethod
    def poll(cls, context):
        capture = scene_props.active_capture(context.scene.matterfit)
        return greyed(cls, capture is None or not capture.poses,
                      "No fit has moved the cameras of this capture")

    def act(self, context):
        capture = scene_props.active_capture(context.scene.matterfit)
        capture.poses = ""
        blender_cameras.place(capture)


CLASSES = (MATTERFIT_OT_import_capture, MATTERFIT_OT_add_capture_object,
           MATTERFIT_OT_remove_capture, MATTERFIT_OT_check_capture,
           MATTERFIT_OT_forget_poses)
