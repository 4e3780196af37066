# SPDX-License-Identifier: GPL-3.0-or-later
"""What of a take is shown in the views of the scene's cameras: the pictures that Render Take draws behind them,
and the overlays of a comparison. Those of the active take are seen; those of others are kept, hidden."""

import os

from ..props import reactions
from ..props import scene as scene_props
from . import blender_cameras, cache, files


@reactions.pictures_switched.done_by
def show_active(settings):
    show_of(settings, scene_props.active_take(settings))


def show_of(settings, take):
    """As if the take (None: none) were the active one. Its pictures are seen where those that give way to them
    were."""
    views = {}
    for data in _cameras(settings.id_data):
        for shown in data.background_images:
            if any(_is_of(shown.image, other) for other in settings.takes):
                views.setdefault((data, shown.display_depth), []).append(shown)
    seen = {view: _were_seen(pictures) for view, pictures in views.items()}  # cameras may share an image
    for view, pictures in views.items():
        for shown in pictures:
            mine = take is not None and _is_of(shown.image, take)
            if mine:
                shown.image.pop(blender_cameras.AWAY, None)
            else:
                shown.image[blender_cameras.AWAY] = seen[view]
            shown.show_background_image = mine and seen[view]


def remove(scene, take):
    """Takes the pictures of a take away from the views of the scene's cameras."""
    for data in _cameras(scene):
        for image in {shown.image for shown in data.background_images}:
            if _is_of(image, take):
                blender_cameras.remove_background(data, image)


def _cameras(scene):
    return {item.data for item in scene.objects if item.type == "CAMERA" and item.data.library is None}


def _is_of(image, take):
    """Whether the image lies in the take's cache, wherever that is."""
    return bool(image is not None and take.folder) and (
        os.sep + os.path.normpath(cache.name_of(take)) + os.sep in files.absolute(image.filepath))


def _were_seen(pictures):
    """Whether those of a view were seen which are not put away; where all are, when they were."""
    present = [shown for shown in pictures if blender_cameras.AWAY not in shown.image]
    if present:
        return any(shown.show_background_image for shown in present)
    return any(shown.image[blender_cameras.AWAY] for shown in pictures)
