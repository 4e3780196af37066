# SPDX-License-Identifier: GPL-3.0-or-later
"""What all panels share."""

import textwrap

from .. import jobs


class MatterfitPanel:
    """A part of the one tab in the 3D View's sidebar."""

    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Matterfit"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context):
        return context.scene is not None


def form(layout):
    """A column with Blender's usual label and value split."""
    column = layout.column()
    column.use_property_split = True
    column.use_property_decorate = False
    return column


def lines(layout, text, icon="NONE", width=46):
    """A text as several labels, wrapped: labels do not wrap by themselves."""
    column = layout.column(align=True)
    column.scale_y = 0.8
    first = True
    for paragraph in text.split("\n"):
        for line in textwrap.wrap(paragraph, width) or [""]:
            # Already translated; it must not be looked up again.
            column.label(text=line, icon=icon if first else "NONE", translate=False)
            first = False


def contact(layout, item):
    """The properties of a contact."""
    column = form(layout)
    column.prop(item, "kind")
    if item.kind == "FRICTION":
        column.prop(item, "mu")
    for switch, value in (("use_stiffness", "stiffness"), ("use_damping", "damping")):
        row = column.row(align=True)
        row.prop(item, switch, text="")
        entry = row.row()
        entry.active = getattr(item, switch)
        entry.prop(item, value)


def idle():
    return jobs.registry.running is None
