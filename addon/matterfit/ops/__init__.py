# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators, one file a part of the panel."""

from . import (
               batch,
               bodies,
               caches,
               capture,
               check,
               compare,
               diagnose,
               effects,
               fit,
               images,
               materials,
               output,
               preview_extended,
               render_take,
               simulate,
               splats,
               takes,
)

CLASSES = (*capture.CLASSES, *images.CLASSES, *splats.CLASSES, *bodies.CLASSES, *effects.CLASSES, *simulate.CLASSES,
           *caches.CLASSES, *check.CLASSES, *fit.CLASSES, *materials.CLASSES,
           *compare.CLASSES, *diagnose.CLASSES, *preview_extended.CLASSES,
           *takes.CLASSES, *output.CLASSES, *render_take.CLASSES, *batch.CLASSES)
