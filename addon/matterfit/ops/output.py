# SPDX-License-Identifier: GPL-3.0-or-later
"""Verify and remove caches; exports through Blender's own exporters; Status' buttons."""

import os

import bpy
from bpy.props import EnumProperty, StringProperty

from .. import compat, jobs, native
from ..compat import translate
from ..io import attached, cache, plain, takes
from ..jobs import JobError
from ..props import scene as scene_props
from .base import PlainOperator, redraw, report_error, session
from .caches import HasCache
from .job_operator import JobOperator

KINDS = (
    ("volume", "Volumes", "OpenVDB files"),
    ("mesh", "Render Meshes", "PC2 files of render meshes"),
    ("points", "Particles", "PC2 files of particles"),
    ("attributes", "Attributes", "EXR files of particle attributes"),
    ("splat", "Splats", "Gaussian splat files"),
)


def active_location(context):
    """(take, location) of the active take's cache, or JobError."""
    take = scene_props.active_take(context.scene.matterfit)
    if take is None or not take.folder:
        raise JobError(translate("This take was not baked yet. Press Bake."))
    location = takes.locate(take)
    if not location.exists:
        raise JobError(translate("{folder} does not exist. Was the cache moved? Bake again, or "
                                 "put it back.").format(folder=location.folder or take.folder))
    return take, location


class MATTERFIT_OT_verify(HasCache, JobOperator, bpy.types.Operator):
    bl_idname = "matterfit.verify"
    bl_label = "Verify"
    bl_description = "Compare every file of the active take's cache with what was written"
    bl_options = set()

    def begin(self, context):
        native.require()
        take, location = active_location(context)
        session(context).verify = ""

        def start():
            return jobs.ThreadRun(lambda: native.inspect(location.folder), "Reading files")

        return jobs.Job(translate("Verify {name}").format(name=take.name), start,
                        folder=location.folder)

    def ended(self, context, job):
        state = session(context)
        faults = job.result.get("faults", [])
        if faults:
            lines = [f"{fault['path']} {fault['what']}" for fault in faults]
            state.verify = "\n".join(lines)
            raise JobError(translate("Damaged in {folder}: {first}. Bake again.").format(
                folder=job.folder, first=lines[0] + (", …" if len(lines) > 1 else "")))
        state.verify = translate("All {files} are as they were written").format(
            files=plain.counted(len(cache.manifest(job.folder).get("files", {})), "file"))
        self.report({"INFO"}, state.verify)


class MATTERFIT_OT_remove_output(HasCache, PlainOperator, bpy.types.Operator):
    bl_idname = "matterfit.remove_output"
    bl_label = "Remove"
    bl_description = "Delete the files of one kind from the active take's cache, and their objects"
    bl_options = {"UNDO"}

    kind: EnumProperty(name="Kind", items=KINDS, options={"HIDDEN", "SKIP_SAVE"},
                       description="Which files are deleted")

    def invoke(self, context, event):
        return context.window_manager.invoke_confirm(self, event)

    def act(self, context):
        take, location = active_location(context)
        if location.linked:
            raise JobError(translate("This take belongs to another .blend file and is linked, "
                                     "read-only. Bake it under a new name first."))
        attached.detach_kind(take, self.kind)
        cache.free(location.folder, only=self.kind + "/")


class MATTERFIT_OT_open_folder(HasCache, bpy.types.Operator):
    bl_idname = "matterfit.open_folder"
    bl_label = "Open"
    bl_description = "Show the active take's cache in the file browser of the system"

    def execute(self, context):
        try:
            _take, location = active_location(context)
        except JobError as error:
            return report_error(self, context, str(error))
        return bpy.ops.wm.path_open(filepath=location.folder)


class _Export:
    """One of Blender's exporters on the objects of the active take."""

    exporter = ""
    reason = ""

    @classmethod
    def poll(cls, context):
        if not compat.operator_exists(cls.exporter):
            cls.poll_message_set(cls.reason)
            return False
        take = scene_props.active_take(context.scene.matterfit)
        if take is None or take.collection is None:
            cls.poll_message_set("Bake a take first")
            return False
        return True

    def invoke(self, context, _event):
        take = scene_props.active_take(context.scene.matterfit)
        base = os.path.splitext(bpy.data.filepath)[0] or "untitled"
        self.filepath = f"{base}_{bpy.path.clean_name(take.name)}{self.suffix}"
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context):
        take = scene_props.active_take(context.scene.matterfit)
        chosen = [item for item in take.collection.objects if item.type == "MESH"]
        before = list(context.selected_objects)
        for item in before:
            item.select_set(False)
        for item in chosen:
            if not item.hide_viewport:
                item.select_set(True)
        module, name = self.exporter.split(".")
        try:
            result = getattr(getattr(bpy.ops, module), name)(
                filepath=self.filepath, **self.arguments(context, take))
        except RuntimeError as error:
            return report_error(self, context, str(error))
        finally:
            for item in context.selected_objects:
                item.select_set(False)
            for item in before:
                item.select_set(True)
        return result


class MATTERFIT_OT_export_alembic(_Export, bpy.types.Operator):
    bl_idname = "matterfit.export_alembic"
    bl_label = "Export Alembic"
    bl_description = "Write the active take's meshes as an Alembic file"

    filepath: StringProperty(name="File", subtype="FILE_PATH", description="The file to write")
    exporter = "wm.alembic_export"
    reason = "This Blender was built without Alembic"
    suffix = ".abc"

    def arguments(self, _context, take):
        return {"selected": True, "start": take.first_frame,
                "end": take.first_frame + max(take.frames_done, 1) - 1}


class MATTERFIT_OT_export_usd(_Export, bpy.types.Operator):
    bl_idname = "matterfit.export_usd"
    bl_label = "Export USD"
    bl_description = "Write the active take's meshes as a USD file"

    filepath: StringProperty(name="File", subtype="FILE_PATH", description="The file to write")
    exporter = "wm.usd_export"
    reason = "This Blender was built without USD"
    suffix = ".usdc"

    def arguments(self, _context, _take):
        return {"selected_objects_only": True, "export_animation": True}


class MATTERFIT_OT_copy_error(bpy.types.Operator):
    bl_idname = "matterfit.copy_error"
    bl_label = "Copy"
    bl_description = "Copy the full text of the last error, with the version, to the clipboard"

    def execute(self, context):
        context.window_manager.clipboard = (
            f"Matterfit {native.version()}, Blender {bpy.app.version_string}\n"
            f"{session(context).last_error}")
        return {"FINISHED"}


class MATTERFIT_OT_clear_error(bpy.types.Operator):
    bl_idname = "matterfit.clear_error"
    bl_label = "Clear"
    bl_description = "Forget the last error"

    def execute(self, context):
        session(context).last_error = ""
        redraw(context)
        return {"FINISHED"}


CLASSES = (MATTERFIT_OT_verify, MATTERFIT_OT_remove_output, MATTERFIT_OT_open_folder,
           MATTERFIT_OT_export_alembic, MATTERFIT_OT_export_usd, MATTERFIT_OT_copy_error,
           MATTERFIT_OT_clear_error)
