# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether bodies of a job document may lie in each other, told by their boxes."""

import os

import numpy
from mathutils import Quaternion


def may_overlap(document, folder):
    """Whether the boxes [m, world axes] of any two bodies meet; `folder` holds the inputs. A body
    whose shape is no mesh has no known box and meets every other. OSError where an input is gone."""
    boxes = [_box(body, folder) for body in document["scene"]["bodies"]]
    return any(_meet(first, second) for place, first in enumerate(boxes)
               for second in boxes[place + 1:])


def _box(body, folder):
    """(low, high), (3,) each, of the body where it starts; None where that is not known."""
    path = body["source"].get("mesh") or body["source"].get("cage")
    if path is None:
        return None
    with numpy.load(os.path.join(folder, path)) as arrays:
        vertices = arrays["vertices"].astype(numpy.float64)
    placement = body.get("placement", {})
    turn = numpy.array(Quaternion(placement.get("rotation", (1.0, 0.0, 0.0, 0.0))).to_matrix())
    points = vertices @ turn.T + numpy.array(placement.get("position", (0.0, 0.0, 0.0)))
    return points.min(axis=0), points.max(axis=0)


def _meet(first, second):
    """Boxes that only touch, but for rounding, do not meet."""
    if first is None or second is None:
        return True
    depth = numpy.minimum(first[1], second[1]) - numpy.maximum(first[0], second[0])
    return bool((depth > 1e-5 * numpy.max(first[1] - first[0])).all())
