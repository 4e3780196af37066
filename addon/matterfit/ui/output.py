# SPDX-License-Identifier: GPL-3.0-or-later
import os

import bpy

from .. import jobs, laws
from ..compat import translate, translate_label
from ..io import attached, cache, takes
from ..props import scene as scene_props
from .common import BOX, MatterfitPanel, lines, switched

ICONS = 40.0  # of an object in the list: viewport and render [pixels]


class MATTERFIT_PT_output(MatterfitPanel, bpy.types.Panel):
    bl_label = "Output"
    bl_order = 8

    def draw(self, context):
        layout = self.layout
        settings = context.scene.matterfit
        output = settings.output
        column = layout.column(heading="OpenVDB")
        column.use_property_split = True
        column.use_property_decorate = False
        for name in ("density", "velocity", "surface"):
            column.prop(output, name)
        if output.surface:
            column.prop(output, "surface_smoothing")
            column.prop(output, "surface_offset")
        switched(column, output, "use_voxel_size", "voxel_size")
        column = layout.column(heading="Caches")
        column.use_property_split = True
        column.use_property_decorate = False
        for name in ("mesh", "points", "splats"):
            column.prop(output, name)
            if name == "points" and output.points and laws.any_granular(settings.bodies):
                column.prop(output, "grains")
        if output.splats and any(body.source == "GAUSSIANS" for body in settings.bodies):
            column.prop(output, "splat_format")
        column = layout.column(heading="Attributes")
        column.use_property_split = True
        column.use_property_decorate = False
        column.enabled = output.points
        for name in ("velocity_attribute", "plastic_strain", "volume_ratio", "stretch"):
            column.prop(output, name)
        take = scene_props.active_take(settings)
        if take is not None and take.folder:
            self._cache(layout, context, take)
        layout.operator("matterfit.render_take", icon="RENDER_ANIMATION")
        layout.operator("matterfit.render_splats", icon="RENDER_STILL")
        layout.operator("matterfit.flip_photograph", icon="ARROW_LEFTRIGHT")
        row = layout.row(align=True)
        row.operator("matterfit.export_alembic", text="Alembic", icon="EXPORT")
        row.operator("matterfit.export_usd", text="USD", icon="EXPORT")

    def _cache(self, layout, context, take):
        session = context.window_manager.matterfit
        location = takes.locate(take)
        box = layout.box()
        lines(box, location.folder if location.linked else take.folder, icon="FILE_FOLDER", taken=BOX)
        if not location.exists:
            box.label(text="The folder does not exist", icon="ERROR")
            return
        total = 0
        for kind, title in (("volume", "Volumes"), ("mesh", "Meshes"), ("points", "Particles"),
                            ("attributes", "Attributes"), ("splat", "Splats"), ("state", "States")):
            size, count = _sizes(os.path.join(location.folder, kind))
            total += size
            if not count:
                continue
            row = box.row(align=True)
            row.label(text=f"{translate_label(title)}: {count} · {jobs.size_text(size)}",
                      translate=False)
            if kind != "state":
                row.operator("matterfit.remove_output", text="", icon="TRASH").kind = kind
        box.label(text=translate("{size} on disk").format(size=jobs.size_text(total)),
                  translate=False)
        row = box.row(align=True)
        row.operator("matterfit.verify", icon="CHECKMARK")
        row.operator("matterfit.open_folder", icon="FILEBROWSER")
        if session.verify:
            lines(box, session.verify, taken=BOX)
        if take.collection is not None:
            for item in take.collection.objects:
                if item.get(attached.TAG):
                    row = box.row(align=True)
                    lines(row, item.name, taken=ICONS + BOX)
                    row.prop(item, "hide_viewport", text="", emboss=False)
                    row.prop(item, "hide_render", text="", emboss=False)


_known = {}


def _sizes(folder):
    """(bytes, files); the disk is asked again only when the folder has changed."""
    try:
        stamp = os.stat(folder).st_mtime_ns
    except OSError:
        return 0, 0
    if _known.get(folder, (None,))[0] != stamp:
        _known[folder] = (stamp, cache.size_of(folder))
    return _known[folder][1]


CLASSES = (MATTERFIT_PT_output,)
