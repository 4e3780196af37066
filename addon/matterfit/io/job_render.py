# SPDX-License-Identifier: GPL-3.0-or-later
"""What the task `render` draws: a take through the scene's camera."""

import os

from . import blender_cameras, camera_capture, files, job_writer

CAMERAS = "render_camera"
PICTURES = "render"  # the folder of the pictures below the cache's, one a camera in it


def document(writer, captures):
    """The document's `render`: the scene's camera; where that is one of a capture's, as the capture has it.
    `captures`: the document's. JobError without a camera, or for one that moves."""
    scene = writer.scene
    camera = scene.camera
    if camera is not None:
        of_capture = camera.get(blender_cameras.CAPTURE)
        if any("cameras" in capture and capture["name"] == of_capture for capture in captures):
            return {"capture": of_capture, "camera": int(camera[blender_cameras.NUMBER])}
    shot = blender_cameras.shot(scene, camera, "view", None, writer.scale)
    camera_capture.require_still(scene, camera)
    relative = f"{job_writer.INPUT_FOLDER}/{CAMERAS}.json"
    files.write_json(os.path.join(writer.folder, relative), {"frames": [shot]})
    writer.written.append(relative)
    return {"cameras": relative}


def pictures(folder, result):
    """The first picture of a finished render and how many there are of its camera."""
    found = result["render"]["files"]
    return os.path.join(folder, found[0]), len(found)
