# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's cameras and those of files: lens and pose both ways."""

import os
import re

import bpy
from mathutils import Euler, Matrix, Vector

from ..compat import translate
from ..jobs import JobError
from ..props import reactions
from . import camera_poses
from .files import number, numbers
from .nodes import relative_path

SENSOR = 36.0
SAME = 1e-4  # of a camera's matrix and lens, beside where it is told to stand
# Properties of the cameras that we add: the capture and the number, matrix and lens by the file alone.
CAPTURE, NUMBER, PLACE, LENS = ("matterfit_capture", "matterfit_camera", "matterfit_place",
                                "matterfit_lens")

DRAWN = "matterfit_drawn"  # on an image: what Render Splats or Render Take has drawn
AWAY = "matterfit_away"  # on an image of a take that is not the active one


def image_size(scene):
    render = scene.render
    share = render.resolution_percentage / 100.0
    return max(1, int(render.resolution_x * share)), max(1, int(render.resolution_y * share))


def shot(scene, camera, name, world=None, scale=1.0, size=None):
    """One image of a `transforms.json` as Blender's camera takes it, of `size` pixels with the scene's
    aspect (None: of the scene's); `world` maps the scene to the world of what is drawn, `scale` is its
    metres in a unit."""
    if camera is None or camera.type != "CAMERA":
        raise JobError(translate("The scene has no camera. Add one, and look through it."))
    if camera.data.type != "PERSP":
        raise JobError(translate("Camera '{name}' is not a perspective one. Set its Type to "
                                 "Perspective.").format(name=camera.name))
    width, height = size or image_size(scene)
    corners = camera.data.view_frame(scene=scene)
    left, right = min(c.x for c in corners), max(c.x for c in corners)
    low, high = min(c.y for c in corners), max(c.y for c in corners)
    depth = -corners[0].z
    focal_x, focal_y = width * depth / (right - left), height * depth / (high - low)
    matrix = camera.matrix_world.copy()
    matrix.translation *= scale
    rotation = matrix.to_quaternion().to_matrix().to_4x4()
    matrix = (world or Matrix()) @ Matrix.Translation(matrix.translation) @ rotation
    return {"file_path": name, "transform_matrix": [numbers(row) for row in matrix],
            "w": width, "h": height, "fl_x": number(focal_x), "fl_y": number(focal_y),
            "cx": number(-left * width / (right - left)), "cy": number(high * height / (high - low))}


def add_cameras(capture, places):
    """Camera objects at the places of a capture's summary, in their order, in a collection of their own."""
    scene, name = capture.id_data, capture.name
    collection = bpy.data.collections.new(name)
    scene.collection.children.link(collection)
    units = 1.0 / scene.unit_settings.scale_length
    items = []
    for k, told in enumerate(places):
        data = bpy.data.cameras.new(f"{name} {k}")
        _set_lens(data, told)
        item = bpy.data.objects.new(data.name, data)
        item.matrix_world = _matrix(told, units)
        collection.objects.link(item)
        items.append(item)
    tag(items, capture)
    return items


def _set_lens(data, told):
    """That of a place of a summary."""
    width, height = told["width"], told["height"]
    longer = max(width, height)
    data.sensor_fit = "HORIZONTAL" if width >= height else "VERTICAL"
    data.sensor_width = data.sensor_height = SENSOR
    data.lens = SENSOR * (told["fx"] if width >= height else told["fy"]) / longer
    data.shift_x = (0.5 * width - told["cx"]) / longer
    data.shift_y = (told["cy"] - 0.5 * height) / longer


def _matrix(told, units):
    """Where a summary says that a camera stands."""
    matrix = Matrix(told["matrix"])
    matrix.translation *= units
    return matrix


