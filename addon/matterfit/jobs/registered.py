# SPDX-License-Identifier: GPL-3.0-or-later
"""The jobs of this process."""

from .outcome import State


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
