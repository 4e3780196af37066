# SPDX-License-Identifier: GPL-3.0-or-later
"""A long computation as a state machine. No Blender and no native library in here.

A `Job` drives a backend (native.NativeRun or ThreadRun in the product, a fake one in tests):

    IDLE -> RUNNING -> DONE | FAILED | CANCELLED
               |-> CANCELLING -> CANCELLED | DONE | FAILED

`tick()` is all the user interface calls; `run()` is the same ticked in a loop, for `blender -b`.
"""

import enum
import signal
import threading
import time
from dataclasses import dataclass, field


class State(enum.Enum):
    IDLE = "idle"
    RUNNING = "running"
    CANCELLING = "cancelling"
    DONE = "done"
    CANCELLED = "cancelled"
    FAILED = "failed"


ENDED = frozenset({State.DONE, State.CANCELLED, State.FAILED})

EXIT_DONE = 0
EXIT_INPUT = 2
EXIT_COMPUTE = 3
EXIT_CANCELLED = 130


class JobError(Exception):
    """Something the user can act on; `status` is the tool's exit status for it."""

    def __init__(self, message, status=EXIT_INPUT):
        super().__init__(message)
        self.status = status


@dataclass(frozen=True)
class Snapshot:
    """What a backend says at one poll. Frames are scene frames; memory in bytes."""

    finished: bool = False
    fraction: float = 0.0
    stage: str = ""
    frame: int = 0
    last_frame: int = 0
    memory: int = 0


@dataclass(frozen=True)
class Outcome:
    """How a backend ended: the tool's exit status, its JSON result, its error message."""

    status: int = EXIT_DONE
    result: dict = field(default_factory=dict)
    error: str = ""


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


class Registry:
    """The jobs of this process: at most one at a time is shown, all of them can be stopped."""

    def __init__(self):
        self._jobs = []

    def add(self, job):
        self._jobs = [other for other in self._jobs if not other.ended]
        self._jobs.append(job)
        return job

    @property
    def current(self):
        """The newest job, ended or not; None where there never was one."""
        return self._jobs[-1] if self._jobs else None

    @property
    def running(self):
        """The newest job that has not ended, or None."""
        for job in reversed(self._jobs):
            if job.state in (State.RUNNING, State.CANCELLING):
                return job
        return None

    def stop_all(self):
        """Cancel every job and wait for it: before another file opens or the add-on goes."""
        jobs = [job for job in self._jobs if not job.ended]
        for job in jobs:
            job.cancel()
        for job in jobs:
            job.join()
        self._jobs = []


registry = Registry()


def duration_text(seconds):
    """3 s, 2 min 5 s, 1 h 4 min."""
    if seconds is None:
        return ""
    seconds = int(round(max(seconds, 0.0)))
    if seconds < 60:
        return f"{seconds} s"
    if seconds < 3600:
        return f"{seconds // 60} min {seconds % 60} s"
    return f"{seconds // 3600} h {seconds % 3600 // 60} min"


def size_text(size):
    """Bytes as 512 B, 3.2 kB, 1.5 MB, 2.0 GB (powers of 1000, as Memory Limit has them)."""
    if size < 1000:
        return f"{int(size)} B"
    for unit in ("kB", "MB", "GB"):
        size /= 1000.0
        if size < 1000.0 or unit == "GB":
            return f"{size:.1f} {unit}"
    raise AssertionError("unreachable")
