# SPDX-License-Identifier: GPL-3.0-or-later
"""A long computation as a state machine. It drives a backend (native.NativeRun or ThreadRun in the
product, a fake one in tests):

    IDLE -> RUNNING -> DONE | FAILED | CANCELLED
               |-> CANCELLING -> CANCELLED | DONE | FAILED

`tick()` is all the user interface calls; `run()` is the same ticked in a loop, for `blender -b`.
"""

import signal
import threading
import time

from .outcome import ENDED, EXIT_CANCELLED, EXIT_DONE, JobError, Outcome, Snapshot, State


class _CancelsOnSignals:
    """Ctrl-C and SIGTERM cancel the job. Blender has handlers of its own, under which a script
    hears of neither: as it cannot be asked for them, the system's take their place afterwards."""

    SIGNALS = (signal.SIGINT, signal.SIGTERM)

    def __init__(self, job):
        self._job = job
        self._before = {}

    def __enter__(self):
        if threading.current_thread() is threading.main_thread():
            for number in self.SIGNALS:
                self._before[number] = signal.signal(number, lambda *_: self._job.cancel())

    def __exit__(self, *_):
        for number, handler in self._before.items():
            signal.signal(number, signal.SIG_DFL if handler is None else handler)


class Job:
    """One computation. `start` is called once and returns the backend, or raises JobError.

    `resumable`: the operator `resume` goes on from where it is cancelled. `on_end` is called with
    the job when it has ended, however it did, before anybody else sees that.
    """

    def __init__(self, label, start, folder="", clock=time.monotonic, resumable=False,
                 resume="matterfit.resume", on_end=None):
        self.label = label
        self.folder = folder
        self.resumable = resumable
        self.resume = resume
        self.stale = None  # what lies in the folder from before, for those who draw its progress
        self.untouched = False  # it ended, and the folder's results are those from before it
        self.reading = False  # it reads the scene for the job that follows
        self.begun = False  # it was counted and found to fit into memory (ops.launch.start_job)
        self.state = State.IDLE
        self.snapshot = Snapshot()
        self.result = {}
        self.error = ""
        self.status = EXIT_DONE
        self._start = start
        self._on_end = on_end
        self._backend = None
        self._clock = clock
        self._began = 0.0
        self._ended = 0.0
        self._first_fraction = None
        self._first_fraction_at = 0.0

    # -- transitions ---------------------------------------------------------------------------

    def start(self):
        if self.state is not State.IDLE:
            raise RuntimeError(f"job '{self.label}' was started before (state {self.state.value})")
        self._began = self._clock()
        try:
            self._backend = self._start()
        except JobError as error:
            self._end(State.FAILED, Outcome(error.status, {}, str(error)))
            return self
        self.state = State.RUNNING
        return self

    def tick(self):
        """Poll once. True if something changed that a panel would draw."""
        if self.state not in (State.RUNNING, State.CANCELLING):
            return False
        snapshot = self._backend.poll()
        changed = snapshot != self.snapshot
        self.snapshot = snapshot
        if self._first_fraction is None and snapshot.fraction > 0.0:
            # A resumed run starts far from zero: the rate counts from what was seen first.
            self._first_fraction = snapshot.fraction
            self._first_fraction_at = self._clock()
        if snapshot.finished:
            self._collect()
            changed = True
        return changed

    def cancel(self):
        """Ask the backend to stop; it answers within a second. Harmless when not running."""
        if self.state is State.RUNNING:
            self._backend.cancel()
            self.state = State.CANCELLING
        elif self.state is State.IDLE:
            self._end(State.CANCELLED, Outcome(EXIT_CANCELLED))

    def join(self):
        """Wait for the backend to end and collect its outcome."""
        if self.state in (State.RUNNING, State.CANCELLING):
            self._backend.wait()
            self.snapshot = self._backend.poll()
            self._collect()
        return self

    def run(self, on_tick=None, interval=0.1, sleep=time.sleep):
        """Start (where that is still to do), poll until the end, return self. Ctrl-C and SIGTERM
        cancel."""
        with _CancelsOnSignals(self):
            if self.state is State.IDLE:
                self.start()
            while self.state not in ENDED:
                if self.tick() and on_tick is not None:
                    on_tick(self)
                if self.state not in ENDED:
                    sleep(interval)
        return self

    # -- what panels show ----------------------------------------------------------------------

    @property
    def ended(self):
        return self.state in ENDED

    @property
    def fraction(self):
        return min(max(self.snapshot.fraction, 0.0), 1.0)

    @property
    def elapsed(self):
        """Seconds since start()."""
        if self.state is State.IDLE:
            return 0.0
        return (self._ended if self.ended else self._clock()) - self._began

    @property
    def seconds_left(self):
        """Seconds to the end at the mean rate so far; None before anything is known."""
        if self._first_fraction is None or self.ended:
            return None
        gained = self.fraction - self._first_fraction
        spent = self._clock() - self._first_fraction_at
        if gained <= 0.0 or spent <= 0.0:
            return None
        return (1.0 - self.fraction) * spent / gained

    # -- inside --------------------------------------------------------------------------------

    def _collect(self):
        outcome = self._backend.outcome()
        if outcome.status == EXIT_DONE:
            state = State.DONE
        elif outcome.status == EXIT_CANCELLED:
            state = State.CANCELLED
        else:
            state = State.FAILED
        self._backend.free()
        self._backend = None
        self._end(state, outcome)

    def _end(self, state, outcome):
        self.state = state
        self.status = outcome.status
        self.result = outcome.result
        self.error = outcome.error
        self._ended = self._clock()
        if self._on_end is not None:
            self._on_end(self)
