# SPDX-License-Identifier: GPL-3.0-or-later
"""What all panels share."""

import re

import bpy

from .. import quantities
from ..compat import translate
from . import drawing

DEFAULT_WIDTH = 220.0  # of the sidebar [pixels]
TABS = 20.0  # of it, that the tabs at its edge take [pixels]
EDGES = 46.0  # of it, that the panel's edges and a label's own take
ICON = 20.0  # before a label
BOX = 12.0  # of it, that the edges of a box take


_UNITS = (r"s|min|h|%|px|[kMG]?B|[kM]?Hz|[nµmck]?m(?:/s²?)?|rad/s|[mk]?g(?:/m³)?|[mk]?N(?:/m)?|"
          r"[mkMG]?Pa(?:/m| s)?")
_WORD = re.compile(rf"[^\s]*\d (?:{_UNITS})(?![^\s.,;:)])[.,;:)]*|\S+")


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


def lines(layout, text, icon="NONE", taken=0.0):
    """A text as several labels, wrapped to the sidebar: labels do not wrap by themselves. `taken`
    [pixels] is for what stands beside them or around them (BOX)."""
    region = bpy.context.region
    scale = bpy.context.preferences.system.ui_scale
    room = region.width / scale if region is not None else DEFAULT_WIDTH
    width = max(room - TABS - EDGES - taken - (ICON if icon != "NONE" else 0.0), 80.0)
    column = layout.column(align=True)
    column.scale_y = 0.8
    first = True
    for paragraph in text.split("\n"):
        for line in wrapped(paragraph, width):
            # Already translated; it must not be looked up again.
            column.label(text=line, icon=icon if first or icon == "NONE" else "BLANK1", translate=False)
            first = False


def wrapped(paragraph, width):
    """The lines of a paragraph that are at most `width` pixels wide; a number and its unit stay on one,
    longer words are broken."""
    found, line = [], ""
    for word in _WORD.findall(paragraph):
        longer = f"{line} {word}" if line else word
        if _width(longer) <= width:
            line = longer
            continue
        if line:
            found.append(line)
        while _width(word) > width:
            part = next(n for n in range(len(word) - 1, 0, -1) if n == 1 or _width(word[:n]) <= width)
            found.append(word[:part])
            word = word[part:]
        line = word
    return [*found, line] if line or not found else found


def _width(text):
    """The width of a label [pixels]; a Blender without a window may have no font to ask."""
    return drawing.text_width(text, 1.0) or 6.6 * len(text)


def menu(column, item, name):
    """A menu whose choices need the whole width; its label stands above it."""
    part = column.column(align=True)
    part.use_property_split = False
    part.label(text=item.bl_rna.properties[name].name)
    part.prop(item, name, text="")


def quantity(column, item, key):
    """The number of quantities.py that `item` has by that key's last word."""
    row = quantities.find(key)
    column.prop(item, row.name, text=row.caption)


def switched(column, item, switch, value, heading=""):
    """A value with the switch that makes it count, called like the switch without a `heading`."""
    row = column.row(align=True, heading=heading or item.bl_rna.properties[switch].name)
    row.prop(item, switch, text="")
    entry = row.row(align=True)
    entry.active = getattr(item, switch)
    entry.prop(item, value, text="")


def contact(layout, item):
    """The properties of a contact."""
    column = form(layout)
    column.prop(item, "kind")
    if item.kind == "FRICTION":
        quantity(column, item, "contact.mu")
    switched(column, item, "use_stiffness", "stiffness", quantities.STIFFNESS.caption)
    switched(column, item, "use_damping", "damping")


def holdout(column, capture):
    """What of a capture is kept for testing."""
    images = capture.source == "IMAGES"
    # One of another source may be held out whole, which images are not.
    column.prop(capture, "holdout_of_images" if images and capture.holdout != "CAPTURE" else "holdout")
    if capture.holds_out_frames:
        column.prop(capture, "holdout_start")
    if capture.holds_out_tracks:
        column.prop(capture, "holdout_tracks", text="Cameras" if images else "Points")
    if capture.holdout == "CAPTURE" and images:
        lines(column, translate("Images are held out by frames or by cameras."), icon="ERROR")
