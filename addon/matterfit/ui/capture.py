# SPDX-License-Identifier: GPL-3.0-or-later
import math

import bpy

from ..compat import translate
from ..io import camera_poses
from ..props import scene as scene_props
from .common import BOX, MatterfitPanel, form, holdout, lines, switched

ICONS = {"FILE": "FILE", "IMAGES": "IMAGE_DATA", "OBJECT": "OBJECT_DATA"}


class MATTERFIT_UL_captures(bpy.types.UIList):
    def draw_item(self, _context, layout, _data, item, _icon, _active, _name, _index=0):
        row = layout.row(align=True)
        row.prop(item, "name", text="", emboss=False,
                 icon=ICONS[item.source])
        row.prop(item, "enabled", text="")


class MATTERFIT_PT_capture(MatterfitPanel, bpy.types.Panel):
    bl_label = "Capture"
    bl_order = 1
    bl_options = set()

    def draw(self, context):
        layout = self.layout
        settings = context.scene.matterfit
        row = layout.row()
        row.template_list("MATTERFIT_UL_captures", "", settings, "captures", settings,
                          "capture_index", rows=2)
        column = row.column(align=True)
        column.operator("matterfit.import_capture", text="", icon="FILE_FOLDER")
        column.operator("matterfit.import_images", text="", icon="IMAGE_DATA")
        column.operator("matterfit.capture_cameras", text="", icon="CAMERA_DATA")
        column.operator("matterfit.add_capture_object", text="", icon="OBJECT_DATA")
        column.operator("matterfit.remove_capture", text="", icon="REMOVE")
        if not settings.captures:
            layout.operator("matterfit.import_capture", icon="IMPORT")
        capture = scene_props.active_capture(settings)
        if capture is not None:
            self._source(layout, settings, capture)
            if capture.source == "IMAGES":
                self._place_images(layout, capture)
            else:
                self._place(layout, capture)
            self._use(layout, capture)
            if capture.summary:
                box = layout.box()
                lines(box, capture.summary, taken=BOX)
        column = form(layout)
        column.separator()
        column.prop(settings.solver, "use_ground")
        if settings.solver.use_ground:
            column.prop(settings.solver, "ground_height")

    def _source(self, layout, settings, capture):
        column = form(layout)
        column.prop(capture, "source")
        if capture.source == "OBJECT":
            column.prop(capture, "object")
        else:
            column.prop(capture, "filepath")
        column.prop_search(capture, "body", settings, "bodies")
        if capture.source != "OBJECT":
            column.prop(capture, "unit")
            if capture.unit == "CUSTOM":
                column.prop(capture, "scale")
            column.prop(capture, "up")
            switched(column, capture, "use_fps", "fps")
            if capture.source == "IMAGES":
                column.prop(capture, "images", text="Images")
                switched(column, capture, "use_key", "key")
                if capture.use_key:
                    column.prop(capture, "key_range")
                switched(column, capture, "use_plate", "plate")
                if capture.use_plate:
                    column.prop(capture, "plate_threshold")
            else:
                column.prop(capture, "markers")
            layout.operator("matterfit.check_capture", icon="VIEWZOOM")

    def _place(self, layout, capture):
        column = form(layout)
        switched(column, capture, "use_start_frame", "start_frame")
        column.prop(capture, "align")
        if capture.align is None:
            column.prop(capture, "location")
            column.prop(capture, "rotation")
        switched(column, capture, "use_release", "release")

    def _place_images(self, layout, capture):
        column = form(layout)
        switched(column, capture, "use_start_frame", "start_frame")
        column.prop(capture, "location")
        column.prop(capture, "rotation")
        poses = camera_poses.read(capture.poses)
        if poses:
            self._poses(layout, poses)

    def _poses(self, layout, poses):
        """How far a fit has moved the cameras."""
        shift, turn, focal = camera_poses.largest(poses)
        box = layout.box()
        lines(box, translate("A fit moved the cameras: up to {shift} mm and {turn}°.").format(
            shift=f"{1e3 * shift:.3g}", turn=f"{math.degrees(turn):.2g}"), icon="CAMERA_DATA", taken=BOX)
        if focal > 0.0:
            lines(box, translate("Focal lengths: up to {share} % off.").format(
                share=f"{100.0 * focal:.2g}"), taken=BOX)
        box.operator("matterfit.forget_poses", icon="LOOP_BACK")

    def _use(self, layout, capture):
        column = form(layout)
        images = capture.source == "IMAGES"
        switched(column, capture, "use_noise", "noise_pixels" if images else "noise")
        if images:
            switched(column, capture, "use_colours", "colour_noise")
            self._refine(column, capture)
        holdout(column, capture)

    def _refine(self, column, capture):
        column.prop(capture, "refine_cameras", text="Refine")
        if capture.refine_cameras:
            column.prop(capture, "pose_shift")
            column.prop(capture, "pose_turn")
            column.prop(capture, "pose_focal", text="Focal")


CLASSES = (MATTERFIT_UL_captures, MATTERFIT_PT_capture)
