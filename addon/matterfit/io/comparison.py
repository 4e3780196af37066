# SPDX-License-Identifier: GPL-3.0-or-later
"""What a comparison found, as its files in the cache say it."""

import os
from dataclasses import dataclass

import numpy

from ..jobs import JobError

FILE = "comparison.npz"


@dataclass
class Comparison:
    """Captured and simulated places of the same points at the same times.

    frames (T,) scene frames; captured, simulated (T, N, 3) [m], world; errors (T, N) [mm], NaN
    where a point was not seen.
    """

    frames: numpy.ndarray
    captured: numpy.ndarray
    simulated: numpy.ndarray
    errors: numpy.ndarray
    labels: list

    def __post_init__(self):
        seen = self.errors[numpy.isfinite(self.errors)]
        self.mean = float(seen.mean()) if seen.size else 0.0
        self.percentile95 = float(numpy.percentile(seen, 95.0)) if seen.size else 0.0
        count = numpy.isfinite(self.errors).sum(axis=1)
        total = numpy.nansum(self.errors, axis=1)
        with numpy.errstate(invalid="ignore", divide="ignore"):
            self.means = numpy.where(count > 0, total / count, numpy.nan)
        filled = numpy.where(numpy.isfinite(self.errors), self.errors, -1.0)
        largest = filled.max(axis=1) if self.errors.shape[1] else numpy.full(len(count), -1.0)
        self.largest = numpy.where(largest >= 0.0, largest, numpy.nan)

    def row_at(self, frame):
        """Index of the sample nearest to a scene frame; None further away than one frame."""
        row = int(numpy.argmin(numpy.abs(self.frames - frame)))
        return row if abs(self.frames[row] - frame) <= 1.0 else None

    def worst(self, count=10):
        """[(scene frame, mean, largest)] of the worst scene frames, the worst first."""
        best = {}
        for frame, mean, largest in zip(self.frames, self.means, self.largest, strict=False):
            whole = int(round(float(frame)))
            if numpy.isfinite(mean) and mean > best.get(whole, (-1.0, 0.0))[0]:
                best[whole] = (float(mean), float(largest))
        order = sorted(best, key=lambda frame: (-best[frame][0], frame))
        return [(frame, *best[frame]) for frame in order[:count]]


def stamp(folder):
    try:
        return os.stat(os.path.join(folder, FILE)).st_mtime_ns
    except OSError:
        return 0


def load_quietly(folder):
    """load(), or None: a drawing handler must not raise."""
    try:
        return load(folder)
    except (JobError, OSError, ValueError, KeyError):
        return None
