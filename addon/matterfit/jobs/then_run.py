# SPDX-License-Identifier: GPL-3.0-or-later
"""A backend of two parts, one after the other."""

from dataclasses import replace

from .outcome import EXIT_CANCELLED, EXIT_COMPUTE, JobError, Outcome, Snapshot


class ThenRun:
    """Runs the backend `first`. When that has ended, `go_on(outcome)` says what comes next: a
    backend, or None where its outcome is that of the whole; it may raise JobError, which ends the
    run. It is called in the thread that polls, and not after Cancel. The bar is that of what comes
    next.
    """

    def __init__(self, first, go_on):
        self._backend = first
        self._go_on = go_on
        self._cancelled = False
        self._outcome = None  # of the whole, once it is known
        self._last = Snapshot()

    def poll(self):
        if self._outcome is not None:
            return replace(self._last, finished=True)
        snapshot = self._backend.poll()
        fraction = snapshot.fraction if self._go_on is None else 0.0
        if snapshot.finished:
            self._ended()
        self._last = replace(snapshot, fraction=fraction, finished=self._outcome is not None)
        return self._last

    def cancel(self):
        self._cancelled = True
        if self._backend is not None:
            self._backend.cancel()

    def wait(self):
        while self._outcome is None:
            self._backend.wait()
            self._ended()

    def outcome(self):
        return self._outcome

    def free(self):
        if self._backend is not None:
            self._backend.free()
            self._backend = None

    def _ended(self):
        """The backend has ended: the next one takes its place, or the outcome is known."""
        outcome, go_on = self._backend.outcome(), self._go_on
        self._go_on = None
        self.free()
        if go_on is None or outcome.status == EXIT_CANCELLED:
            self._outcome = outcome
        elif self._cancelled:
            self._outcome = Outcome(EXIT_CANCELLED)
        else:
            try:
                self._backend = go_on(outcome)
            except JobError as error:
                self._outcome = Outcome(error.status, {}, str(error))
            except Exception as error:  # raised in a timer it would be printed, and come again
                self._outcome = Outcome(EXIT_COMPUTE, {}, f"{type(error).__name__}: {error}")
            else:
                self._outcome = outcome if self._backend is None else None
