# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender properties: what a .blend file stores of us."""

import bpy

from . import batch, body, capture, compare, diagnosis, effects, fit, material, scene, solver, take

CLASSES = (*material.CLASSES, *body.CLASSES, *capture.CLASSES, *take.CLASSES, *batch.CLASSES,
           *solver.CLASSES, *effects.CLASSES, *compare.CLASSES, *diagnosis.CLASSES, *fit.CLASSES, *scene.CLASSES)


def attach():
    bpy.types.Scene.matterfit = bpy.props.PointerProperty(type=scene.MatterfitScene)
    bpy.types.WindowManager.matterfit = bpy.props.PointerProperty(type=scene.MatterfitSession)


def detach():
    del bpy.types.WindowManager.matterfit
    del bpy.types.Scene.matterfit
