# SPDX-License-Identifier: GPL-3.0-or-later
"""Importing images with their cameras; images behind the views of Blender's cameras as a capture."""

import itertools
import os
import shutil

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatVectorProperty, StringProperty
from bpy_extras.io_utils import ImportHelper

from ..compat import translate
from ..io import blender_cameras, camera_capture, camera_frames, files, frames, job_images, takes
from ..jobs import JobError
from ..names import unique
from ..props import choices
from .base import PlainOperator, greyed
from .capture import blend_relative, import_file


class MatteOptions:
    """How the capture that an operator adds gets its mattes."""

    plate: StringProperty(
        name="Clean Plate", subtype="FILE_PATH",
        description="An image without the body, one of a numbered file a camera: mattes are what "
                    "differs from it. Empty: the images' own mattes")
    use_key: BoolProperty(name="Key", default=False, description="Make mattes by the body's colour below")
    key: FloatVectorProperty(name="Key Colour", subtype="COLOR_GAMMA", size=3, default=(0.0, 0.4, 0.6), min=0.0,
                             max=1.0, description="The body's colour, as the images show it")

    def mattes(self):
        return {"use_plate": bool(self.plate), "plate": blend_relative(self.plate),
                "use_key": self.use_key, "key": self.key}


class MATTERFIT_OT_import_images(MatteOptions, PlainOperator, bpy.types.Operator, ImportHelper):
    bl_idname = "matterfit.import_images"
    bl_label = "Import Images"
    bl_description = ("Add a recording by images: a transforms.json (Nerfstudio, Blender-NeRF) or "
                      "all_data.json (PAC-NeRF) with its images and mattes beside it, or a COLMAP "
                      "model, its folder or one of its files")

    filter_glob: StringProperty(default=";".join(("*.json", *job_images.COLMAP_FILES)),
                                options={"HIDDEN"})
    up: EnumProperty(name="Up Axis", default="AUTO", items=choices.UP_AXES,
                     description="Which axis of the cameras' world points up")
    images: StringProperty(name="Image Folder", subtype="DIR_PATH",
                           description="Where the images lie. Empty: beside the cameras' file")
    cameras: BoolProperty(name="Add Cameras", default=True,
                          description="Add a camera object for each camera of the file, with its images "
                                      "behind what it sees")

    def act(self, context):
        path = self.filepath
        if os.path.isfile(path):
            name = os.path.basename(path)
            if not name.endswith(".json") and name not in job_images.COLMAP_FILES:
                raise JobError(translate(
                    "{path}: cameras are a .json file or a COLMAP model. Choose one of these."
                ).format(path=path))
        found = import_file(context, job_images.clip_name(path), path, source="IMAGES", up=self.up,
                            images=blend_relative(self.images), **self.mattes())
        if self.cameras:
            scene = context.scene
            capture = scene.matterfit.captures[scene.matterfit.capture_index]
            cameras = blender_cameras.add_cameras(capture, found["places"])
            seconds = (found["times"] - 1) * scene.render.fps_base / scene.render.fps
            same_rate = abs(found["duration"] - seconds) < 0.01 * seconds
            blender_cameras.show_photographs(
                cameras, job_images.photographs(path, found["places"], self.images),
                frames.frame_range(scene)[0], found["times"] if same_rate else 1)
            camera_frames.told(capture, found["places"])


class MATTERFIT_OT_capture_cameras(MatteOptions, PlainOperator, bpy.types.Operator):
    bl_idname = "matterfit.capture_cameras"
    bl_label = "Capture from Cameras"
    bl_description = ("Add a recording by the images behind the views of the scene's cameras (of the selected "
                      "ones where any has a sequence of images), as they stand: photographs, or where there are "
                      "none the pictures of Render Take; their file is written beside the .blend")

    name: StringProperty(name="Name", default="cameras", description="The capture's name")

    @classmethod
    def poll(cls, context):
        return greyed(cls, not camera_capture.cameras(context.scene),
                      "No camera of the scene has an image sequence behind its view")

    def invoke(self, context, _event):
        return context.window_manager.invoke_props_dialog(self)

    def act(self, context):
        takes.require_saved()
        scene = context.scene
        items = camera_capture.cameras(scene)
        name = unique(self.name, scene.matterfit.captures)
        folder = os.path.join(os.path.dirname(bpy.data.filepath), "cameras_" + files.safe_name(name))
        if os.path.exists(folder):  # another capture's, of a name that is written alike, or of before undo
            folder = next(other for n in itertools.count(2) if not os.path.exists(other := f"{folder}_{n}"))
        try:
            path, start, copies = camera_capture.write(scene, items, folder)
            found = import_file(context, name, path, source="IMAGES", **self.mattes())
        except JobError:
            shutil.rmtree(folder, ignore_errors=True)
            raise
        camera_capture.show_copies(copies)
        capture = scene.matterfit.captures[scene.matterfit.capture_index]
        if start != frames.frame_range(scene)[0]:
            capture.use_start_frame, capture.start_frame = True, start
        if len(found["places"]) == len(items):  # of one place and lens are one camera
            blender_cameras.tag(items, capture)
            camera_frames.told(capture, found["places"])


CLASSES = (MATTERFIT_OT_import_images, MATTERFIT_OT_capture_cameras)
