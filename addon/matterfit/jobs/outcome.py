# SPDX-License-Identifier: GPL-3.0-or-later
"""What a job and its backend say of themselves: states, snapshots, outcomes, errors."""

import enum
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
