# SPDX-License-Identifier: GPL-3.0-or-later
"""What every operator of ours does alike; above all the long job, modal or blocking."""

import contextlib
import time
import traceback

import bpy

from .. import jobs
from ..compat import translate
from ..io import words
from ..jobs import JobError, State

INTERVAL = 0.1
REST = 3.0  # times as long as showing a frame took, the window is left alone after it


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


# The operators that run modally: Blender names them nowhere.
_modal = []


def cancel_modal_operators(context):
    """Ends what runs modally, with its timer, its progress cursor and its text in the status bar:
    Blender frees such operators with their classes and calls no cancel()."""
    for operator in list(_modal):
        operator.cancel(context)


class JobOperator(NoJobRunning):
    """A long job. `execute()` blocks and is the truth; the modal side polls the same job.

    A subclass has `begin(context)`, which returns a jobs.Job not yet started; `progressed(context,
    job)`, called whenever `progress_mark(context, job)` has changed: when more frames are done; and
    `ended(context, job)`, called when it is DONE, whose changes make the one undo step.
    """

    # Not REGISTER: Repeat Last would run it again without a question.
    bl_options = {"UNDO"}
    _timer = None
    _job = None
    _mark_shown = None
    _rests_until = 0.0  # by time.monotonic()
    # What replaces the tool's advice to run with --restart.
    restart_advice = "Press Bake, and choose a new take or this one."

    def progress_mark(self, context, job):
        return job.snapshot.frame

    def progressed(self, context, job):
        pass

    def ended(self, context, job):
        pass

    def execute(self, context):
        try:
            job = jobs.registry.add(self.begin(context))
        except JobError as error:
            return report_error(self, context, str(error))
        manager = context.window_manager
        manager.progress_begin(0.0, 100.0)
        try:
            job.run(on_tick=lambda running: self._tick(context, running))
        except KeyboardInterrupt:
            job.cancel()
            job.join()
        finally:
            manager.progress_end()
        return self._finish(context, job)

    def invoke(self, context, _event):
        if bpy.app.background:
            return self.execute(context)
        try:
            self._job = jobs.registry.add(self.begin(context))
        except JobError as error:
            return report_error(self, context, str(error))
        # The take's folder is a step of its own: undoing the result keeps track of the cache.
        self._push_undo()
        self._job.start()
        session(context).last_error = ""
        self._mark_shown = None
        manager = context.window_manager
        manager.progress_begin(0.0, 100.0)
        self._timer = manager.event_timer_add(INTERVAL, window=context.window)
        manager.modal_handler_add(self)
        _modal.append(self)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        job = self._job
        if job.tick():
            self._tick(context, job)
        redraw(context)  # time left moves between ticks too
        if not job.ended:
            return {"PASS_THROUGH"}
        self._remove_timer(context)
        return self._finish(context, job)

    def cancel(self, context):
        """Blender takes the operator away: a file is loaded, or the window closes."""
        if self._job is not None:
            self._job.cancel()
            self._job.join()
            with contextlib.suppress(Exception):
                self.taken_away(context, self._job)
        self._remove_timer(context)

    def _remove_timer(self, context):
        if self._timer is not None:
            _modal.remove(self)
            context.window_manager.event_timer_remove(self._timer)
            self._timer = None
            context.window_manager.progress_end()
            status_text(context, None)

    def _tick(self, context, job):
        context.window_manager.progress_update(100.0 * job.fraction)
        status_text(context, progress_text(job))
        mark = self.progress_mark(context, job)
        # While a frame is shown nothing is heard of Cancel: it is left out where there is no time.
        began = time.monotonic()
        if mark != self._mark_shown and job.state is State.RUNNING and began >= self._rests_until:
            self._mark_shown = mark
            # A frame that cannot be shown yet is shown at the end, or named there.
            with contextlib.suppress(Exception):
                self.progressed(context, job)
            now = time.monotonic()
            self._rests_until = now + REST * (now - began)

    def _push_undo(self):
        if "UNDO" in self.bl_options:
            push_undo(self.bl_label)

    def _finish(self, context, job):
        status_text(context, None)
        try:
            result = self._result(context, job)
        except JobError as error:
            result = report_error(self, context, str(error))
        except Exception as error:
            traceback.print_exc()
            result = report_error(self, context, translate(
                "{name} ended, but what it gave could not be shown: {error}. The files in {folder} "
                "are as it left them; where it was raised stands in the system console.").format(
                    name=job.label, error=f"{type(error).__name__}: {error}", folder=job.folder))
        if "CANCELLED" in result:
            # Blender makes the step of what has finished. Without one here, undoing whatever comes
            # next would take the take's folder away.
            self._push_undo()
        redraw(context)
        return result

    def _result(self, context, job):
        if job.state is State.CANCELLED:
            said = translate("Cancelled: {name}")
            if job.resumable:
                said = translate("Cancelled: {name}. Resume goes on where it stopped")
            self.report({"WARNING"}, said.format(name=job.label))
            self.stopped(context, job)
            return {"CANCELLED"}
        if job.state is State.FAILED:
            self.stopped(context, job)
            return report_error(self, context, panel_words(job.error, self.restart_advice))
        self.ended(context, job)
        session(context).last_error = ""
        return {"FINISHED"}

    def stopped(self, context, job):
        """Called after CANCELLED and FAILED: what there is by now may be shown."""

    def taken_away(self, context, job):
        """Called in place of all others where the window closes: nothing is drawn any more."""


def panel_words(message, advice):
    """The tool's message with its advice in the panel's words."""
    head, found, _tail = message.partition("Run with --restart")
    return head.rstrip() + "\n" + translate(advice) if found else message


def progress_text(job):
    """One line: label, frame n of N, time left, memory."""
    parts = [job.label]
    if job.state is State.CANCELLING:
        parts.append(translate("cancelling"))
    snapshot = job.snapshot
    if snapshot.stage:
        parts.append(words.stage(snapshot.stage))
    if snapshot.last_frame:
        parts.append(translate("frame {n} of {total}").format(n=snapshot.frame,
                                                              total=snapshot.last_frame))
    left = jobs.duration_text(job.seconds_left)
    if left:
        parts.append(translate("{time} left").format(time=left))
    if snapshot.memory:
        parts.append(jobs.size_text(snapshot.memory))
    return " · ".join(parts)
