# SPDX-License-Identifier: GPL-3.0-or-later
"""Takes: reruns of the scene, each with its own cache."""

import bpy

from ..compat import translate
from ..io import attached, cache, job_render, takes
from ..jobs import JobError
from ..props import scene as scene_props
from .base import NoJobRunning, PlainOperator, greyed, remove_active, session


class MATTERFIT_OT_add_take(PlainOperator, bpy.types.Operator):
    bl_idname = "matterfit.add_take"
    bl_label = "Add Take"
    bl_description = "A new take that starts with the settings of the active one; it has no cache"

    def act(self, context):
        settings = context.scene.matterfit
        source = scene_props.active_take(settings)
        if source is None:
            takes.ensure_active(settings)
            return
        index = settings.take_index
        take = takes.add(settings, f"{translate('Take')} {len(settings.takes) + 1}")
        # The collection may have moved in memory: read the source again.
        takes.copy_settings(settings.takes[index], take)
        settings.take_index = len(settings.takes) - 1


class MATTERFIT_OT_remove_take(NoJobRunning, PlainOperator, bpy.types.Operator):
    bl_idname = "matterfit.remove_take"
    bl_label = "Remove Take"
    bl_description = "Remove the active take, the objects that show it, and its cache"
    bl_options = {"UNDO"}

    @classmethod
    def poll(cls, context):
        return super().poll(context) and greyed(
            cls, scene_props.active_take(context.scene.matterfit) is None, "There is no take")

    def invoke(self, context, event):
        return context.window_manager.invoke_confirm(self, event)

    def act(self, context):
        scene = context.scene
        settings = scene.matterfit
        take = scene_props.active_take(settings)
        location = takes.locate(take)
        attached.detach(scene, take)
        if location.exists and not location.linked:
            cache.free(location.folder)
            job_render.hide_removed(location.folder)
        remove_active(settings, "takes", "take_index")
        session(context).last_report = ""  # of its bake


class MATTERFIT_OT_add_throw(PlainOperator, bpy.types.Operator):
    bl_idname = "matterfit.add_throw"
    bl_label = "Throw Active Body"
    bl_description = ("Give the body that is active in Bodies a position, rotation and velocity of "
                      "its own in this take, starting with what it has now")

    @classmethod
    def poll(cls, context):
        body = scene_props.active_body(context.scene.matterfit)
        return greyed(cls, body is None or body.role != "BODY",
                      "Choose a body in Bodies: colliders are not thrown")

    def act(self, context):
        settings = context.scene.matterfit
        body = scene_props.active_body(settings)
        take = takes.ensure_active(settings)
        if any(throw.name == body.name for throw in take.throws):
            raise JobError(translate("'{name}' is already thrown in this take; its throw is in the "
                                     "list.").format(name=body.name))
        throw = take.throws.add()
        throw.name = body.name
        throw.velocity_from = body.velocity_from
        throw.velocity = body.velocity
        throw.spin = body.spin
        if body.object is not None:
            throw.location = body.object.matrix_world.translation
            throw.rotation = body.object.matrix_world.to_euler()
        session(context).throw_index = len(take.throws) - 1


class MATTERFIT_OT_remove_throw(PlainOperator, bpy.types.Operator):
    bl_idname = "matterfit.remove_throw"
    bl_label = "Remove Throw"
    bl_description = "The body starts as set in Bodies again"

    @classmethod
    def poll(cls, context):
        take = scene_props.active_take(context.scene.matterfit)
        return greyed(cls, take is None or not take.throws, "There is no throw in this take")

    def act(self, context):
        take = scene_props.active_take(context.scene.matterfit)
        index = min(session(context).throw_index, len(take.throws) - 1)
        take.throws.remove(index)
        session(context).throw_index = max(0, index - 1)


class MATTERFIT_OT_list_colliders(PlainOperator, bpy.types.Operator):
    bl_idname = "matterfit.list_colliders"
    bl_label = "List Colliders"
    bl_description = "Bring the take's collider switches up to date with Bodies"

    def act(self, context):
        settings = context.scene.matterfit
        take = takes.ensure_active(settings)
        names = [body.name for body in settings.bodies if body.role == "COLLIDER"]
        known = {switch.name for switch in take.colliders}
        for index in reversed(range(len(take.colliders))):
            if take.colliders[index].name not in names:
                take.colliders.remove(index)
        for name in names:
            if name not in known:
                take.colliders.add().name = name


CLASSES = (MATTERFIT_OT_add_take, MATTERFIT_OT_remove_take, MATTERFIT_OT_add_throw,
           MATTERFIT_OT_remove_throw, MATTERFIT_OT_list_colliders)
