# SPDX-License-Identifier: GPL-3.0-or-later
"""Which take is seen, and when the artist's own objects give way to it."""

from ..props import reactions

HIDDEN_TAG = "matterfit_hidden"  # on an artist's object: how it was hidden before we hid it
CHOSEN_TAG = "matterfit_shown"  # on one of ours: whether it is seen was decided once, and is the
# artist's choice now


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
    """The active take's collection is seen, the others' are not."""
    shown = False
    for index, take in enumerate(settings.takes):
        if take.collection is not None:
            active = index == settings.take_index
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
