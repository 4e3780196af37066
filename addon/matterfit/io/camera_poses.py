# SPDX-License-Identifier: GPL-3.0-or-later
"""How cameras of images stand against what their file says, as a fit has found it: the document's
`poses` of a capture, which keeps them as text in `poses`."""

import json
import math

_NONE = (0.0, 0.0, 0.0)


def text_of(poses):
    """What a capture keeps of a document's `poses`."""
    return json.dumps(poses) if poses else ""


def read(text):
    """The document's `poses`; empty where a capture keeps none, or none that can be read."""
    try:
        found = json.loads(text) if text else []
        largest(found)
    except (ValueError, TypeError, AttributeError):
        return []
    return found


def largest(poses):
    """By how much the cameras that were moved most are: (metres, radians, share of the focal
    length)."""
    return tuple(max(map(size, poses), default=0.0) for size in (
        lambda pose: math.hypot(*pose.get("shift", _NONE)),
        lambda pose: math.hypot(*pose.get("turn", _NONE)),
        lambda pose: abs(pose.get("focal", 0.0))))
