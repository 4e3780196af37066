# SPDX-License-Identifier: GPL-3.0-or-later
import bpy

from .. import jobs, laws
from ..compat import translate, translate_label
from ..io import fit_rows, fit_values, job_fit, number_text, takes
from ..io.words import short_label
from ..props import scene as scene_props
from . import fit_overlay
from .common import BOX, MatterfitPanel, form, holdout, lines, menu, switched


class MATTERFIT_UL_parameters(bpy.types.UIList):
    def draw_item(self, context, layout, _data, item, _icon, _active, _name, _index=0):
        settings = context.scene.matterfit
        quantity = fit_rows.quantity_of(settings, item)
        row = layout.row(align=True)
        row.prop(item, "enabled", text="")
        row = row.row()
        row.active = item.enabled and job_fit.takes_part(settings.fit, item.key)
        if quantity is None:
            row.label(text=item.name, icon="ERROR", translate=False)
            return
        row.label(text=_row_text(settings, item.owner, quantity), translate=False)


class MATTERFIT_PT_fit(MatterfitPanel, bpy.types.Panel):
    bl_label = "Fit"
    bl_order = 5

    def draw(self, context):
        layout = self.layout
        settings = context.scene.matterfit
        fit = settings.fit
        images = scene_props.has_images(settings)
        if not images or fit.law != "BODY":
            menu(form(layout), fit, "law")
        if images and fit.law != "BODY":
            lines(layout, translate("Laws are compared by points only: set Law to The Body's Law, or disable "
                                    "captures by images."), icon="ERROR")
        elif fit.law == "FIND":
            layout.column(align=True).prop(fit, "laws")
            lines(layout, translate("What distinguishes a law from the body's own is looked for as well."),
                  icon="INFO")
        elif fit.law == "UNKNOWN":
            lines(layout, translate("Its stiffness and what kind of material it is are looked for, "
                                    "whatever law the body has now."), icon="INFO")
        self._parameters(layout, settings, fit)
        if not scene_props.by_images_alone(settings):
            form(layout).prop(fit, "loss")
        self._captures(layout, settings)
        self._buttons(layout, context, fit)

    def _parameters(self, layout, settings, fit):
        row = layout.row()
        row.template_list("MATTERFIT_UL_parameters", "", fit, "parameters", fit,
                          "parameter_index", rows=5)
        row.operator("matterfit.list_parameters", text="", icon="FILE_REFRESH")
        item = scene_props.active_item(fit.parameters, fit.parameter_index)
        quantity = None if item is None else fit_rows.quantity_of(settings, item)
        if quantity is None:
            return
        column = form(layout)
        column.active = item.enabled
        label = translate_label(quantity.label)
        several = item.owner and not _of_only_body(settings, item.owner)
        lines(column, f"{item.owner}: {label}" if several else label)
        now = fit_values.value(settings, item.owner, item.key)
        if quantity.is_code:
            lines(column, translate("Eight numbers, looked for together from all kinds of material."),
                  icon="INFO")
            return
        if quantity.is_vector:
            row = column.row(align=True, heading="Axes")
            for axis, name in enumerate("XYZ"):
                row.prop(item, "axes", index=axis, text=name, toggle=True)
            self._start(column, item, "start_vector", translate("of the animation") if now is None
                        else ", ".join(number_text.short(component, 3) for component in now))
            switched(column, item, "use_bounds", "reach")
            self._prior(column, item, "mean_vector")
            return
        self._start(column, item, "start", number_text.short(now, 6))
        column.prop(item, "use_bounds")
        if item.use_bounds:
            pair = column.column(align=True)
            pair.prop(item, "low")
            pair.prop(item, "high")
        self._prior(column, item, "mean")

    def _prior(self, column, item, mean):
        column.prop(item, "use_prior")
        if item.use_prior:
            pair = column.column(align=True)
            pair.prop(item, mean)
            pair.prop(item, "sigma")

    def _start(self, column, item, name, now):
        """The switch, and the own start or what the scene has."""
        if item.use_start and name == "start_vector":
            column.prop(item, "use_start")
            column.prop(item, name, text="")
            return
        row = column.row(align=True, heading="Start")
        row.prop(item, "use_start", text="")
        if item.use_start:
            row.prop(item, name, text="")
        else:
            row.label(text=now, translate=False)

    def _captures(self, layout, settings):
        captures = [capture for capture in settings.captures if capture.enabled]
        if not captures:
            lines(layout, translate("There is no capture to fit to."), icon="ERROR")
        for capture in captures:
            box = layout.box()
            box.label(text=capture.name, icon="FILE" if capture.source == "FILE" else
                      "OBJECT_DATA", translate=False)
            holdout(form(box), capture)
        if captures and all(capture.holdout == "NONE" for capture in captures):
            lines(layout, translate("Nothing is held out: how well the fit predicts will not be "
                                    "known."), icon="INFO")

    def _buttons(self, layout, context, fit):
        row = layout.row(align=True)
        row.scale_y = 1.4
        row.operator("matterfit.check_fit", icon="CHECKMARK")
        row.operator("matterfit.fit", icon="VIEWZOOM")
        row = layout.row(align=True)
        row.operator("matterfit.resume_fit", text="Resume", icon="PLAY")
        row.operator("matterfit.free_fit", text="", icon="TRASH")
        layout.operator("matterfit.write_fit_job", icon="FILE_TICK")
        running = fit_overlay.running_fit(context.scene.matterfit)
        if running:
            self._progress(layout, running)
        if jobs.registry.running is not None:
            layout.operator("matterfit.cancel", icon="CANCEL")
        form(layout).prop(fit, "show_history")
        location = takes.locate(fit.run)
        if location.shared:
            lines(layout, translate("Linked, read-only: the fit of the scene that was copied. Fit "
                                    "makes a cache of this scene's own."), icon="LINKED")
        elif location.linked:
            lines(layout, translate("Linked, read-only: fitted by {file}. Fit makes a cache of "
                                    "this file's own.").format(file=fit.run.owner), icon="LINKED")

    def _progress(self, layout, folder):
        segments = fit_overlay.live_curve(folder)
        if not segments:
            return
        newest = segments[-1]
        if newest.of_images:
            words = translate("{stage}: misfit {share} % of the search's first step").format(
                stage=newest.stage, share=fit_overlay.percent(newest.errors[-1]))
        else:
            words = translate("{stage}: rms {error} mm").format(stage=newest.stage,
                                                                error=f"{newest.errors[-1]:.4g}")
        if newest.law:
            words = f"{laws.name_of(newest.law)}, {words}"
        lines(layout.box(), words, icon="TIME", taken=BOX)


