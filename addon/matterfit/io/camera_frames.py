# SPDX-License-Identifier: GPL-3.0-or-later
"""How pictures behind the views of a capture's cameras fill the frame where the scene renders in another
aspect than theirs: undistorted, and where the lens sees what they show."""

import bpy

from . import blender_cameras

SIZE = "matterfit_size"  # on a camera of a capture: its images' width and height
ALIKE = 1e-4  # of two aspects: less than a pixel

_OWNER = object()  # whose the subscriptions are


def told(capture, places):
    """The cameras of a capture get the sizes of a summary's places, and their pictures fill the frame."""
    for k, item in blender_cameras.of_capture(capture.id_data, capture.name).items():
        if k < len(places):
            item[SIZE] = [places[k]["width"], places[k]["height"]]
    fill(capture.id_data)


def fill(scene):
    """The lens of such a camera is told by one side of its images, and Blender puts that side onto the same
    one of the frame: the picture's other side follows from its own aspect."""
    for item in scene.objects:
        if item.type == "CAMERA" and blender_cameras.CAPTURE in item and item.data.library is None:
            for shown in item.data.background_images:
                _fill(scene, item, shown)


def _fill(scene, camera, shown):
    width, height = _size(camera, shown)
    corners = camera.data.view_frame(scene=scene)
    frame = ((max(corner.x for corner in corners) - min(corner.x for corner in corners))
             / (max(corner.y for corner in corners) - min(corner.y for corner in corners)))
    if not height or abs(width / height - frame) < ALIKE * frame:
        return
    fit = camera.data.sensor_fit
    if fit == "AUTO":  # by the longer side, of the images as of the frame
        if (width >= height) != (frame >= 1.0):
            return
        fit = "HORIZONTAL" if width >= height else "VERTICAL"
    wider = width / height > frame
    method = "FIT" if wider == (fit == "HORIZONTAL") else "CROP"
    if shown.frame_method != method:
        shown.frame_method = method


def _size(camera, shown):
    """That of the picture itself where Blender has read it, which it has not of a sequence."""
    if shown.source == "IMAGE" and shown.image is not None and min(shown.image.size) > 0:
        return tuple(shown.image.size)
    return tuple(camera.get(SIZE, (0, 0)))


def fill_all():
    for scene in bpy.data.scenes:
        fill(scene)


def subscribe():
    """From here on a change of the scene's resolution is followed; anew for each file that is opened."""
    unsubscribe()
    for name in ("resolution_x", "resolution_y", "pixel_aspect_x", "pixel_aspect_y"):
        bpy.msgbus.subscribe_rna(key=(bpy.types.RenderSettings, name), owner=_OWNER, args=(), notify=fill_all)


def unsubscribe():
    bpy.msgbus.clear_by_owner(_OWNER)
