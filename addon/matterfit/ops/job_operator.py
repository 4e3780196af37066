# SPDX-License-Identifier: GPL-3.0-or-later
"""The operator of a long job, modal or blocking."""

import contextlib
import inspect
import time
import traceback

import bpy

from .. import jobs
from ..compat import translate, translate_label
from ..io import still_there, words
from ..jobs import EXIT_DONE, JobError, State
from .base import NoJobRunning, push_undo, redraw, report_error, session, status_text

INTERVAL = 0.1
REST = 3.0  # times as long as showing a frame took, the window is left alone after it
HEAD_START = 0.3  # [s] that begin() may take before the window looks up

# The operators that run modally: Blender names them nowhere.
_modal = []


def forget_said(context):
    """What was said of the run before is not of the one that begins."""
    session(context).last_error = session(context).last_report = ""


def cancel_modal_operators(context):
    """Ends what runs modally, with its timer, its progress cursor and its text in the status bar:
    Blender frees such operators with their classes and calls no cancel()."""
    for operator in list(_modal):
        operator.cancel(context)


class JobOperator(NoJobRunning):
    """A long job. `execute()` blocks and is the truth; the modal side polls the same job.

    A subclass has `begin(context)`, which returns a jobs.Job not yet started, and may be a generator that
    yields Snapshots until it does (launch.preparing): then the window looks up in between; `progressed(context,
    job)`, called whenever `progress_mark(context, job)` has changed: when more frames are done; and
    `ended(context, job)`, called when it is DONE, whose changes make the one undo step.
    """

    # Not REGISTER: Repeat Last would run it again without a question.
    bl_options = {"UNDO"}
    _timer = None
    _job = None
    _steps = None  # while begin() goes on: its jobs.StepRun
    _mark_shown = None
    _rests_until = 0.0  # by time.monotonic()
    # Panel's words in place of the tool's advice to run with --restart.
    restart_advice = "Press Bake, and choose a new take or this one."

    def progress_mark(self, context, job):
        return job.snapshot.frame

    def progressed(self, context, job):
        pass

    def ended(self, context, job):
        pass

    def begin_in_steps(self, context):
        """begin(), as a generator also where it is none."""
        found = self.begin(context)
        return (yield from found) if inspect.isgenerator(found) else found

    def execute(self, context):
        forget_said(context)
        try:
            job = jobs.registry.add(jobs.drained(self.begin_in_steps(context)))
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
        forget_said(context)
        steps = jobs.StepRun(self.begin_in_steps(context), still_there.watch, translate(
            "{name}: while the scene was read, an object or a row was removed, a row was added, another "
            "scene was shown, or Undo was pressed. Press it again.").format(name=translate_label(self.bl_label)))
        outcome = steps.head_start(HEAD_START)
        if outcome is None:
            self._steps = steps
            self._job = jobs.registry.add(jobs.Job(translate_label(self.bl_label), lambda: steps))
            self._job.reading = True
            self._job.start()
        elif outcome.status != EXIT_DONE:
            return report_error(self, context, outcome.error)
        else:
            self._start(context, steps.value)
        manager = context.window_manager
        manager.progress_begin(0.0, 100.0)
        self._timer = manager.event_timer_add(INTERVAL, window=context.window)
        manager.modal_handler_add(self)
        _modal.append(self)
        return {"RUNNING_MODAL"}

    def _start(self, context, job):
        """What was begun is a job now."""
        self._job = jobs.registry.add(job)
        # The take's folder is a step of its own: undoing the result keeps track of the cache.
        self._push_undo()
        self._job.start()
        self._mark_shown = None

    def modal(self, context, event):
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        job = self._job
        if job.tick():
            self._tick(context, job)
        redraw(context)  # time left moves between ticks too
        if job.ended and self._steps is not None:
            return self._begun(context, job)
        if not job.ended:
            return {"PASS_THROUGH"}
        self._remove_timer(context)
        return self._finish(context, job)

    def _begun(self, context, job):
        """The scene is read, or that was stopped."""
        steps, self._steps = self._steps, None
        if job.state is State.DONE:
            self._start(context, steps.value)
            return {"PASS_THROUGH"}
        self._remove_timer(context)
        redraw(context)
        if job.state is State.FAILED:
            return report_error(self, context, job.error)
        self.report({"WARNING"}, translate("Cancelled: {name}").format(name=job.label))
        return {"CANCELLED"}

    def cancel(self, context):
        """Blender takes the operator away: a file is loaded, or the window closes."""
        if self._job is not None:
            self._job.cancel()
            self._job.join()
            if self._steps is None:
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
        if self._steps is not None:
            return
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
    parts += _place(job.snapshot)
    left = jobs.duration_text(job.seconds_left)
    if left:
        parts.append(translate("{time} left").format(time=left))
    if job.snapshot.memory:
        parts.append(memory_text(job.snapshot))
    return " · ".join(parts)


def cancelled_text(job):
    """What Status says of a job that was cancelled: where it stopped."""
    return " · ".join([translate("Cancelled: {name}").format(name=job.label), *_place(job.snapshot)])


def memory_text(snapshot):
    """The library measures the process, of which the scene and the window take a part: an estimate has
    the job's own share."""
    return translate("Blender uses {size}").format(size=jobs.size_text(snapshot.memory))


def _place(snapshot):
    """What is done, and at which frame."""
    parts = [words.stage(snapshot.stage)] if snapshot.stage else []
    if snapshot.last_frame:
        parts.append(translate("frame {n} of {total}").format(n=snapshot.frame, total=snapshot.last_frame))
    return parts
