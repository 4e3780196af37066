# SPDX-License-Identifier: GPL-3.0-or-later
"""What of a take is shown in the views of the scene's cameras: the pictures that Render Take draws behind them,
and the overlays of a comparison. Those of the active take are seen; those of others are kept, hidden."""

import contextlib
import os

import bpy

from ..props import reactions
from ..props import scene as scene_props
from . import blender_cameras, cache, files

# On a camera: whether the pictures of takes that are shown behind or in front of its view were seen at last.
SEEN = {"BACK": "matterfit_seen_behind", "FRONT": "matterfit_seen_in_front"}


@reactions.pictures_switched.done_by
def show_active(settings):
    _show_of(settings, scene_props.active_take(settings))


@contextlib.contextmanager
def drawing(settings, take):
    """Inside, the take (None: none) is as if it were the active one, so that its new pictures replace those of
    no other. Afterwards the active one's are shown again, also where something failed; where that is another,
    each view as it was."""
    views = _show_of(settings, take)
    try:
        yield
    finally:
        if take is not None and take != scene_props.active_take(settings):
            for data, depth in views:
                for shown in data.background_images:
                    if shown.display_depth == depth and _is_of(shown.image, take):
                        shown.show_background_image = _were_seen(data, depth)
        show_active(settings)


def remove(scene, take):
    """Takes the pictures of a take away from the views of the scene's cameras, but of such as another scene
    has whose take has the same cache."""
    if not take.folder:
        return
    _note(scene.matterfit)  # what is chosen in a view outlasts them
    name, kept = cache.name_of(take), set()
    for other in bpy.data.scenes:
        if other != scene and any(cache.name_of(row) == name for row in other.matterfit.takes):
            kept |= _cameras(other)
    for data in _cameras(scene) - kept:
        for image in {shown.image for shown in data.background_images}:
            if _is_of(image, take):
                blender_cameras.remove_background(data, image)


def kept(scene, take):
    """What is shown of a take, as put_back() takes it: names and values, which undo leaves as they are."""
    return [(data.name, shown.image.name, _values(shown), _values(shown.image_user))
            for data in _cameras(scene) for shown in data.background_images if _is_of(shown.image, take)]


def put_back(settings, rows):
    """Shows what was removed since kept() has said it."""
    for data_name, image_name, values, user in rows:
        data, image = bpy.data.cameras.get(data_name), bpy.data.images.get(image_name)
        if None in (data, image) or any(shown.image == image for shown in data.background_images):
            continue
        shown = data.background_images.new()
        shown.image = image
        for item, told in ((shown, values), (shown.image_user, user)):
            for key, value in told.items():
                setattr(item, key, value)
    show_active(settings)


def _values(item):
    """The numbers, texts and choices of a background image or its user that can be set."""
    found = {}
    for row in item.bl_rna.properties:
        if not row.is_readonly and row.type not in {"POINTER", "COLLECTION"}:
            value = getattr(item, row.identifier)
            found[row.identifier] = tuple(value) if getattr(row, "is_array", False) else value
    return found


def _show_of(settings, take):
    """As if the take (None: none) were the active one. Its pictures are seen where those that give way to them
    were. Returns the views: {(camera, depth): [background image]}."""
    views = _note(settings)
    for (data, depth), pictures in views.items():
        for shown in pictures:
            mine = take is not None and _is_of(shown.image, take)
            if mine:
                shown.image.pop(blender_cameras.AWAY, None)
            else:
                shown.image[blender_cameras.AWAY] = True
            shown.show_background_image = mine and _were_seen(data, depth)
    return views


def _note(settings):
    """The views of takes' pictures, each with a note on its camera whether those that are not put away are
    seen; where all are, the note of before stays."""
    views = {}
    for data in _cameras(settings.id_data):
        for shown in data.background_images:
            if any(_is_of(shown.image, take) for take in settings.takes):
                views.setdefault((data, shown.display_depth), []).append(shown)
    for (data, depth), pictures in views.items():
        present = [shown for shown in pictures if blender_cameras.AWAY not in shown.image]
        if present:
            data[SEEN[depth]] = any(shown.show_background_image for shown in present)
    return views


def _were_seen(data, depth):
    return bool(data.get(SEEN[depth], True))


def _cameras(scene):
    return {item.data for item in scene.objects if item.type == "CAMERA" and item.data.library is None}


def _is_of(image, take):
    """Whether the image lies in the take's cache, wherever that is."""
    return bool(image is not None and take.folder) and (
        os.sep + os.path.normpath(cache.name_of(take)) + os.sep in files.absolute(image.filepath))
