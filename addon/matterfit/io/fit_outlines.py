# SPDX-License-Identifier: GPL-3.0-or-later
"""How much the outlines of a fit to images overlap those of the recording, as its result says it."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Camera:
    """Mean overlaps of one camera's images after the fit: of those that were fitted and those that were held
    out; None where there are none, or none shows anything."""

    capture: str
    number: int
    fitted: float | None
    held_out: float | None

    @property
    def least(self):
        return min((overlap for overlap in (self.fitted, self.held_out) if overlap is not None), default=1.0)


@dataclass(frozen=True)
class Outlines:
    """Mean overlaps (before, after) of the images that were fitted and of those that were held out; one is None
    where no image shows anything, and the pair where nothing is held out."""

    fitted: tuple | None
    held_out: tuple | None
    cameras: tuple = ()

    def worst(self, count):
        """The cameras that agree least, at most so many, in the order of the recordings."""
        least = sorted(self.cameras, key=lambda camera: camera.least)[:count]
        return [camera for camera in self.cameras if camera in least]


def read(found):
    """The Outlines of the `fit` of a result; None where it saw no images."""
    silhouettes = found.get("silhouettes")
    if not silhouettes:
        return None
    return Outlines(_pair(silhouettes, "fitted"), _pair(silhouettes, "held_out"), tuple(
        Camera(str(entry["capture"]), int(entry["camera"]), _overlap(entry.get("fitted")),
               _overlap(entry.get("held_out"))) for entry in found.get("cameras") or ()))


def percent(overlap):
    return "–" if overlap is None else f"{100.0 * overlap:.1f}"


def _pair(silhouettes, part):
    parts = [(silhouettes.get(when) or {}).get(part) for when in ("before", "after")]
    return tuple(map(_overlap, parts)) if any(parts) else None


def _overlap(agreement):
    overlap = (agreement or {}).get("iou")
    return None if overlap is None else float(overlap)
