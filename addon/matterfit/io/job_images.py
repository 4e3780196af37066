# SPDX-License-Identifier: GPL-3.0-or-later
"""Captures by images, as the job document has them."""

import os
import re
import shutil
import tempfile

import bpy

from ..jobs import JobError
from . import camera_poses, files, job_captures, job_writer, readable_images
from .files import absolute, number, numbers

# Files of a COLMAP model; Import Images takes these beside a .json.
COLMAP_FILES = ("cameras.bin", "images.bin", "cameras.txt", "images.txt")


def clip_name(path):
    """What a clip is called by its cameras: their file's folder, of a COLMAP model the project's."""
    folder = path if os.path.isdir(path) else os.path.dirname(path)
    folder = os.path.abspath(folder)
    if os.path.isdir(path) or os.path.basename(path) in COLMAP_FILES:
        while re.fullmatch(r"sparse|\d+", os.path.basename(folder)):
            folder = os.path.dirname(folder)
    return os.path.basename(folder) or "images"


def photographs(cameras, places, images=""):
    """{number of a camera: its first image} of those that are found: in the folder `images`, or beside the
    file of the cameras, of a COLMAP model also in a folder 'images' there or up to two folders above."""
    cameras = os.path.abspath(cameras)
    beside = cameras if os.path.isdir(cameras) else os.path.dirname(cameras)
    folders = [absolute(images)] if images else [beside]
    if not images and not cameras.endswith(".json"):
        above = [beside, os.path.dirname(beside), os.path.dirname(os.path.dirname(beside))]
        folders += [os.path.join(place, "images") for place in above]
    found = {}
    for k, place in enumerate(places):
        paths = (os.path.join(base, place["image"]) for base in folders)
        path = next((path for path in paths if os.path.isfile(path)), None)
        if path:
            found[k] = path
    return found


def plate_files(path, where):
    """The clean plates that a file stands for, absolute: itself, or all that differ from it by the
    last number in their names, in the order of these; a name with # as it is."""
    if not path:
        raise JobError(f"{where}: no clean plate is chosen. Choose an image without the body, or switch "
                       "Clean Plate off.")
    path = absolute(path)
    if "#" in os.path.basename(path):
        return path
    if not os.path.isfile(path):
        raise JobError(f"{where}: the clean plate {path} does not exist. Was it moved?")
    folder, name = os.path.split(path)
    found = re.fullmatch(r"(.*?)(\d+)(\D*)", name)
    if found is None:
        return [path]
    same = re.compile(re.escape(found[1]) + r"(\d+)" + re.escape(found[3]))
    numbered = [(int(match[1]), other) for other in os.listdir(folder)
                if (match := same.fullmatch(other))]
    return [os.path.join(folder, other) for _number, other in sorted(numbered)]


def reading_options(capture, relative=str, put=None):
    """What the reader is told: unit, up axis, rate, where images lie, how mattes are made. `relative`
    makes an absolute path one of the document's; `put` is that of readable_images.cameras(), for what the
    library does not read (None: it is read where Blender puts it)."""
    document = job_captures.reading_options(capture)
    document.pop("markers", None)
    if capture.images:
        document["images"] = relative(absolute(capture.images))
    where = f"capture '{capture.name}'"
    if capture.use_plate and capture.use_key:
        raise JobError(f"{where}: Key and Clean Plate are both switched on. Switch one of them off.")
    if capture.use_key:
        document["key"] = {"colour": numbers(capture.key), "range": _key_range(capture, where)}
    if capture.use_plate:
        plates = plate_files(capture.plate, where)
        if isinstance(plates, str):
            document["plate"] = {"images": relative(plates)}
        else:
            document["plate"] = {"images": [_plate(capture, path, relative, put) for path in plates]}
        document["plate"]["threshold"] = number(capture.plate_threshold)
    return document


def _key_range(capture, where):
    low, high = numbers(capture.key_range)
    if low >= high:
        raise JobError(f"{where}: Key Range goes from {low:g} to {high:g}. Its second number is the larger one.")
    return [low, high]


