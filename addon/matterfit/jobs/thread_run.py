# SPDX-License-Identifier: GPL-3.0-or-later
"""A backend for calls of the library that neither report progress nor can be interrupted."""

import threading

from .outcome import (
    EXIT_CANCELLED,
    EXIT_COMPUTE,
    EXIT_DONE,
    JobError,
    Outcome,
    Snapshot,
)


class ThreadRun:
    """A backend for one call that cannot be interrupted: it runs in a thread, and returns the
    result as a dictionary or raises JobError. Cancel leaves it to run out unheard."""

    def __init__(self, function, stage=""):
        self._stage = stage
        self._outcome = Outcome(EXIT_CANCELLED)
        self._cancelled = False
        self._thread = threading.Thread(target=self._work, args=(function,), daemon=True)
        self._thread.start()

    def _work(self, function):
        try:
            self._outcome = Outcome(EXIT_DONE, function())
        except JobError as error:
            self._outcome = Outcome(error.status, {}, str(error))
        except Exception as error:  # in a thread it would be printed and lost
            self._outcome = Outcome(EXIT_COMPUTE, {}, f"{type(error).__name__}: {error}")

    def poll(self):
        return Snapshot(finished=self._cancelled or not self._thread.is_alive(),
                        stage=self._stage)

    def cancel(self):
        self._cancelled = True

    def wait(self):
        if not self._cancelled:
            self._thread.join()

    def outcome(self):
        return Outcome(EXIT_CANCELLED) if self._cancelled else self._outcome

    def free(self):
        pass
