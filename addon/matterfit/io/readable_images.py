# SPDX-License-Identifier: GPL-3.0-or-later
"""Images in formats that the library does not read, through Blender: a recording's cameras with PNG and
OpenEXR files in their place. Of a COLMAP model all images are read as they are."""

import os
import shutil
import tempfile

import bpy

from ..compat import translate
from ..jobs import JobError
from . import files

# Endings of what the library reads itself; a name without an ending is that of a .png.
READ = (".png", ".jpg", ".jpeg", ".exr", "")
MOVIES = tuple(bpy.path.extensions_movie) if hasattr(bpy.path, "extensions_movie") else (
    ".avi", ".mov", ".mp4", ".mkv", ".m4v", ".webm", ".mpg", ".mpeg", ".ogv")
KEYS = ("file_path", "mask_path")

_converted = {}  # (path, stamp of it, frame): our file in Blender's own temporary folder


def is_foreign(name):
    return os.path.splitext(name)[1].lower() not in READ


def is_movie(name):
    return os.path.splitext(name)[1].lower() in MOVIES


def cameras(path, images, folder, put, prefix=""):
    """(path, originals) of a file of the cameras in a .json whose images the library reads, None where it
    reads all of them as they are. Images lie in the folder `images`, "": beside the file. `put(name,
    source)` copies a file into `folder` and returns what the document calls it, as `path` is; `originals`
    are the images' own files by the names that they have in the new file. A movie stands for all its
    frames, at its own rate. Names begin with `prefix`, "": the name of the file's folder."""
    if not path.lower().endswith(".json") or not os.path.isfile(path):
        return None
    document = files.read_json(path)
    shots = document.get("frames") if isinstance(document, dict) else document
    if not isinstance(shots, list) or not any(_foreign_keys(shot) for shot in shots):
        return None
    base = images or os.path.dirname(os.path.abspath(path))
    originals, found = {}, []
    prefix = prefix or files.safe_name(os.path.basename(os.path.dirname(os.path.abspath(path))))
    for shot in shots:
        movie = isinstance(shot, dict) and is_movie(str(shot.get("file_path", "")))
        count, fps = movie_length(os.path.join(base, shot["file_path"])) if movie else (1, 1.0)
        for n in range(count):
            one = dict(shot) if isinstance(shot, dict) else shot
            for key in _named_keys(one):
                source = os.path.join(base, one[key])
                if is_foreign(one[key]):
                    name = f"{prefix}_{len(found)}_{_stem(one[key], n if is_movie(one[key]) else None)}"
                    ready = converted(source, n + 1 if is_movie(one[key]) else 0)
                    one[key] = os.path.basename(put(name + os.path.splitext(ready)[1], ready))
                else:
                    one[key] = relative(source, folder)
                if key == "file_path":
                    originals[one[key]] = source
            if movie:
                one["time"] = float(shot.get("time", 0.0)) + n / fps
            found.append(one)
    written = {**document, "frames": found} if isinstance(document, dict) else found
    scratch = tempfile.mkdtemp(prefix="matterfit_cameras_", dir=bpy.app.tempdir or None)
    made = files.write_json(os.path.join(scratch, os.path.basename(path)), written)
    try:
        return put(f"{prefix}_{os.path.basename(path)}", made), originals
    finally:
        shutil.rmtree(scratch, ignore_errors=True)


def relative(path, folder):
    try:
        return os.path.relpath(path, folder).replace(os.sep, "/")
    except ValueError:  # another drive on Windows
        return os.path.abspath(path).replace(os.sep, "/")


def _named_keys(shot):
    return [key for key in KEYS if isinstance(shot, dict) and isinstance(shot.get(key), str)]


def _foreign_keys(shot):
    return [key for key in _named_keys(shot) if is_foreign(shot[key])]


def _stem(name, frame):
    """The file's own name, at whose end a number says its time; of a movie with the frame's number."""
    stem = os.path.splitext(os.path.basename(name))[0]
    return stem if frame is None else f"{stem}_{frame + 1:05d}"


def converted(path, frame=0):
    """A file that Blender reads as PNG, or OpenEXR where it has more than eight bits; of a movie its
    `frame`, from 1. It lies in Blender's temporary folder for as long as Blender runs."""
    if not os.path.isfile(path):
        raise JobError(translate("{path}: the image does not exist. Was it moved?").format(path=path))
    key = (path, files.stamp(path), frame)
    if key not in _converted or not os.path.isfile(_converted[key]):
        folder = tempfile.mkdtemp(prefix="matterfit_image_", dir=bpy.app.tempdir or None)
        _converted[key] = _movie_frame(path, frame, folder) if frame else _image(path, folder)
    return _converted[key]


def _unreadable(path):
    return JobError(translate("{path}: Blender could not read it. Is it damaged, or of another format than "
                              "its name says?").format(path=path))


def _image(path, folder):
    try:
        image = bpy.data.images.load(path, check_existing=False)
    except RuntimeError as error:
        raise _unreadable(path) from error
    try:
        if not len(image.pixels) or not image.has_data:  # what is broken has none
            raise _unreadable(path)
        target = os.path.join(folder, "image" + (".exr" if image.is_float else ".png"))
        image.filepath_raw = target
        image.file_format = "OPEN_EXR" if image.is_float else "PNG"
        image.save()
        return target
    except RuntimeError as error:
        raise _unreadable(path) from error
    finally:
        bpy.data.images.remove(image)


def movie_length(path):
    """(frames, frames a second) of a movie."""
    if not os.path.isfile(path):
        raise JobError(translate("{path}: the image does not exist. Was it moved?").format(path=path))
    try:
        clip = bpy.data.movieclips.load(path)
    except RuntimeError as error:
        raise _unreadable(path) from error
    count, fps = clip.frame_duration if min(clip.size) > 0 else 0, clip.fps
    bpy.data.movieclips.remove(clip)
    if count < 1 or not fps > 0.0:
        raise _unreadable(path)
    return count, fps


def _movie_frame(path, frame, folder):
    """A movie's pixels are had by no call of Blender's but a render: a scene of its own shows the frame."""
    clip = bpy.data.movieclips.load(path)
    scene = bpy.data.scenes.new("Matterfit Movie")
    try:
        scene.render.resolution_x, scene.render.resolution_y = clip.size
        scene.render.resolution_percentage = 100
        scene.render.image_settings.file_format = "PNG"
        scene.view_settings.view_transform = "Standard"
        scene.render.filepath = os.path.join(folder, "image.png")
        scene.render.use_file_extension = False
        editor = scene.sequence_editor_create()
        strips = editor.strips if hasattr(editor, "strips") else editor.sequences
        strips.new_movie(name="movie", filepath=path, channel=1, frame_start=1)
        scene.frame_set(frame)
        bpy.ops.render.render(write_still=True, scene=scene.name)
    except RuntimeError as error:
        raise _unreadable(path) from error
    finally:
        bpy.data.scenes.remove(scene)
        bpy.data.movieclips.remove(clip)
    if not os.path.isfile(os.path.join(folder, "image.png")):
        raise _unreadable(path)
    return os.path.join(folder, "image.png")
