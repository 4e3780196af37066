# SPDX-License-Identifier: GPL-3.0-or-later
"""Files of Gaussian splats as documents name them."""

from ..jobs import JobError
from . import transforms
from .files import numbers

KINDS = (".ply", ".splat", ".spz")
FLAT = 1e-6  # a box's shortest side, of its longest


def crop(box, up, scale, name, where):
    """{`low`, `high`} in the file's own frame of a box (low, high) [m] that stands in the scene. `up` and
    `scale` as the file has them; `name` is the object's whose box it is."""
    sides = box[1] - box[0]
    if min(sides) <= FLAT * max(sides):
        raise JobError(f"{where}: the crop box '{name}' is flat. Choose an empty or a mesh with a width, depth "
                       "and height.")
    back = transforms.upright(up).conjugated()
    corners = [back @ corner / scale for corner in box]
    return {name: numbers([which(a, b) for a, b in zip(*corners, strict=True)])
            for name, which in (("low", min), ("high", max))}
