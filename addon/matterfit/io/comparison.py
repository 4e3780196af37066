# SPDX-License-Identifier: GPL-3.0-or-later
"""What a comparison found, as its files in the cache say it."""

import os
from dataclasses import dataclass

import numpy

from ..jobs import JobError
from ..props import compare, reactions
from ..props import scene as scene_props
from . import files, image_comparison, takes


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
        self.is_seen = bool(seen.size)
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


def _files(document, name):
    """(compare file, simulated file, capture) of a capture of a job document."""
    captures = [capture for capture in document.get("captures", [])
                if "cameras" not in capture]
    chosen = [capture for capture in captures if name in ("", capture["name"])]
    if not chosen:
        raise JobError(f"Compare: '{name}' was not among the captures. Compare again.")
    end = "" if len(captures) == 1 else "_" + chosen[0]["name"]
    return f"compare{end}.npz", f"simulated{end}.npz", chosen[0]


def load(folder, name=""):
    """The comparison with the capture `name` ("": the first) in a cache folder."""
    document = files.read_json(os.path.join(folder, "job.json"))
    compare_file, simulated_file, capture = _files(document, name)
    path = os.path.join(folder, compare_file)
    try:
        with numpy.load(path, allow_pickle=False) as arrays:
            errors, times = arrays["error_mm"], arrays["times"]
            captured, labels = arrays["captured"], arrays["labels"]
        path = os.path.join(folder, simulated_file)
        with numpy.load(path, allow_pickle=False) as arrays:
            simulated = arrays["positions"]
    except (OSError, ValueError, KeyError) as error:
        raise JobError(f"{path}: could not be read: {error}. Compare again.") from error
    if simulated.shape != captured.shape or errors.shape != captured.shape[:2]:
        raise JobError(f"{path}: has positions of shape {simulated.shape}, the comparison "
                       f"{captured.shape}. Compare again.")
    scene = document["scene"]
    fps = scene["fps"]
    fps = fps[0] / fps[1] if isinstance(fps, list) else float(fps)
    start = float(capture.get("start_frame", scene["frames"][0]))
    return Comparison(start + times * fps, captured, simulated, errors,
                      [str(label) for label in labels])


def stamp(folder):
    """Changes whenever a comparison is written."""
    try:
        return max(os.stat(entry.path).st_mtime_ns for entry in os.scandir(folder)
                   if entry.name.startswith("compare") and entry.name.endswith(".npz"))
    except (OSError, ValueError):
        return 0


def load_quietly(folder, name=""):
    """load(), or None: a drawing handler must not raise."""
    try:
        return load(folder, name)
    except (JobError, OSError, ValueError, KeyError):
        return None


@reactions.comparison_switched.done_by
def show_active(settings):
    """What is known of the active take is shown, against the capture that is active now."""
    take, found, images = scene_props.active_take(settings), None, None
    if take is not None and take.compared and scene_props.active_capture(settings) is not None:
        folder, name = takes.locate(take).folder, scene_props.compared_capture(settings)
        found, images = load_quietly(folder, name), image_comparison.load(folder, name)
    compare.store(settings.compare, found, images)


def show_again(settings):
    """The same in a file that was opened; an older version did not say which take was compared."""
    take = scene_props.active_take(settings)
    if (settings.compare.done or settings.compare.images_done) and take is not None:
        take.compared = True
        show_active(settings)
