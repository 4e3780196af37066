# SPDX-License-Identifier: GPL-3.0-or-later
"""Cameras of the scene, each with a sequence of photographs behind its view, as a recording by images."""

import os
import re

import bpy

from ..compat import translate
from ..jobs import JobError
from . import blender_cameras, files, frames, readable_images
from .nodes import relative_path

SEEN = "matterfit_seen"  # on an image that was drawn of a take: how its camera stood
SAME = 1e-6  # of a camera's matrix and lens from frame to frame


def cameras(scene):
    """Those that have an image sequence behind their view, by name: of the selected ones where any has;
    those of photographs, and where there are none, those of pictures that Render Take has drawn."""
    found = sorted((item for item in scene.objects if item.type == "CAMERA"), key=lambda item: item.name)
    for items in ([item for item in found if item.select_get()], found):
        for behind in (_photographs, _drawn):
            chosen = [item for item in items if behind(item)]
            if chosen:
                return chosen
    return []


def _photographs(camera):
    return [shown for shown in blender_cameras.backgrounds(camera)[0]
            if shown.source == "IMAGE" and shown.image is not None]


def _drawn(camera):
    return [shown for shown in blender_cameras.backgrounds(camera)[1] if shown.image.source == "SEQUENCE"]


def remember(scene, camera, image):
    """Keeps on the image that is drawn through the camera how that stands."""
    image[SEEN] = _seen(scene, camera)


def _seen(scene, camera):
    shot = blender_cameras.shot(scene, camera, "")
    return [float(value) for row in shot["transform_matrix"] for value in row] + [
        float(shot[key]) for key in ("w", "h", "fl_x", "fl_y", "cx", "cy")]


def write(scene, items, folder):
    """(path, first frame, copies) of a `transforms.json` in the folder: what each camera's photographs show, at
    the scene's frames. Pictures of a take, which go with its cache, are copied into the folder: `copies` are
    their [(camera, background, path of the first, its frame, count)]. JobError for a camera that moves, or
    whose photograph is no sequence or is shown otherwise than as it was taken."""
    for item in items:
        require_still(scene, item)
    shows = [_Photographs(scene, item) for item in items]
    _require_one_take([shown for shown in shows if shown.drawn])
    start = min(shown.first for shown in shows)
    fps = scene.render.fps / scene.render.fps_base
    shots, copies = [], []
    for k, shown in enumerate(shows):
        if shown.drawn:
            shown.copy_into(os.path.join(folder, f"camera_{k}"))
            copies.append((shown.camera, shown.background, shown.files[0][1], shown.first, len(shown.files)))
        of_camera = blender_cameras.shot(scene, shown.camera, "", None, scene.unit_settings.scale_length,
                                         shown.size)
        for frame, path in shown.files:
            name = readable_images.relative(path, folder)
            shots.append({**of_camera, "file_path": name, "time": (frame - start) / fps})
    return files.write_json(os.path.join(folder, "transforms.json"), {"frames": shots}), start, copies


def show_copies(copies):
    """The copies that write() has made stand behind the views in place of what they were made from."""
    for camera, background, path, first, count in copies:
        blender_cameras.remove_background(camera.data, background.image)
        image = bpy.data.images.load(path)
        image.filepath = relative_path(path)
        blender_cameras.show_sequence(camera, image, first, count)


def _require_one_take(shows):
    for shown in shows:
        if shown.folder != shows[0].folder:
            raise JobError(translate(
                "Camera '{name}' shows pictures of another take than camera '{first}'. Select the cameras that "
                "show the same one, or press Render Take through each.").format(
                    name=shown.camera.name, first=shows[0].camera.name))


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
            if not _near(known, now):
                raise JobError(translate(
                    "Camera '{name}' moves: at frame {frame} it stands or looks otherwise than at the first. "
                    "Remove its animation, or take a camera that stands still."
                ).format(name=item.name, frame=frame))


def _near(known, now):
    return all(abs(a - b) <= SAME * max(1.0, abs(a)) for a, b in zip(known, now, strict=True))


def _may_move(item):
    while item is not None:
        if item.animation_data is not None or len(item.constraints):
            return True
        if item.data is not None and item.data.animation_data is not None:
            return True
        item = item.parent
    return False


class _Photographs:
    """What stands behind a camera's view: `files` [(scene frame, path)], `first` of these frames, `size`;
    whether it is `drawn`, of the take of that `folder`."""

    def __init__(self, scene, camera):
        self.camera = camera
        self.drawn = not _photographs(camera)
        self.background = shown = (_photographs(camera) or _drawn(camera))[0]
        image, user = shown.image, shown.image_user
        self._require_plain(shown)
        if image.source != "SEQUENCE":
            raise JobError(translate("Camera '{name}': '{image}' behind its view is no image sequence. Set its "
                                     "Source to Image Sequence.").format(name=camera.name, image=image.name))
        path = files.absolute(image.filepath)
        if re.search(r"\d+(?=\.\w+$)", path) is None:
            raise JobError(translate("Camera '{name}': {path} has no number at the end of its name.").format(
                name=camera.name, path=path))
        self.folder = os.path.dirname(os.path.dirname(os.path.dirname(path)))
        if self.drawn and SEEN in image and not _near(image[SEEN], _seen(scene, camera)):
            raise JobError(translate("Camera '{name}' was moved, or sees otherwise, since Render Take drew the "
                                     "pictures behind its view. Press Render Take again.").format(name=camera.name))
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

    def copy_into(self, folder):
        self.files = [(frame, files.copy(path, os.path.join(folder, os.path.basename(path))))
                      for frame, path in self.files]

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
