# SPDX-License-Identifier: GPL-3.0-or-later
"""Panels, one file a part of the tab, and what is drawn in the viewport."""

from . import (
               batch,
               bodies,
               capture,
               check,
               compare,
               diagnose,
               effects,
               fit,
               fit_result,
               keys,
               output,
               overlay,
               rerun,
               simulate,
               solver,
               status,
)

CLASSES = (*status.CLASSES, *capture.CLASSES, *bodies.CLASSES, *solver.CLASSES, *effects.CLASSES,
           *simulate.CLASSES, *fit.CLASSES, *check.CLASSES,
           *fit_result.CLASSES, *compare.CLASSES, *diagnose.CLASSES,
           *rerun.CLASSES, *output.CLASSES, *batch.CLASSES)


def register():
    overlay.register()
    keys.register()


def unregister():
    keys.unregister()
    overlay.unregister()
