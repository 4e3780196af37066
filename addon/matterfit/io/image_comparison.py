# SPDX-License-Identifier: GPL-3.0-or-later
"""What a comparison with images found, as the result in the cache says it, and its overlays."""

import os
import re
from dataclasses import dataclass

from ..jobs import JobError
from . import files

REPORT = "report.json"
OVERLAYS = "overlay"


@dataclass
class ImageComparison:
    """Masks of the simulation against those of one capture: mean overlap (None where no image shows
    anything), mean distance of outlines [pixels, None where none has one], and `frames`, an object an image
    as the result has it. `colours` and `held_out_colours`: (PSNR [dB], SSIM) of the images that are not held
    out and of those that are, None where none has colours that can be compared."""

    name: str
    iou: float | None
    contour: float | None
    frames: list
    colours: tuple | None = None
    held_out_colours: tuple | None = None

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
        iou = images.get("iou")
        return ImageComparison(images["name"], None if iou is None else float(iou), images.get("contour_px"),
                               images["frames"], _colours(images.get("not_held_out", images)),
                               _colours(images.get("held_out", {})))
    except (JobError, OSError, ValueError, KeyError, TypeError, AttributeError):
        return None


def _colours(images):
    ratio, likeness = (images or {}).get("psnr_db"), (images or {}).get("ssim")
    return None if ratio is None or likeness is None else (float(ratio), float(likeness))


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