class MATTERFIT_PT_fit_advanced(MatterfitPanel, bpy.types.Panel):
    bl_label = "Advanced"
    bl_parent_id = "MATTERFIT_PT_fit"
    bl_order = 2

    def draw(self, context):
        settings = context.scene.matterfit
        fit, images, weights = settings.fit, scene_props.has_images(settings), job_fit.has_weights(settings)
        column = form(self.layout)
        switched(column, fit, "use_huber", "huber")
        column.prop(fit, "iterations")
        if not images:
            self.layout.prop(fit, "windows")
            column = form(self.layout)
            column.prop(fit, "levels")
        if weights:
            column.prop(fit, "weight_steps")
        if not images and not (fit.weight_steps and weights):
            column.prop(fit, "correction_steps")
        column.prop(settings.solver, "threads")


def _row_text(settings, owner, quantity):
    """What it is, and whose where there are several: that stands last, as a row may be too short for
    both."""
    if not owner or _of_only_body(settings, owner):
        return short_label(quantity.label)
    return f"{short_label(quantity.row)} · {owner}"


def _of_only_body(settings, owner):
    bodies = [body.name for body in settings.bodies if body.role == "BODY"]
    return bodies == [owner]


CLASSES = (MATTERFIT_UL_parameters, MATTERFIT_PT_fit, MATTERFIT_PT_fit_advanced)
