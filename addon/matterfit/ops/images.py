# SPDX-License-Identifier: GPL-3.0-or-later
"""Importing images with their cameras; drawing splats through Blender's camera."""

import os
import tempfile

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, StringProperty
from bpy_extras.io_utils import ImportHelper

from .. import jobs, native
from ..compat import translate
from ..io import blender_cameras, files, frames, job_images, transforms
from ..jobs import JobError
from ..props import choices
from .base import PlainOperator
from .capture import blend_relative, import_file
from .job_operator import JobOperator

SPLAT_KINDS = (".ply", ".splat", ".spz")


class MATTERFIT_OT_import_images(PlainOperator, bpy.types.Operator, ImportHelper):
    bl_idname = "matterfit.import_images"
    bl_label = "Import Images"
    bl_description = ("Add a recording by images: a transforms.json (Nerfstudio, Blender-NeRF) or "
                      "all_data.json (PAC-NeRF) with its images and mattes beside it, or a COLMAP "
                      "model, its folder or one of its files")

    filter_glob: StringProperty(default=";".join(("*.json", *job_images.COLMAP_FILES)),
                                options={"HIDDEN"})
    up: EnumProperty(name="Up Axis", default="AUTO", items=choices.UP_AXES,
                     description="Which axis of the cameras' world points up")
    cameras: BoolProperty(name="Add Cameras", default=True,
                          description="Add a camera object for each camera of the file, with its images "
                                      "behind what it sees")

    plate: StringProperty(
        name="Clean Plate", subtype="FILE_PATH",
        description="An image without the body, one of a numbered file a camera: mattes are what "
                    "differs from it. Empty: the images' own mattes")

    def act(self, context):
        path = self.filepath
        if os.path.isfile(path):
            name = os.path.basename(path)
            if not name.endswith(".json") and name not in job_images.COLMAP_FILES:
                raise JobError(translate(
                    "{path}: cameras are a .json file or a COLMAP model. Choose one of these."
                ).format(path=path))
        found = import_file(context, job_images.clip_name(path), path, source="IMAGES", up=self.up,
                            use_plate=bool(self.plate), plate=blend_relative(self.plate))
        if self.cameras:
            scene = context.scene
            capture = scene.matterfit.captures[scene.matterfit.capture_index]
            cameras = blender_cameras.add_cameras(scene, capture.name, found["places"])
            seconds = (found["times"] - 1) * scene.render.fps_base / scene.render.fps
            same_rate = abs(found["duration"] - seconds) < 0.01 * seconds
            blender_cameras.show_photographs(
                cameras, job_images.photographs(path, found["places"]),
                frames.frame_range(scene)[0], found["times"] if same_rate else 1)


class MATTERFIT_OT_render_splats(JobOperator, bpy.types.Operator, ImportHelper):
    bl_idname = "matterfit.render_splats"
    bl_label = "Render Splats"
    bl_description = ("Draw a file of Gaussian splats through the scene's camera into an image, "
                      "blended as they were trained, and show it behind the camera's view")

    filter_glob: StringProperty(default=";".join("*" + kind for kind in SPLAT_KINDS),
                                options={"HIDDEN"})
    up: EnumProperty(name="Up Axis", items=choices.FILE_UP_AXES, default="-Y",
                     description="What points up in the file")
    scale: FloatProperty(name="Scale", default=1.0, min=1e-9, soft_min=1e-3, max=1e9, soft_max=1e3,
                         precision=4, description="Metres that one unit of the file stands for")
    background: BoolProperty(name="Behind the Camera", default=True,
                             description="Show the image in the camera's view")

    def invoke(self, context, event):
        if self.filepath and os.path.isfile(self.filepath):
            return JobOperator.invoke(self, context, event)
        return ImportHelper.invoke(self, context, event)

    def begin(self, context):
        native.require()
        path = files.absolute(self.filepath)
        if os.path.splitext(path)[1].lower() not in SPLAT_KINDS or not os.path.isfile(path):
            raise JobError(translate("{path}: splats are {kinds} files. Choose one of them.").format(
                path=path, kinds=", ".join(SPLAT_KINDS)))
        scene = context.scene
        world = transforms.upright(self.up).to_matrix().to_4x4().inverted()
        folder = tempfile.mkdtemp(prefix="matterfit_splats_", dir=bpy.app.tempdir or None)
        shot = blender_cameras.shot(scene, scene.camera, "view", world,
                                    scene.unit_settings.scale_length / self.scale)
        files.write_json(os.path.join(folder, "transforms.json"), {"frames": [shot]})
        document = {"schema": "matterfit.job/1", "task": "render",
                    "render": {"cameras": "transforms.json", "gaussians": path},
                    "output": {"folder": "out"}}
        job_path = files.write_json(os.path.join(folder, "job.json"), document)
        threads = scene.matterfit.solver.threads

        def start():
            return native.start(job_path, task="render", threads=threads, restart=1)

        return jobs.Job(translate("Render Splats"), start, folder=folder)

    def ended(self, context, job):
        image = bpy.data.images.load(os.path.join(job.folder, "out", "render", "camera_0.png"))
        image.name = os.path.splitext(os.path.basename(self.filepath))[0]
        image.pack()
        for note in job.result["render"]["notes"]:
            self.report({"WARNING"}, note)
        if self.background:
            blender_cameras.set_background(context.scene.camera, image)


CLASSES = (MATTERFIT_OT_import_images, MATTERFIT_OT_render_splats)
