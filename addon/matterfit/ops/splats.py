# SPDX-License-Identifier: GPL-3.0-or-later
"""Files of Gaussian splats: shown in the viewport, drawn through Blender's camera, beside photographs."""

import os
import tempfile

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, StringProperty
from bpy_extras.io_utils import ImportHelper

from .. import jobs, native
from ..compat import translate
from ..io import blender_cameras, files, job_writer, splat_files, splat_preview, transforms
from ..io.files import number
from ..jobs import JobError
from ..props import choices
from ..props import scene as scene_props
from .base import PlainOperator, greyed
from .job_operator import JobOperator


class MATTERFIT_OT_show_splats(PlainOperator, bpy.types.Operator):
    bl_idname = "matterfit.show_splats"
    bl_label = "Show Splats"
    bl_description = ("Show the Gaussians of the active body's file as ellipsoids where the file lies, 20 000 at "
                      "most, to place and crop it; they follow Up Axis, Scale, Crop Box and Opacity, and are "
                      "not rendered. Pressed again it removes them. Their colours are seen in Material Preview, "
                      "and in Solid by the viewport's color Attribute, which is switched on")

    @classmethod
    def poll(cls, context):
        body = scene_props.active_body(context.scene.matterfit)
        return greyed(cls, body is None or body.source != "GAUSSIANS",
                      "The active body is not made from a Gaussians file")

    def act(self, context):
        body = scene_props.active_body(context.scene.matterfit)
        if splat_preview.shown(body) is not None:
            splat_preview.hide(body)
            return
        splat_preview.show(context.scene, body)
        space = context.space_data
        if space is not None and space.type == "VIEW_3D" and space.shading.type == "SOLID":
            space.shading.color_type = "VERTEX"


_UP_OF_FILE = ("AUTO", "From File", "Y of a .spz file, by its format; −Y of others, as in most trained scenes",
               "NONE", 3)


class MATTERFIT_OT_render_splats(JobOperator, bpy.types.Operator, ImportHelper):
    bl_idname = "matterfit.render_splats"
    bl_label = "Render Splats"
    bl_description = ("Draw a file of Gaussian splats through the scene's camera into an image, "
                      "blended as they were trained, and show it behind the camera's view")

    filter_glob: StringProperty(default=";".join("*" + kind for kind in splat_files.KINDS),
                                options={"HIDDEN"})
    up: EnumProperty(name="Up Axis", items=(_UP_OF_FILE, *choices.FILE_UP_AXES), default="AUTO",
                     options={"SKIP_SAVE"}, description="What points up in the file")
    scale: FloatProperty(name="Scale", default=1.0, min=1e-9, soft_min=1e-3, max=1e9, soft_max=1e3,
                         precision=4, description="Metres that one unit of the file stands for")
    crop: StringProperty(name="Crop Box", description="Gaussians outside of this object's bounds, along the "
                                                      "world's axes, are left out; empty: none",
                         options={"SKIP_SAVE"})
    opacity_threshold: FloatProperty(name="Opacity", default=0.0, min=0.0, soft_max=0.5, max=1.0,
                                     subtype="FACTOR", options={"SKIP_SAVE"},
                                     description="Gaussians with less opacity are left out")
    background: BoolProperty(name="Behind the Camera", default=True,
                             description="Show the image in the camera's view")

    def draw(self, context):
        column = self.layout.column()
        column.use_property_split = True
        column.use_property_decorate = False
        for name in ("up", "scale"):
            column.prop(self, name)
        column.prop_search(self, "crop", context.scene, "objects")
        for name in ("opacity_threshold", "background"):
            column.prop(self, name)

    def invoke(self, context, event):
        if self.filepath and os.path.isfile(self.filepath):
            return JobOperator.invoke(self, context, event)
        return ImportHelper.invoke(self, context, event)

    def begin(self, context):
        native.require()
        path = files.absolute(self.filepath)
        if os.path.splitext(path)[1].lower() not in splat_files.KINDS or not os.path.isfile(path):
            raise JobError(translate("{path}: splats are {kinds} files. Choose one of them.").format(
                path=path, kinds=", ".join(splat_files.KINDS)))
        scene, up = context.scene, self._up(path)
        world = transforms.upright(up).to_matrix().to_4x4().inverted()
        folder = tempfile.mkdtemp(prefix="matterfit_splats_", dir=bpy.app.tempdir or None)
        shot = blender_cameras.shot(scene, scene.camera, "view", world,
                                    scene.unit_settings.scale_length / self.scale)
        files.write_json(os.path.join(folder, "transforms.json"), {"frames": [shot]})
        render = {"cameras": "transforms.json", "gaussians": path}
        if self.crop:
            render["crop"] = self._crop(context, up)
        if self.opacity_threshold > 0.0:
            render["opacity_threshold"] = number(self.opacity_threshold)
        document = {"schema": "matterfit.job/1", "task": "render", "render": render,
                    "output": {"folder": "out"}}
        job_path = files.write_json(os.path.join(folder, "job.json"), document)
        threads = scene.matterfit.solver.threads

        def start():
            return native.start(job_path, task="render", threads=threads, restart=1)

        return jobs.Job(translate("Render Splats"), start, folder=folder)

    def _up(self, path):
        """The axis that is chosen, or that of the file's format."""
        if self.up != "AUTO":
            return self.up
        return "Y" if choices.has_y_up(path) else "-Y"

    def _crop(self, context, up):
        """Where the object stands now."""
        item = context.scene.objects.get(self.crop)
        if item is None:
            raise JobError(translate("The scene has no object '{name}' to crop by. Choose another one, or "
                                     "none.").format(name=self.crop))
        place = job_writer.Place()
        place.sample(item, context.evaluated_depsgraph_get())
        box = place.box(transforms.metres(context.scene))
        return splat_files.crop(box, up, self.scale, item.name, translate("Render Splats"))

    def ended(self, context, job):
        image = bpy.data.images.load(os.path.join(job.folder, "out", "render", "camera_0.png"))
        image.name = os.path.splitext(os.path.basename(self.filepath))[0]
        image.pack()
        image[blender_cameras.DRAWN] = True
        for note in job.result["render"]["notes"]:
            self.report({"WARNING"}, note)
        if self.background:
            blender_cameras.set_background(context.scene.camera, image)
        else:
            image.use_fake_user = True  # nothing shows it, and what nothing uses is not saved


class MATTERFIT_OT_flip_photograph(PlainOperator, bpy.types.Operator):
    bl_idname = "matterfit.flip_photograph"
    bl_label = "Photograph or Splats"
    bl_description = ("Show behind the camera's view the photograph in place of the rendered splats, and "
                      "pressed again the splats in place of the photograph. In the camera's view also by "
                      "Shift Alt B")

    @classmethod
    def poll(cls, context):
        camera = context.scene.camera
        photographs, drawn = blender_cameras.backgrounds(camera)
        return greyed(cls, not photographs or not drawn,
                      "The scene's camera needs a background image, and one of Render Splats")

    def invoke(self, context, event):
        view = context.region_data
        if event.type == "B" and (view is None or view.view_perspective != "CAMERA"):
            return {"PASS_THROUGH"}
        return self.execute(context)

    def act(self, context):
        blender_cameras.flip(context.scene.camera)
        if context.space_data is not None and context.space_data.type == "VIEW_3D":
            context.area.tag_redraw()


CLASSES = (MATTERFIT_OT_show_splats, MATTERFIT_OT_render_splats, MATTERFIT_OT_flip_photograph)