def read_again(capture, places):
    """The capture's cameras stand where a new summary says: its unit, its up axis or its file is another."""
    units = 1.0 / capture.id_data.unit_settings.scale_length
    for k, item in of_capture(capture.id_data, capture.name).items():
        if k < len(places):
            item[PLACE] = [value for row in _matrix(places[k], units) for value in row]
            _set_lens(item.data, places[k])
            item[LENS] = item.data.lens
    place(capture)


def of_capture(scene, name):
    """{number: camera object} of those that were added for a capture; of one and its copies the one with the
    shortest name."""
    found = sorted(_tagged(scene, name), key=lambda item: (len(item.name), item.name), reverse=True)
    return {item[NUMBER]: item for item in found}


def _tagged(scene, name):
    return [item for item in scene.objects if item.type == "CAMERA" and item.get(CAPTURE) == name]


@reactions.capture_moved.done_by
def place(capture):
    """Moves the cameras of a capture to where their file, its location and rotation, and the poses that a
    fit has found say."""
    for item in of_capture(capture.id_data, capture.name).values():
        item.matrix_world, item.data.lens = _told(capture, item)


def _told(capture, item):
    """(matrix, lens) of a camera of a capture."""
    units = 1.0 / capture.id_data.unit_settings.scale_length
    poses, k = camera_poses.read(capture.poses), item[NUMBER]
    pose = poses[k] if k < len(poses) else {}
    told = list(item[PLACE])
    moved = Matrix.Translation(capture.location) @ Euler(capture.rotation).to_matrix().to_4x4()
    matrix = moved @ Matrix([told[row:row + 4] for row in range(0, 16, 4)])
    # The document's camera looks along z with y down, Blender's along −z with y up.
    x, y, z = pose.get("turn", (0.0, 0.0, 0.0))
    turn = Vector((x, -y, -z))
    if turn.length > 0.0:
        matrix = matrix @ Matrix.Rotation(turn.length, 4, turn.normalized())
    matrix.translation += Vector(pose.get("shift", (0.0, 0.0, 0.0))) * units
    return matrix, item[LENS] * (1.0 + pose.get("focal", 0.0))


def stands_as_told(capture, item):
    """Whether an object is a camera of the capture that stands and looks as that has it."""
    if item is None or item.get(CAPTURE) != capture.name:
        return False
    matrix, lens = _told(capture, item)
    seen = [value for row in item.matrix_world for value in row] + [item.data.lens]
    told = [value for row in matrix for value in row] + [lens]
    return all(abs(a - b) <= SAME * max(1.0, abs(b)) for a, b in zip(seen, told, strict=True))


@reactions.capture_renamed.done_by
def keep(capture):
    """The cameras of a capture are its cameras by another name too."""
    for item in _tagged(capture.id_data, capture.tagged) if capture.tagged else ():
        item[CAPTURE] = capture.name
    capture.tagged = capture.name if capture.tagged else ""


def let_go(capture):
    """The cameras of a capture are nobody's any more."""
    for item in _tagged(capture.id_data, capture.name):
        del item[CAPTURE]


def set_overlays(camera, paths):
    """Shows pictures with alpha over what the camera sees, each at its frame: {scene frame: path}."""
    first, last = min(paths), max(paths)
    image = bpy.data.images.load(paths[first], check_existing=True)
    image.source = "SEQUENCE"
    data = camera.data
    data.show_background_images = True
    ours = [shown for shown in data.background_images
            if shown.image is not None and shown.display_depth == "FRONT"
            and shown.image.source == "SEQUENCE" and AWAY not in shown.image]
    shown = ours[0] if ours else data.background_images.new()
    shown.image = image
    shown.alpha = 1.0
    shown.display_depth = "FRONT"
    shown.show_background_image = True
    _follow_frames(shown.image_user, first, first, last - first + 1)


def _follow_frames(user, frame, number, count):
    """Shows the file of that number at that scene frame, and `count` files in all, one a frame."""
    # The number of a file that is shown is frame − start + 1 + offset.
    user.frame_start = frame
    user.frame_offset = number - 1
    user.frame_duration = count
    user.use_auto_refresh = True