def _prefix(capture):
    """For inputs of this capture alone: names that look alike in a file's name may be two captures'."""
    index = next(k for k, row in enumerate(capture.id_data.matterfit.captures) if row == capture)
    return f"{files.safe_name(capture.name)}_{index}"


def _plate(capture, path, relative, put):
    if not readable_images.is_foreign(path):
        return relative(path)
    ready = readable_images.converted(path)
    stem, ending = os.path.splitext(os.path.basename(path))[0], os.path.splitext(ready)[1]
    return put(f"plate_{_prefix(capture)}_{stem}{ending}", ready) if put else ready


def read_summary(capture, reader):
    """What `reader(path, options)` says of the capture's file; images keep their own names in it."""
    path, options = absolute(capture.filepath), reading_options(capture)
    originals = {}
    folder = tempfile.mkdtemp(prefix="matterfit_import_", dir=bpy.app.tempdir or None)
    try:
        ready = readable_images.cameras(path, options.get("images", ""), folder, lambda name, source: files.copy(
            source, os.path.join(folder, name)))
        if ready is not None:
            path, originals = ready
            options.pop("images", None)
        options["cameras"] = path
        render = capture.id_data.render
        options["scene_fps"] = render.fps / render.fps_base
        found = reader(path, options)
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    for place in found["places"]:
        place["image"] = originals.get(place["image"], place["image"])
    return found


def camera_numbers(text, where):
    found = [name.strip() for name in text.split(",") if name.strip()]
    if not found or not all(name.isdecimal() for name in found):
        raise JobError(f"{where}: no camera is named to be held out. Give their numbers, separated "
                       "by commas, or choose another Hold-out.")
    return [int(name) for name in found]


class ImagePart:
    """One capture while the document is written."""

    def __init__(self, writer, capture):
        self.writer = writer
        self.capture = capture
        self.where = f"capture '{capture.name}'"

    def document(self):
        capture, writer = self.capture, self.writer
        found = {"name": capture.name, "cameras": self._cameras()}
        found.update(reading_options(capture, writer.relative, writer.put_input))
        ready = readable_images.cameras(
            absolute(capture.filepath), absolute(capture.images) if capture.images else "",
            os.path.join(writer.folder, job_writer.INPUT_FOLDER), writer.put_input, _prefix(capture))
        if ready is not None:
            found["cameras"] = ready[0]
            found.pop("images", None)
        if capture.body:
            found["body"] = capture.body
        transform = job_captures.placement(capture, writer.scale)
        if transform is not None:
            found["transform"] = transform
        if capture.use_start_frame:
            found["start_frame"] = number(capture.start_frame)
        if capture.use_noise:
            found["noise"] = number(capture.noise_pixels)
        if capture.use_colours:
            found["colours"] = {"noise": number(capture.colour_noise)}
        if capture.refine_cameras:
            found["refine"] = {"shift": number(capture.pose_shift * writer.scale),
                               "turn": number(capture.pose_turn),
                               "focal": number(capture.pose_focal)}
        poses = camera_poses.read(capture.poses)
        if poses:
            found["poses"] = poses
        holdout = self._holdout()
        if holdout:
            found["holdout"] = holdout
        return found

    def _cameras(self):
        path = absolute(self.capture.filepath)
        if self.capture.filepath and os.path.isdir(path):
            return self.writer.relative(path)
        return self.writer.external(self.capture.filepath, self.where)

    def _holdout(self):
        capture = self.capture
        if capture.holdout == "CAPTURE":
            raise JobError(f"{self.where}: images are held out by frames or by cameras. Choose "
                           "Last Frames, or Cameras and name them.")
        found = job_captures.held_out_frames(capture, self.writer, self.where)
        if capture.holds_out_tracks:
            found["cameras"] = camera_numbers(capture.holdout_tracks, self.where)
        return found
