# SPDX-License-Identifier: GPL-3.0-or-later
"""Cameras of the scene, each with a sequence of photographs behind its view, as a recording by images."""

import os
import re

import bpy

from ..compat import translate
from ..jobs import JobError
from . import blender_cameras, files, frames, readable_images

SAME = 1e-6  # of a camera's matrix and lens from frame to frame


def cameras(scene):
    """Those that have photographs behind their view, by name: of the selected ones where any has."""
    found = sorted((item for item in scene.objects if item.type == "CAMERA" and _photographs(item)),
                   key=lambda item: item.name)
    return [item for item in found if item.select_get()] or found


def _photographs(camera):
    return [shown for shown in blender_cameras.backgrounds(camera)[0]
            if shown.source == "IMAGE" and shown.image is not None]


def write(scene, items, folder):
    """(path, first frame) of a `transforms.json` in the folder: what each camera's photographs show, at the
    scene's frames. JobError for a camera that moves, or whose photograph is no sequence or is shown otherwise
    than as it was taken."""
    for item in items:
        require_still(scene, item)
    shows = [_Photographs(scene, item) for item in items]
    start = min(shown.first for shown in shows)
    fps = scene.render.fps / scene.render.fps_base
    shots = []
    for shown in shows:
        of_camera = blender_cameras.shot(scene, shown.camera, "", None, scene.unit_settings.scale_length,
                                         shown.size)
        for frame, path in shown.files:
            name = readable_images.relative(path, folder)
            shots.append({**of_camera, "file_path": name, "time": (frame - start) / fps})
    return files.write_json(os.path.join(folder, "transforms.json"), {"frames": shots}), start


def require_still(scene, item):
    """JobError where the camera stands or looks otherwise at one of the frames than at the first."""
    if not _may_move(item):
        return
    first, end = frames.frame_range(scene)
    with frames.frame_kept(scene):
        known = None
        for frame in range(first, end):
            scene.frame_set(frame)
            depsgraph = bpy.context.evaluated_depsgraph_get()
            seen = item.evaluated_get(depsgraph)
            now = [value for row in seen.matrix_world for value in row]
            now += [seen.data.lens, seen.data.shift_x, seen.data.shift_y]
            known = known or now
            if any(abs(a - b) > SAME * max(1.0, abs(a)) for a, b in zip(known, now, strict=True)):
                raise JobError(translate(
                    "Camera '{name}' moves: at frame {frame} it stands or looks otherwise than at the first. "
                    "Remove its animation, or take a camera that stands still."
                ).format(name=item.name, frame=frame))


def _may_move(item):
    while item is not None:
        if item.animation_data is not None or len(item.constraints):
            return True
        if item.data is not None and item.data.animation_data is not None:
            return True
        item = item.parent
    return False


class _Photographs:
    """What stands behind a camera's view: `files` [(scene frame, path)], `first` of these frames, `size`."""

    def __init__(self, scene, camera):
        self.camera = camera
        shown = _photographs(camera)[0]
        image, user = shown.image, shown.image_user
        self._require_plain(shown)
        if image.source != "SEQUENCE":
            raise JobError(translate("Camera '{name}': '{image}' behind its view is no image sequence. Set its "
                                     "Source to Image Sequence.").format(name=camera.name, image=image.name))
        path = files.absolute(image.filepath)
        if re.search(r"\d+(?=\.\w+$)", path) is None:
            raise JobError(translate("Camera '{name}': {path} has no number at the end of its name.").format(
                name=camera.name, path=path))
        self.files = []
        for frame in range(user.frame_start, user.frame_start + user.frame_duration):
            one = blender_cameras.numbered(path, frame - user.frame_start + 1 + user.frame_offset)
            if os.path.isfile(one):
                self.files.append((frame, one))
        if not self.files:
            raise JobError(translate("Camera '{name}': none of the images of the sequence {path} is there. Look "
                                     "at its Start Frame, Offset and Frames.").format(name=camera.name, path=path))
        self.first = self.files[0][0]
        self.size = _size_of(self.files[0][1])
        width, height = blender_cameras.image_size(scene)
        if abs(self.size[0] * height - self.size[1] * width) > max(self.size[0], self.size[1]):
            raise JobError(translate(
                "Camera '{name}': its images are {w} × {h}, the scene renders {x} × {y}. Set the scene's "
                "Resolution to that of the images.").format(name=camera.name, w=self.size[0], h=self.size[1],
                                                            x=width, y=height))

    def _require_plain(self, shown):
        plain = (tuple(shown.offset) == (0.0, 0.0) and shown.scale == 1.0 and shown.rotation == 0.0
                 and not shown.use_flip_x and not shown.use_flip_y)
        if not plain:
            raise JobError(translate("Camera '{name}': its background image is shifted, scaled, turned or "
                                     "flipped. A capture takes it as it is: set these back.").format(
                                         name=self.camera.name))


def _size_of(path):
    image = bpy.data.images.load(path, check_existing=False)
    size = tuple(image.size)
    bpy.data.images.remove(image)
    if min(size) < 1:
        raise JobError(translate("{path}: Blender could not read it. Is it damaged, or of another format than "
                                 "its name says?").format(path=path))
    return size