def show_sequence(camera, image, frame, count):
    """Shows an image and those that are numbered on from it behind what the camera sees, from `frame` on."""
    image.source = "SEQUENCE"
    shown = set_background(camera, image)
    _follow_frames(shown.image_user, frame, int(_number_of(image.filepath).group(1)), count)


def show_photographs(cameras, paths, first, count):
    """Each camera's photograph behind what it sees, {number of the camera: path}. Of `count` images a
    camera those that are numbered on follow frame by frame from `first`, unless what follows is another
    camera's first."""
    for k, path in paths.items():
        image = bpy.data.images.load(path)
        image.filepath = relative_path(path)
        shown = set_background(cameras[k], image)
        if image.source == "MOVIE":
            _follow_frames(shown.image_user, first, 1, count)
            continue
        following = numbered_on(path)
        if count < 2 or len(following) < count or set(following[1:count]) & set(paths.values()):
            continue
        image.source = "SEQUENCE"
        _follow_frames(shown.image_user, first, int(_number_of(path).group(1)), count)


def _number_of(path):
    """The digits before a file's ending, as group 1; None without any."""
    return re.search(r"(\d+)(?=\.\w+$)", path)


def numbered_on(path):
    """The files that there are from this one on, each numbered one higher."""
    paths = [path]
    found = _number_of(path)
    if found is None:
        return paths
    while True:
        following = numbered(path, int(found.group(1)) + len(paths))
        if not os.path.isfile(following):
            return paths
        paths.append(following)


def numbered(path, number):
    """The file of a sequence that has that number, with as many digits as `path` has at least."""
    found = _number_of(path)
    return f"{path[:found.start()]}{number:0{len(found.group(1))}d}{path[found.end():]}"


def tag(items, capture):
    """They are the cameras of the capture, in its order, and stand where its file says."""
    capture.tagged = capture.name
    for k, item in enumerate(items):
        item[CAPTURE], item[NUMBER] = capture.name, k
        item[PLACE] = [value for row in item.matrix_world for value in row]
        item[LENS] = item.data.lens


def set_background(camera, image):
    """Shows the image behind what the camera sees, in place of one that we set before, of splats that are
    drawn in place of those before; the camera's background image."""
    data = camera.data
    data.show_background_images = True
    ours = [shown for shown in data.background_images if shown.image == image]
    if image.get(DRAWN) and not ours:
        ours = backgrounds(camera)[1]
    shown = ours[0] if ours else data.background_images.new()
    shown.image = image
    shown.alpha = 1.0
    shown.display_depth = "BACK"
    shown.show_background_image = True
    return shown


def remove_background(data, image):
    """Shows the image in no view of the camera's any more; whether it was shown in one."""
    ours = [shown for shown in data.background_images if shown.image == image]
    for shown in ours:
        shown.image = None  # what is removed with its image would go on being its user
        data.background_images.remove(shown)
    return bool(ours)


def backgrounds(camera):
    """(photographs, drawn splats) among what is shown behind a camera's view; not of takes that are not the
    active one."""
    found = [shown for shown in camera.data.background_images
             if shown.display_depth == "BACK" and (shown.clip is not None or shown.image is not None
                                                   and AWAY not in shown.image)
             ] if camera is not None and camera.type == "CAMERA" else []
    drawn = [shown for shown in found if shown.image is not None and shown.image.get(DRAWN)]
    return [shown for shown in found if shown not in drawn], drawn


def flip(camera):
    """Photographs in place of drawn splats where these are shown, else the other way round."""
    photographs, drawn = backgrounds(camera)
    before = any(shown.show_background_image for shown in drawn) and camera.data.show_background_images
    camera.data.show_background_images = True
    for kind, seen in ((photographs, before), (drawn, not before)):
        for shown in kind:
            shown.show_background_image = seen
