# SPDX-License-Identifier: GPL-3.0-or-later
import bpy

from .. import jobs
from ..compat import translate
from ..io import takes
from ..props import scene as scene_props
from .common import MatterfitPanel, form, lines


class MATTERFIT_PT_simulate(MatterfitPanel, bpy.types.Panel):
    bl_label = "Simulate"
    bl_order = 4
    bl_options = set()

    def draw(self, context):
        layout = self.layout
        settings = context.scene.matterfit
        session = context.window_manager.matterfit
        if not bpy.data.filepath:
            lines(layout, translate("Save the .blend file first: the cache lies beside it."),
                  icon="ERROR")
        take = scene_props.active_take(settings)
        if take is not None:
            lines(layout, take.name, icon="RENDER_ANIMATION")
            if take.frame_count:
                lines(layout, translate("frame {n} of {total}").format(
                    n=take.first_frame + max(take.frames_done, 1) - 1,
                    total=take.first_frame + take.frame_count - 1))
        row = layout.row(align=True)
        row.operator("matterfit.preview", icon="SHADING_BBOX")
        row.prop(session, "preview_scale", text="")
        row = layout.row(align=True)
        row.scale_y = 1.4
        row.operator("matterfit.bake", icon="RENDER_ANIMATION")
        row = layout.row(align=True)
        row.operator("matterfit.resume", icon="PLAY")
        row.operator("matterfit.free", icon="TRASH")
        if jobs.registry.running is not None:
            layout.operator("matterfit.cancel", icon="CANCEL")
        row = layout.row(align=True)
        row.operator("matterfit.estimate", icon="MEMORY")
        row.operator("matterfit.write_job", icon="FILE_TICK")
        if session.estimate:
            lines(layout, session.estimate, icon="INFO" if session.estimate_fits else "ERROR")
        if take is not None and take.folder and takes.locate(take).linked:
            lines(layout, translate("Linked, read-only: baked by {file}. Bake makes a cache of "
                                    "this file's own.").format(file=take.owner), icon="LINKED")
        form(layout).prop(settings.solver, "threads")


CLASSES = (MATTERFIT_PT_simulate,)
