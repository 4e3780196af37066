# SPDX-License-Identifier: GPL-3.0-or-later
"""What the task `render` draws: a take through the scene's camera, and its pictures there."""

import os

import bpy

from . import blender_cameras, camera_capture, files, job_writer
from .nodes import relative_path

CAMERAS = "render_camera"
PICTURES = "render"  # the folder of the pictures in the take's


def document(writer, captures):
    """The document's `render`: the scene's camera; where that is one of a capture's and stands as that has it,
    the capture's. `captures`: the document's. JobError without a camera, or for one that moves."""
    scene = writer.scene
    camera = scene.camera
    for capture in writer.settings.captures:
        told = any("cameras" in other and other["name"] == capture.name for other in captures)
        if told and blender_cameras.stands_as_told(capture, camera):
            return {"capture": capture.name, "camera": int(camera[blender_cameras.NUMBER])}
    shot = blender_cameras.shot(scene, camera, "view", None, writer.scale)
    camera_capture.require_still(scene, camera)
    relative = f"{job_writer.INPUT_FOLDER}/{CAMERAS}.json"
    files.write_json(os.path.join(writer.folder, relative), {"frames": [shot]})
    writer.written.append(relative)
    return {"cameras": relative}


def show(camera, folder, result):
    """Shows the pictures of a finished render behind what the camera sees, each at its frame."""
    found = result["render"]["files"]
    first = os.path.join(folder, found[0])
    image = bpy.data.images.load(first, check_existing=True)
    image.filepath = relative_path(first)
    image.reload()
    image[blender_cameras.DRAWN] = True
    blender_cameras.show_sequence(camera, image, result["frames"][0], len(found))


def hide_removed(folder):
    """Takes pictures that a take's folder holds no more away from behind all cameras' views, and their image
    where nothing else uses it. Returns whether any was shown."""
    pictures = os.path.join(os.path.normpath(folder), PICTURES) + os.sep
    found = False
    for image in list(bpy.data.images):
        path = files.absolute(image.filepath)
        if not image.get(blender_cameras.DRAWN) or not path.startswith(pictures) or os.path.isfile(path):
            continue
        for data in bpy.data.cameras:
            if data.library is None:
                found = blender_cameras.remove_background(data, image) or found
        if not image.users:
            bpy.data.images.remove(image)
    return found
