# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether a property of the scene is animated."""


def animated(scene, data_path):
    """True where a curve or a driver may change the property at `data_path`."""
    animation = scene.animation_data
    if animation is None:
        return False
    if any(driver.data_path == data_path for driver in animation.drivers):
        return True
    # Actions have layers from 4.4 on, and lose `fcurves` with 5.0: animated, then, is any action.
    action = animation.action
    if action is None:
        return False
    curves = getattr(action, "fcurves", None)
    return True if curves is None else any(curve.data_path == data_path for curve in curves)
