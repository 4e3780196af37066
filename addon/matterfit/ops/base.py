# SPDX-License-Identifier: GPL-3.0-or-later
"""What every operator of ours does alike."""


import bpy

from .. import jobs
from ..compat import translate
from ..io import words
from ..jobs import JobError
from ..props import scene as scene_props


def session(context):
    return context.window_manager.matterfit


def report_error(operator, context, message):
    """Shows the error, keeps it for Status > Copy, and returns what execute() returns."""
    message = words.in_panel(message, context.scene.matterfit)
    session(context).last_error = message
    operator.report({"ERROR"}, message)
    redraw(context)
    return {"CANCELLED"}


def redraw(context):
    """The panels read the job itself, so only they have to be drawn again, not the scene."""
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                for region in area.regions:
                    if region.type == "UI":
                        region.tag_redraw()


def status_text(context, text):
    """One line in the status bar of this workspace; None clears it in every workspace."""
    workspace = context.workspace
    if workspace is None:
        return
    if text is not None:
        workspace.status_text_set(text)
        return
    for other in bpy.data.workspaces:
        # Blender takes the workspace from the context, not the one the method is called on.
        with context.temp_override(workspace=other):
            other.status_text_set(None)


def push_undo(message):
    """An undo step of what has been changed so far; there are none in the background."""
    if not bpy.app.background and bpy.ops.ed.undo_push.poll():
        bpy.ops.ed.undo_push(message=message)


def remove_active(owner, items, index):
    """Removes the active item of a list, given by the names of `owner`'s properties; the one after
    it becomes active, or the last."""
    collection, at = getattr(owner, items), getattr(owner, index)
    collection.remove(at)
    setattr(owner, index, max(0, min(at, len(collection) - 1)))


def report_left(operator, folder, names):
    """What a folder holds that is not ours, and so was not deleted."""
    if names:
        operator.report({"WARNING"}, translate("Not ours, and kept in {folder}: {names}").format(
            folder=folder, names=", ".join(names[:5]) + (", …" if len(names) > 5 else "")))


def greyed(cls, condition, reason):
    """What a poll() returns: False where the operator is greyed, which its button explains."""
    if condition and hasattr(cls, "poll_message_set"):
        cls.poll_message_set(reason)
    return not condition


class NoJobRunning:
    """Greyed, with the reason, while a job runs."""

    @classmethod
    def poll(cls, context):
        return greyed(cls, jobs.registry.running is not None,
                      "Another job is running: cancel it first")


class NeedsTracks(NoJobRunning):
    """Greyed, with the reason, where a recording that is used is of images or of clouds without correspondence."""

    @classmethod
    def poll(cls, context):
        return super().poll(context) and greyed(
            cls, not scene_props.follow_points(context.scene.matterfit),
            "Needs recordings that follow the same points through time. Set Loss in Fit to Tracks, and disable "
            "captures by images.")


class PlainOperator:
    """An operator whose `act(context)` may raise JobError."""

    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context):
        try:
            result = self.act(context) or {"FINISHED"}
        except JobError as error:
            return report_error(self, context, str(error))
        if "FINISHED" in result:
            session(context).last_error = ""  # of what was tried before
        redraw(context)
        return result
