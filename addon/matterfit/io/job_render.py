# SPDX-License-Identifier: GPL-3.0-or-later
"""What the task `render` draws: a take through the scene's camera and those that show it already, and its
pictures there."""

import os
import re

import bpy

from ..jobs import JobError
from . import blender_cameras, camera_capture, camera_frames, files, job_writer, take_pictures, takes, transforms
from .nodes import relative_path

CAMERAS = "render_camera"
PICTURES = "render"  # the folder of the pictures in the take's


def document(writer, captures):
    """The document's `render`: the scene's camera, and those others that show pictures of this take and can
    be drawn through; where the scene's is one of a capture's and stands as that has it, those of the
    capture's. `captures`: the document's. JobError without a camera, or for one that moves."""
    scene, camera = writer.scene, writer.scene.camera
    others = [item for item in _showing(scene, writer.folder) if camera is None or item.data != camera.data]
    for capture in writer.settings.captures:
        told = any("cameras" in other and other["name"] == capture.name for other in captures)
        if told and blender_cameras.stands_as_told(capture, camera):
            found = [camera, *(item for item in others if blender_cameras.stands_as_told(capture, item))]
            return {"capture": capture.name,
                    "camera": sorted({int(item[blender_cameras.NUMBER]) for item in found})}
    shots = {camera: _shot(scene, camera)}
    for item in others:
        try:
            shots[item] = _shot(scene, item)
        except JobError:
            continue  # nothing asks for it but its old pictures, which show() takes away
    relative = f"{job_writer.INPUT_FOLDER}/{CAMERAS}.json"
    files.write_json(os.path.join(writer.folder, relative), {
        "frames": [shots[item] for item in sorted(shots, key=lambda item: _place(item, writer.folder))]})
    writer.written.append(relative)
    return {"cameras": relative}


def _shot(scene, camera):
    found = blender_cameras.shot(scene, camera, camera.name if camera is not None else "", None,
                                 transforms.metres(scene))
    camera_capture.require_still(scene, camera)
    return found


def _showing(scene, folder):
    """The cameras of the scene that show pictures of the take of that folder, one for each lens."""
    found = {}
    for item in sorted(scene.objects, key=lambda item: (len(item.name), item.name)):
        if item.type == "CAMERA" and _pictures(item, folder):
            found.setdefault(item.data, item)
    return list(found.values())


def _pictures(camera, folder):
    return [shown.image for shown in blender_cameras.backgrounds(camera)[1] if _of(shown.image, folder)]


def _of(image, folder):
    """The number of the camera whose pictures of the take an image shows, as a text; "": of no such take."""
    pictures = os.path.join(os.path.normpath(folder), PICTURES) + os.sep
    path = files.absolute(image.filepath)
    if not image.get(blender_cameras.DRAWN) or not path.startswith(pictures):
        return ""
    return re.match(r"camera_(\d+)|", path[len(pictures):])[1] or ""


def _place(camera, folder):
    """By what cameras are sorted: each keeps its number, and a new one comes last."""
    numbers = [int(_of(image, folder)) for image in _pictures(camera, folder)]
    return (not numbers, numbers, len(camera.name), camera.name)


def show(scene, folder, render, result):
    """Shows the pictures of a finished render behind what each camera sees, each at its frame, while its take
    is the active one. `render`: the document's. Returns the names of the cameras from behind whose views it has
    taken such as are another's now, or removed."""
    with take_pictures.drawing(scene.matterfit, takes.find(folder)[1]):
        return _show(scene, folder, render, result)


def _show(scene, folder, render, result):
    found, drawn, said = {}, [], []
    for path in result["render"]["files"]:
        found.setdefault(os.path.basename(os.path.dirname(path)), []).append(path)
    for camera, number in _drawn_through(scene, folder, render):
        paths = found[f"camera_{number}"]
        first = os.path.join(folder, paths[0])
        image = bpy.data.images.load(first, check_existing=True)
        image.filepath = relative_path(first)
        image.reload()
        image[blender_cameras.DRAWN] = True
        camera_capture.remember(scene, camera, image)
        blender_cameras.show_sequence(camera, image, result["frames"][0], len(paths))
        drawn.append(camera.data)
    camera_frames.fill(scene)
    for data in bpy.data.cameras:
        if data in drawn or data.library is not None:
            continue
        for image in {shown.image for shown in data.background_images if shown.image is not None}:
            number = _of(image, folder)
            if f"camera_{number}" in found or number and not os.path.isfile(files.absolute(image.filepath)):
                blender_cameras.remove_background(data, image)
                said.append(data.name)
    hide_removed(folder)
    return said


def _drawn_through(scene, folder, render):
    """[(camera, its number)] of a document's `render`, of those that are still there."""
    if "capture" in render:
        capture = scene.matterfit.captures.get(render["capture"])
        cameras = [item for item in scene.objects if capture is not None and item.type == "CAMERA"
                   and blender_cameras.stands_as_told(capture, item)]
        return [(item, item[blender_cameras.NUMBER]) for item in cameras
                if item[blender_cameras.NUMBER] in render["camera"]]
    places, found = [], []
    for shot in files.read_json(os.path.join(folder, render["cameras"]))["frames"]:
        place = {key: value for key, value in shot.items() if key != "file_path"}
        if place not in places:  # of one place and lens are one camera
            places.append(place)
        camera = scene.objects.get(shot["file_path"])
        if camera is not None and camera.type == "CAMERA":
            found.append((camera, places.index(place)))
    return found


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
