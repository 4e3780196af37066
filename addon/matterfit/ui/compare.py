# SPDX-License-Identifier: GPL-3.0-or-later
import bpy

from ..compat import translate
from ..io import error_bands, number_text
from ..props import scene as scene_props
from .common import MatterfitPanel, form, lines


class MATTERFIT_UL_worst(bpy.types.UIList):
    def draw_item(self, _context, layout, _data, item, _icon, _active, _name, _index=0):
        row = layout.row()
        row.label(text=str(item.frame), translate=False)
        row.label(text=_digits(item.mean), translate=False)
        row.label(text=_digits(item.largest), translate=False)


class MATTERFIT_UL_worst_images(bpy.types.UIList):
    def draw_item(self, _context, layout, _data, item, _icon, _active, _name, _index=0):
        row = layout.row()
        row.label(text=str(item.frame), translate=False)
        row.label(text=str(item.camera), translate=False)
        row.label(text=f"{100.0 * item.iou:.1f}", translate=False)


class MATTERFIT_PT_compare(MatterfitPanel, bpy.types.Panel):
    bl_label = "Compare"
    bl_order = 6

    def draw(self, context):
        layout = self.layout
        settings = context.scene.matterfit
        compare = settings.compare
        layout.operator("matterfit.compare", icon="ARROW_LEFTRIGHT")
        if compare.images_done:
            self._images(layout, compare)
        if not compare.done:
            return
        box = layout.box()
        row = box.row()
        row.label(text="Mean")
        row.label(text=_error(compare, compare.mean_mm), translate=False)
        row = box.row()
        row.label(text="95 % Below")
        row.label(text=_error(compare, compare.p95_mm), translate=False)
        column = form(layout)
        column.prop(compare, "show_heatmap")
        column.prop(compare, "show_simulation", text="Simulation")
        column.prop(compare, "show_links", text="Lines")
        column.prop(compare, "show_graph", text="Graph")
        if compare.show_heatmap:
            column.prop(compare, "heat_unit", text="In")
            column.prop(compare, "significant_only", text="Significant")
            known = error_bands.of_fit(settings, scene_props.compared_capture(settings)) is not None
            if (compare.heat_unit == "SIGMA" or compare.significant_only) and not known:
                lines(layout, translate("What noise makes is not known: the fit was not diagnosed. Shown in "
                                        "millimetres, all of it."), icon="INFO")
            column.prop(compare, "range_mode")
            if compare.range_mode == "FIXED":
                in_sigma = compare.heat_unit == "SIGMA" and known
                column.prop(compare, "range_sigma" if in_sigma else "range_mm", text="Red At")
            column.prop(compare, "point_size", text="Point Size")
        layout.label(text="Worst Frames [mm]")
        row = layout.row()
        for title in ("Frame", "Mean", "Largest"):
            row.label(text=title)
        layout.template_list("MATTERFIT_UL_worst", "", compare, "worst", compare, "worst_index",
                             rows=4)

    def _images(self, layout, compare):
        """How outlines agree; where they do not."""
        if compare.images_held_out:
            self._agreement(layout.box(), compare, "", "Not Held Out")
            self._agreement(layout.box(), compare, "held_out_", "Held Out")
        else:
            self._agreement(layout.box(), compare, "")
        layout.operator("matterfit.show_overlays", icon="IMAGE_BACKGROUND")
        layout.label(text="Worst Images, Overlap [%]")
        row = layout.row()
        for title in ("Frame", "Camera", "Overlap"):
            row.label(text=title)
        layout.template_list("MATTERFIT_UL_worst_images", "", compare, "worst_images", compare,
                             "worst_image", rows=4)
        if 0 <= compare.worst_image < len(compare.worst_images):
            image = compare.worst_images[compare.worst_image]
            lines(layout, translate("{image}: {outside} pixels outside, {missing} missing").format(
                image=image.name, outside=image.outside, missing=image.missing))

    def _agreement(self, box, compare, prefix, title=""):
        """Of the images that are held out, or of the others."""
        if title:
            box.label(text=title)
        iou, contour, ratio, likeness = (getattr(compare, prefix + name)
                                         for name in ("iou", "contour_px", "psnr_db", "ssim"))
        rows = [("Overlap", f"{100.0 * iou:.1f} %" if iou >= 0.0 else "–"),
                ("Outlines Off", f"{contour:.2f} px" if contour >= 0.0 else "–")]
        if ratio > -1000.0:
            rows += [("Colours", f"{ratio:.1f} dB"), ("SSIM", f"{likeness:.3f}")]
        for name, value in rows:
            row = box.row()
            row.label(text=name)
            row.label(text=value, translate=False)


def _digits(error):
    """An error in the room of a list, a third of the sidebar: 0.031, 22.9, 1234, 2e+06."""
    if error >= 1e5:
        return f"{error:.0e}"
    return f"{error:.0f}" if error >= 100.0 else number_text.short(round(error, 3), 3)


def _error(compare, error):
    """An error [mm]; – where no point was seen, and so no frame is the worst."""
    return f"{error:.4g} mm" if compare.worst else "–"


CLASSES = (MATTERFIT_UL_worst, MATTERFIT_UL_worst_images, MATTERFIT_PT_compare)
