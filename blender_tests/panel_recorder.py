# SPDX-License-Identifier: GPL-3.0-or-later
"""A layout that draws nothing and measures every text against the room that Blender gives it in the
sidebar at its default width: of 220 pixels the tabs, which are there in every Blender, take 20, and
panels use 173.

The limits were read off pictures of Blender 3.4: in a split row 40 % are the label's; a text is cut
where it is wider than its part less the widget's margins.
"""

import blf
import bpy

SIDEBAR = 173.0
ICON = 20.0  # also what the dot of a property takes that can be keyed
MARGIN = 10.0
MENU = 30.0  # what a menu takes beside the name of its choice
FIELD = 45.0  # what a field with name and value takes beside both
LIST = 12.0  # the edges of a list
SCROLL = 18.0  # its bar, where it has more rows than it shows
# Lists of numbers; others show names, which are as long as the artist makes them.
NUMBERS = {"MATTERFIT_UL_worst", "MATTERFIT_UL_worst_images"}


def text_width(text):
    blf.size(0, 11)
    return blf.dimensions(0, text)[0]


def _number(value, found):
    """A value as a field shows it."""
    words = f"{value:.{found.precision + 1}f}" if found.type == "FLOAT" else str(value)
    return words + (" m" if found.unit == "LENGTH" else "")


def _choice(item, name):
    """(name of an enumeration's choice, what its icon takes)."""
    value = getattr(item, name)
    icon = bpy.types.UILayout.enum_item_icon(item, name, value)
    return bpy.types.UILayout.enum_item_name(item, name, value), ICON if icon else 0.0


class _Properties:
    """What operator() returns."""


class Layout:
    """`faults` collects (text, its width, the room)."""

    def __init__(self, faults, split=False, across=False, decorate=False):
        self._faults = faults
        self._across = across
        self._children = []  # (width wanted or None, function(width))
        self.use_property_split = split
        self.use_property_decorate = decorate
        self.scale_y = 1.0

    def measure(self, width):
        flexible = [child for child in self._children if child[0] is None]
        fixed = sum(child[0] for child in self._children if child[0] is not None)
        for wanted, visit in self._children:
            room = width if not self._across else wanted or (width - fixed) / len(flexible)
            visit(room)

    # -- parts ---------------------------------------------------------------------------------

    def _part(self, across, shrink=0.0, heading=""):
        part = Layout(self._faults, self.use_property_split, across, self.use_property_decorate)
        split = self.use_property_split

        def visit(width):
            if heading:
                self._check(heading, 0.4 * width - MARGIN)
            part.measure((0.6 * width if heading and split else width) - shrink)

        self._children.append((None, visit))
        return part

    def row(self, align=False, heading=""):
        return self._part(True, heading=heading)

    def column(self, align=False, heading=""):
        return self._part(False, heading=heading if self.use_property_split else "")

    def box(self):
        return self._part(False, shrink=12.0)

    def separator(self):
        pass

    # -- contents ------------------------------------------------------------------------------

    def label(self, text="", icon="NONE", translate=True):
        self._add(text, MARGIN + (ICON if icon != "NONE" else 0.0))

    def operator(self, name, text=None, icon="NONE"):
        kind = getattr(bpy.types, "MATTERFIT_OT_" + name.split(".")[1])
        text = kind.bl_label if text is None else text
        self._add(text, MARGIN + (ICON if icon != "NONE" else 0.0), square=not text)
        return _Properties()

    def operator_menu_enum(self, name, _property, text=None, icon="NONE"):
        return self.operator(name, text=text, icon=icon)

    def prop(self, item, name, text=None, icon="NONE", expand=False, **options):
        found = item.bl_rna.properties[name]
        text = found.name if text is None else text
        dot = ICON if self.use_property_split and self.use_property_decorate else 0.0
        flag = found.type == "BOOLEAN" and not getattr(found, "is_array", False)
        if getattr(found, "is_array", False):
            # A colour is a patch, without axes.
            text += " X" if found.subtype not in ("NONE", "", "COLOR", "COLOR_GAMMA") else ""
        if found.type == "ENUM" and (found.is_enum_flag or expand):
            for choice in found.enum_items:
                self._add(choice.name, MARGIN)
        elif "index" in options:
            self._add(text, 4.0)
        elif self.use_property_split and text:
            part = 0.6 if flag else 0.4
            chosen, shown = _choice(item, name) if found.type == "ENUM" else ("", 0.0)

            def visit(width):
                self._check(text, part * (width - dot) - (1.3 * ICON if flag else 0.0) - MARGIN)
                self._check(chosen, 0.6 * (width - dot) - MENU - shown)

            self._children.append((None, visit))
        elif found.type == "ENUM" and not text:
            chosen, shown = _choice(item, name)
            self._add(chosen, MENU + shown)
        else:
            value = ICON if flag else 0.0
            if found.type in ("FLOAT", "INT") and text:
                value = FIELD + text_width(_number(getattr(item, name), found))
            self._add(text, value + MARGIN, square=not text and (flag or icon != "NONE"))

    def prop_enum(self, _item, _name, _value, text):
        self._add(text, MARGIN)

    def prop_search(self, item, name, _owner, _list, **options):
        self.prop(item, name, **options)

    def template_list(self, kind, _identifier, owner, items, *_active, rows=5, **_options):
        if kind not in NUMBERS:
            self._children.append((None, lambda _width: None))
            return
        found = getattr(owner, items)
        part = self._part(False, shrink=LIST + (SCROLL if len(found) > rows else 0.0))
        for index, item in enumerate(found):
            getattr(bpy.types, kind).draw_item(None, None, part, owner, item, "NONE", None, "", index)

    def progress(self, **_options):
        pass

    def _add(self, text, taken, square=False):
        self._children.append((ICON if square else None,
                               lambda width: self._check(text, width - taken)))

    def _check(self, text, room):
        if text and text_width(text) > room:
            self._faults.append((text, round(text_width(text)), round(room)))


def faults_of_all(panels, context):
    """[(panel's title, text, width, room)] of every panel of `panels`."""
    return [(panel.bl_label, *fault) for panel in panels if issubclass(panel, bpy.types.Panel)
            for fault in faults_of(panel, context)]


def faults_of(panel, context):
    """What is cut in a panel as it is drawn now: [(text, width, room)]."""
    if not panel.poll(context):
        return []
    faults = []
    layout = Layout(faults)
    panel.draw(_stand_in(panel, layout), context)
    layout.measure(SIDEBAR)
    return faults


def texts_of(panel, context):
    """Every text that a panel draws now."""
    faults = []
    layout = Layout(faults)
    panel.draw(_stand_in(panel, layout), context)
    layout.measure(-1e6)  # where nothing has room
    return [text for text, _width, _room in faults]


def _stand_in(panel, layout):
    """An object with the panel's methods and our layout: Blender makes panels itself."""
    methods = {name: getattr(panel, name) for name in dir(panel)
               if name.startswith("_") and not name.startswith("__")}
    stand_in = type("Drawing", (), {name: function for name, function in methods.items()})()
    stand_in.layout = layout
    return stand_in
