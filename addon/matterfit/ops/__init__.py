# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators, one file a part of the panel."""

from . import bodies, capture, compare, effects, fit, materials, output, simulate, takes

CLASSES = (*capture.CLASSES, *bodies.CLASSES, *effects.CLASSES, *simulate.CLASSES, *fit.CLASSES, *materials.CLASSES,
           *compare.CLASSES, *takes.CLASSES, *output.CLASSES)
