# SPDX-License-Identifier: GPL-3.0-or-later
"""Long computations. No Blender and no native library in here."""

from .job import Job
from .outcome import (
    ENDED,
    EXIT_CANCELLED,
    EXIT_COMPUTE,
    EXIT_DONE,
    EXIT_INPUT,
    JobError,
    Outcome,
    Snapshot,
    State,
)
from .registered import Registry, registry
from .step_run import StepRun, drained
from .text import duration_text, size_text
from .then_run import ThenRun
from .thread_run import ThreadRun

__all__ = [
    "ENDED", "EXIT_CANCELLED", "EXIT_COMPUTE", "EXIT_DONE", "EXIT_INPUT", "Job", "JobError",
    "Outcome", "Registry", "Snapshot", "State", "StepRun", "ThenRun", "ThreadRun", "drained",
    "duration_text", "registry", "size_text",
]
