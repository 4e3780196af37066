# SPDX-License-Identifier: GPL-3.0-or-later
"""A backend for what only the thread that polls may do, in slices between its looks at the window."""

import time
import traceback
from dataclasses import replace

from .outcome import EXIT_CANCELLED, EXIT_COMPUTE, EXIT_INPUT, JobError, Outcome, Snapshot


def drained(steps):
    """What a generator returns, without a break."""
    while True:
        try:
            next(steps)
        except StopIteration as end:
            return end.value


class StepRun:
    """Runs a generator that yields Snapshots; what it returns is `value`. Cancel raises JobError in it.

    `watch()`, called after each slice, returns a function that says before the next one whether all that
    it holds is there still. Where not, it is closed where it stands, and the run ends with the message
    `gone`.
    """

    def __init__(self, steps, watch, gone):
        self.value = None
        self._steps = steps
        self._watch = watch
        self._valid = lambda: True
        self._gone = gone
        self._cancelled = False
        self._outcome = None
        self._last = Snapshot()

    def head_start(self, seconds):
        """Most has little to do: slices until that time is over. Returns the outcome, or None."""
        end = time.monotonic() + seconds
        while self._outcome is None and time.monotonic() < end:
            self._go_on()
        return self._outcome

    def poll(self):
        if self._outcome is None:
            self._go_on()
        return replace(self._last, finished=self._outcome is not None)

    def cancel(self):
        self._cancelled = True

    def wait(self):
        while self._outcome is None:
            self._go_on()

    def outcome(self):
        return self._outcome

    def free(self):
        pass

    def _go_on(self):
        try:
            if not self._valid():
                self._steps.close()
                self._outcome = Outcome(EXIT_INPUT, {}, self._gone)
            elif self._cancelled:
                self._steps.throw(JobError("", EXIT_CANCELLED))
            else:
                self._last = next(self._steps)
                self._valid = self._watch()
        except StopIteration as end:
            self.value = end.value
            self._outcome = Outcome()
        except JobError as error:
            self._outcome = Outcome(error.status, {}, str(error))
        except Exception as error:  # raised in a timer it would be printed, and come again
            traceback.print_exc()
            self._outcome = Outcome(EXIT_COMPUTE, {}, f"{type(error).__name__}: {error}")
