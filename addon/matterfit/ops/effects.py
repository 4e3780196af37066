# SPDX-License-Identifier: GPL-3.0-or-later
"""The list of effects."""

import bpy

from .. import effects
from ..props import scene as scene_props
from .base import PlainOperator, greyed, remove_active


class MATTERFIT_OT_add_effect(PlainOperator, bpy.types.Operator):
    bl_idname = "matterfit.add_effect"
    bl_label = "Add Effect"
    bl_description = "An effect on all bodies: drag, wind, a force field and others"

    kind: bpy.props.EnumProperty(
        name="Kind", default="WIND",
        items=[(kind.identifier, kind.title, kind.about, kind.icon, index)
               for index, kind in enumerate(effects.KINDS)],
        description="What the effect does")

    def act(self, context):
        settings = context.scene.matterfit
        settings.effects.add().kind = self.kind  # which names it
        settings.effect_index = len(settings.effects) - 1


class MATTERFIT_OT_remove_effect(PlainOperator, bpy.types.Operator):
    bl_idname = "matterfit.remove_effect"
    bl_label = "Remove Effect"
    bl_description = "Remove the active effect; Enabled only switches it off"

    @classmethod
    def poll(cls, context):
        settings = context.scene.matterfit
        none = scene_props.active_item(settings.effects, settings.effect_index) is None
        return greyed(cls, none, "There is no effect")

    def act(self, context):
        remove_active(context.scene.matterfit, "effects", "effect_index")


CLASSES = (MATTERFIT_OT_add_effect, MATTERFIT_OT_remove_effect)
