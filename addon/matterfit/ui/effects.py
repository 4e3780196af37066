# SPDX-License-Identifier: GPL-3.0-or-later
import bpy

from .. import effects
from ..props import scene as scene_props
from .common import MatterfitPanel, form, menu

# Short labels for the narrow column, which tooltips explain with their units; parameters that are not
# listed keep their full names.
_CAPTIONS = {"drag_coefficient": "Coeff.", "area": "Area", "air_density": "Density",
             "medium_density": "Density", "velocity": "Wind", "acceleration": "Accel.",
             "strength": "Accel.", "frequency": "Freq.", "modulus": "Added", "nu": "Poisson's",
             "slope": "Slope"}


def _caption(effect, key):
    return _CAPTIONS.get(key, effect.bl_rna.properties[key].name)


class MATTERFIT_UL_effects(bpy.types.UIList):
    def draw_item(self, _context, layout, _data, item, _icon, _active, _name, _index=0):
        row = layout.row(align=True)
        row.prop(item, "name", text="", emboss=False, icon=effects.find(item.kind).icon)
        row.prop(item, "enabled", text="")


class MATTERFIT_PT_effects(MatterfitPanel, bpy.types.Panel):
    bl_label = "Effects"
    bl_parent_id = "MATTERFIT_PT_solver"

    def draw(self, context):
        layout = self.layout
        settings = context.scene.matterfit
        row = layout.row()
        row.template_list("MATTERFIT_UL_effects", "", settings, "effects", settings, "effect_index",
                          rows=2)
        column = row.column(align=True)
        column.operator_menu_enum("matterfit.add_effect", "kind", text="", icon="ADD")
        column.operator("matterfit.remove_effect", text="", icon="REMOVE")
        effect = scene_props.active_item(settings.effects, settings.effect_index)
        if effect is None:
            return
        kind = effects.find(effect.kind)
        column = form(layout)
        column.use_property_decorate = bool(kind.keyed)
        column.active = effect.enabled
        menu(column, effect, "kind")
        column.prop_search(effect, "body", settings, "bodies")
        if kind.has_place:
            column.prop(effect, "place")
        for key in kind.numbers:
            if key not in effects.PLACED or effect.place is None:
                column.prop(effect, key, text=_caption(effect, key))


CLASSES = (MATTERFIT_UL_effects, MATTERFIT_PT_effects)
