# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators, one file a part of the panel."""

from . import bodies, caches, capture, compare, fit, materials, output, simulate, takes

CLASSES = (*capture.CLASSES, *bodies.CLASSES, *simulate.CLASSES, *caches.CLASSES, *fit.CLASSES, *materials.CLASSES,
           *compare.CLASSES, *takes.CLASSES, *output.CLASSES)
