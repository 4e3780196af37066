# SPDX-License-Identifier: GPL-3.0-or-later
"""Captures by images, as the job document has them."""

from ..jobs import JobError
from . import job_captures
from .files import number, numbers


def reading_options(capture):
    """What the reader is told: unit, up axis, rate, colour key."""
    document = job_captures.reading_options(capture)
    document.pop("markers", None)
    if capture.use_key:
        document["key"] = {"colour": numbers(capture.key)}
    return document


def camera_numbers(text, where):
    found = [name.strip() for name in text.split(",") if name.strip()]
    if not found or not all(name.isdecimal() for name in found):
        raise JobError(f"{where}: no camera is named to be held out. Give their numbers, separated "
                       "by commas, or choose another Hold-out.")
    return [int(name) for name in found]


class ImagePart:
    """One capture while the document is written."""

    def __init__(self, writer, capture):
        self.writer = writer
        self.capture = capture
        self.where = f"capture '{capture.name}'"

    def document(self):
        capture, writer = self.capture, self.writer
        found = {"name": capture.name, "cameras": writer.external(capture.filepath, self.where)}
        found.update(reading_options(capture))
        if capture.body:
            found["body"] = capture.body
        transform = job_captures.placement(capture, writer.scale)
        if transform is not None:
            found["transform"] = transform
        if capture.use_start_frame:
            found["start_frame"] = number(capture.start_frame)
        if capture.use_noise:
            found["noise"] = number(capture.noise_pixels)
        holdout = self._holdout()
        if holdout:
            found["holdout"] = holdout
        return found

    def _holdout(self):
        capture, writer = self.capture, self.writer
        if capture.holdout == "FRAMES":
            if capture.holdout_start >= writer.end:
                raise JobError(f"{self.where}: the hold-out starts at frame "
                               f"{capture.holdout_start}, after the last frame {writer.end - 1}.")
            return {"frames": [capture.holdout_start, writer.end]}
        if capture.holdout == "TRACKS":
            return {"cameras": camera_numbers(capture.holdout_tracks, self.where)}
        if capture.holdout == "CAPTURE":
            raise JobError(f"{self.where}: images are held out by frames or by cameras. Choose "
                           "Last Frames, or Points and name cameras.")
        return None
