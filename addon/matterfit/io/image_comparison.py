# SPDX-License-Identifier: GPL-3.0-or-later
"""What a comparison with images found, as the result in the cache says it, and its overlays."""

import os
import re
from dataclasses import dataclass

from ..jobs import JobError
from . import files

REPORT = "report.json"
OVERLAYS = "overlay"


@dataclass(frozen=True)
class Agreement:
    """Of some images: mean overlap (None where none shows anything), mean distance of outlines [pixels, None
    where none has one], (PSNR [dB], SSIM) of colours (None where none has any that can be compared)."""

    iou: float | None
    contour: float | None
    colours: tuple | None


@dataclass
class ImageComparison:
    """Masks of the simulation against those of one capture: the Agreement of the images that are not held out
    (`seen`) and of those that are (None: there are none), and `frames`, an object an image as the result has
    it."""

    name: str
    seen: Agreement
    held_out: Agreement | None
    frames: list

    def worst(self, count=10):
        """The images that agree least, the worst first; those that show nothing are left out."""
        seen = [frame for frame in self.frames if frame["iou"] is not None]
        return sorted(seen, key=lambda frame: (frame["iou"], frame["frame"]))[:count]


def load(folder, name=""):
    """The comparison with the capture by images `name` ("": the first) in a cache folder; None where
    there is none."""
    try:
        report = files.read_json(os.path.join(folder, REPORT))
        found = [images for images in report.get("compare", {}).get("images", [])
                 if name in ("", images["name"]) and ("iou" in images or images.get("empty"))]
        if not found:
            return None
        images = found[0]
        held_out = images.get("held_out")
        return ImageComparison(images["name"], _agreement(images.get("not_held_out", images)),
                               _agreement(held_out) if held_out else None, images["frames"])
    except (JobError, OSError, ValueError, KeyError, TypeError, AttributeError):
        return None


def _agreement(images):
    images = images or {}
    iou, ratio, likeness = images.get("iou"), images.get("psnr_db"), images.get("ssim")
    return Agreement(None if iou is None else float(iou), images.get("contour_px"),
                     None if ratio is None or likeness is None else (float(ratio), float(likeness)))


def overlays(folder, name):
    """{camera's number: {scene frame: path}} of the overlays of a capture."""
    found = {}
    root = os.path.join(folder, OVERLAYS, name)
    for camera in os.listdir(root) if os.path.isdir(root) else ():
        number = re.fullmatch(r"camera_(\d+)", camera)
        if number is None:
            continue
        of_camera = found.setdefault(int(number[1]), {})
        for file in os.listdir(os.path.join(root, camera)):
            stem, ending = os.path.splitext(file)
            if ending == ".png" and re.fullmatch(r"-?\d+", stem):
                of_camera[int(stem)] = os.path.join(root, camera, file)
    return {number: of_camera for number, of_camera in found.items() if of_camera}
