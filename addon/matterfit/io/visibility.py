# SPDX-License-Identifier: GPL-3.0-or-later
"""What is seen of a take: one picture of each body, and when the artist's own objects give way."""

from .. import laws
from ..props import reactions
from . import files, nodes, result_objects

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
    """The active take's objects are seen where its cache holds frames, the others' are not."""
    shown = None
    for index, take in enumerate(settings.takes):
        if take.collection is not None:
            active = index == settings.take_index and take.frames_done > 0
            take.collection.hide_render = not active
            take.collection.hide_viewport = not active
            for item in result_objects.strays_of(settings.id_data, take):
                (show_original if active else hide_original)(item)
            shown = take if active else shown
    preview = settings.preview.collection
    if preview is not None and shown is not None:
        preview.hide_render = preview.hide_viewport = True
    for body in _stood_for(settings, shown):
        hide_original(body.object)


def _stood_for(settings, shown):
    """The bodies whose objects give way to results of the take that is shown; all others are seen."""
    bodies = [body for body in settings.bodies if body.role == "BODY" and body.object is not None]
    names = set() if shown is None else {result_objects.kind_and_body(item)[1] for item in
                                         result_objects.objects_of(settings.id_data, shown)}
    # A result of a name that no body has is of one that was called otherwise.
    renamed = bool(names - {files.safe_name(body.name) for body in bodies})
    found = [body for body in bodies if files.safe_name(body.name) in names or renamed and body.enabled]
    kept = {body.object for body in found}
    for body in bodies:
        if body.object not in kept:
            show_original(body.object)
    return found


def hide_results(settings, body):
    """What shows a body that is taken out of the list: its object comes back in its place."""
    name = files.safe_name(body.name)
    for take in settings.takes:
        for item in result_objects.objects_of(settings.id_data, take):
            if result_objects.kind_and_body(item)[1] == name:
                decide(item, False)


def show_only(settings, take):
    """The collection of `take` is seen (a preview's as well), no other."""
    for other in (*settings.takes, settings.preview):
        if other.collection is not None:
            hidden = other.collection != take.collection
            other.collection.hide_render = hidden
            other.collection.hide_viewport = hidden
