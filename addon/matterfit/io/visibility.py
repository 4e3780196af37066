# SPDX-License-Identifier: GPL-3.0-or-later
"""What is seen of a take: one picture of each body, and when the artist's own objects give way."""

from .. import laws
from ..props import reactions
from . import nodes

HIDDEN_TAG = "matterfit_hidden"  # on an artist's object: how it was hidden before we hid it
CHOSEN_TAG = "matterfit_shown"  # on one of ours: what decide() made of it last
SHOWN, HIDDEN, MIXED = 3, 2, 0
# What shows a body, the best first: what pours has no mesh that could follow it.
OF_SOLIDS = ("mesh", "surface", "volume", "points")
OF_FLOWS = ("surface", "volume", "points", "mesh")
OF_GRAINS = ("points", "surface", "volume", "mesh")  # what falls apart has no surface


def picture(kinds, law):
    """The one of `kinds` ('mesh', 'surface', 'volume', 'points') that shows a body of that law."""
    order = OF_GRAINS if laws.granular(law) else OF_FLOWS if laws.flows(law) else OF_SOLIDS
    return next((kind for kind in order if kind in kinds), None)


def decide(item, seen):
    """Shows or hides an object of ours, unless the artist has changed that since."""
    if item.get(CHOSEN_TAG, _state(item)) != _state(item):
        if item.type == "VOLUME":
            _give_fog(item, not item.hide_render)
        return
    item.hide_render = not seen
    if item.type == "VOLUME":
        # Its level set is what Volume to Mesh reads, and a hidden object is not evaluated: it stays,
        # without anything that could be seen.
        _give_fog(item, seen)
        item.data.display.density = 1.0 if seen else 0.0
        item.data.display.wireframe_type = "BOXES" if seen else "NONE"
        item.hide_select = not seen
    else:
        item.hide_viewport = not seen
    item[CHOSEN_TAG] = _state(item)


def _give_fog(item, seen):
    """A volume's own material, or in its place one of the object that shows nothing: Material Preview
    shows whatever is not hidden in the viewport."""
    for slot in item.material_slots:
        slot.link = "DATA" if seen else "OBJECT"
        if not seen:
            slot.material = nodes.empty_material()


def _state(item):
    hidden = item.hide_render
    if item.type != "VOLUME" and item.hide_viewport != hidden:
        return MIXED
    return HIDDEN if hidden else SHOWN


def hide_original(item):
    """The artist's object gives way to the result; what it was is remembered on it."""
    if HIDDEN_TAG not in item:
        item[HIDDEN_TAG] = int(item.hide_render) + 2 * int(item.hide_viewport)
    item.hide_render = True
    item.hide_viewport = True


def show_original(item):
    if HIDDEN_TAG in item:
        state = int(item[HIDDEN_TAG])
        item.hide_render = bool(state & 1)
        item.hide_viewport = bool(state & 2)
        del item[HIDDEN_TAG]


@reactions.take_switched.done_by
def show_take(settings):
    """The active take's collection is seen where its cache holds frames, the others' are not."""
    shown = False
    for index, take in enumerate(settings.takes):
        if take.collection is not None:
            active = index == settings.take_index and take.frames_done > 0
            take.collection.hide_render = not active
            take.collection.hide_viewport = not active
            shown = shown or active
    preview = settings.preview.collection
    if preview is not None and shown:
        preview.hide_render = preview.hide_viewport = True
    for body in settings.bodies:
        if body.role == "BODY" and body.object is not None:
            if shown and body.enabled:
                hide_original(body.object)
            else:
                show_original(body.object)


def show_only(settings, take):
    """The collection of `take` is seen (a preview's as well), no other."""
    for other in (*settings.takes, settings.preview):
        if other.collection is not None:
            hidden = other.collection != take.collection
            other.collection.hide_render = hidden
            other.collection.hide_viewport = hidden
