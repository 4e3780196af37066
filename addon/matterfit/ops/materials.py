# SPDX-License-Identifier: GPL-3.0-or-later
"""What becomes of a fitted material: Apply, Save Material, presets of one's own; and relaxation."""

import os

import bpy
from bpy.props import StringProperty
from bpy_extras.io_utils import ExportHelper, ImportHelper

from .. import library
from ..compat import translate
from ..io import files, fit_apply, fit_results, fit_rows, material_values, presets, takes
from ..jobs import JobError
from ..props import compare
from ..props import scene as scene_props
from .base import NoJobRunning, PlainOperator, greyed, session


class _HasResult(NoJobRunning):
    @classmethod
    def poll(cls, context):
        fit = context.scene.matterfit.fit
        return super().poll(context) and greyed(
            cls, not fit.done or not fit.run.folder, "There is no result: press Fit first")


def result_folder(context):
    """The fit's cache folder, or JobError."""
    location = takes.locate(context.scene.matterfit.fit.run)
    if not location.exists:
        raise JobError(translate("{folder} does not exist. Was the cache moved? Put it back, or fit "
                                 "again.").format(folder=location.folder))
    return location.folder


def fitted_material(context):
    """The document of the active body's fitted material, checked; of the only one where no body is
    active."""
    body = scene_props.active_body(context.scene.matterfit)
    name = body.name if body is not None and body.role == "BODY" else ""
    return fit_results.material(result_folder(context), name)


def material_name(context):
    """What a dialog proposes."""
    try:
        return str(fitted_material(context)["name"])
    except JobError:
        return context.scene.matterfit.fit.run.name


def tell(operator, context, words, warnings):
    """Reports what was done, and what speaks against it."""
    warnings = [sentence for sentence in warnings if sentence]
    session(context).last_report = "\n".join([words, *warnings])
    operator.report({"INFO"}, words)
    for sentence in warnings:
        operator.report({"WARNING"}, sentence)


class MATTERFIT_OT_apply_fit(_HasResult, PlainOperator, bpy.types.Operator):
    bl_idname = "matterfit.apply_fit"
    bl_label = "Apply to Body"
    bl_description = ("Put the fitted values where they belong, so that bakes use them: materials "
                      "and densities into Bodies, velocities and placements into the take's throw "
                      "(else into Bodies, and the object is moved), gravity into the take or "
                      "Solver, ground and colliders, the frame at which a capture begins, how its "
                      "cameras stand")

    def act(self, context):
        scene = context.scene
        settings = scene.matterfit
        folder = result_folder(context)
        left = fit_apply.apply_run(scene, folder)
        compare.forget(settings)
        words = translate("The fitted values are set. Bake or Compare uses them")
        if fit_results.is_unfinished(folder):
            words += "\n" + translate("The fit is unfinished, and begins at other values now: undo "
                                      "this before Resume")
        tell(self, context, words, left)


class MATTERFIT_OT_save_material(_HasResult, PlainOperator, bpy.types.Operator, ExportHelper):
    bl_idname = "matterfit.save_material"
    bl_label = "Save Material"
    bl_description = ("Write the active body's fitted material to a file, with where it comes "
                      "from")
    bl_options = set()

    filename_ext = ".json"
    filter_glob: StringProperty(default="*.json", options={"HIDDEN"})

    def invoke(self, context, event):
        if not self.filepath:
            self.filepath = files.safe_name(material_name(context)) + ".json"
        return ExportHelper.invoke(self, context, event)

    def act(self, context):
        document = fitted_material(context)
        path = bpy.path.ensure_ext(bpy.path.abspath(self.filepath), ".json")
        name = os.path.splitext(os.path.basename(path))[0]
        presets.write(path, document, name)
        tell(self, context, path, [presets.warning(document)])


class MATTERFIT_OT_load_material(PlainOperator, bpy.types.Operator, ImportHelper):
    bl_idname = "matterfit.load_material"
    bl_label = "Load Material"
    bl_description = "Give the active body the material in a file that Save Material wrote"

    filename_ext = ".json"
    filter_glob: StringProperty(default="*.json", options={"HIDDEN"})

    @classmethod
    def poll(cls, context):
        body = scene_props.active_body(context.scene.matterfit)
        return greyed(cls, body is None or body.role != "BODY",
                      "Choose a body in the list: colliders have no material")

    def act(self, context):
        path = bpy.path.abspath(self.filepath)
        document = presets.read(path)
        body = scene_props.active_body(context.scene.matterfit)
        body.material.preset = "CUSTOM"
        material_values.fill(body.material, document["material"], presets.like_of(document),
                             document.get("excited"))
        body.material.source = document["source"]
        body.density = document["density"]
        tell(self, context, translate("'{name}' is loaded").format(name=document["name"]),
              [presets.warning(document)])


class MATTERFIT_OT_add_preset(_HasResult, PlainOperator, bpy.types.Operator):
    bl_idname = "matterfit.add_preset"
    bl_label = "Add to Presets"
    bl_description = ("Keep the active body's fitted material as a preset of your own, for every "
                      "scene")
    bl_options = set()

    name: StringProperty(name="Name", default="", options={"SKIP_SAVE"},
                         description="What it is called in the list of presets")

    def invoke(self, context, _event):
        self.name = self.name or material_name(context)
        return context.window_manager.invoke_props_dialog(self)

    def draw(self, _context):
        self.layout.prop(self, "name")

    def act(self, context):
        name = self.name.strip()
        if not name:
            raise JobError(translate("Add to Presets: no name is given. Type one."))
        document = fitted_material(context)
        presets.add(document, name)
        words = translate("'{name}' is among the material presets").format(name=name)
        tell(self, context, words, [presets.warning(document)])


class MATTERFIT_OT_remove_preset(PlainOperator, bpy.types.Operator):
    bl_idname = "matterfit.remove_preset"
    bl_label = "Remove Preset"
    bl_description = "Delete the body's preset, which is one of your own; bodies keep its values"
    bl_options = set()

    @classmethod
    def poll(cls, context):
        body = scene_props.active_body(context.scene.matterfit)
        return greyed(cls, body is None or not presets.is_users(body.material.preset),
                      "The body's preset is not one of your own")

    def invoke(self, context, event):
        return context.window_manager.invoke_confirm(self, event)

    def act(self, context):
        presets.remove(scene_props.active_body(context.scene.matterfit).material.preset)


class MATTERFIT_OT_add_branch(PlainOperator, bpy.types.Operator):
    bl_idname = "matterfit.add_branch"
    bl_label = "Add Branch"
    bl_description = "Add a Maxwell branch to the active body's material: a stiffness that relaxes"

    @classmethod
    def poll(cls, context):
        body = scene_props.active_body(context.scene.matterfit)
        return greyed(cls, body is None or len(body.material.maxwell) >= library.MOST_BRANCHES,
                      "The solver takes no more branches")

    def act(self, context):
        settings = context.scene.matterfit
        material = scene_props.active_body(settings).material
        branch = material.maxwell.add()
        branch.name = f"{translate('Branch')} {len(material.maxwell)}"
        branch.modulus = 0.1 * material.E
        material.maxwell_index = len(material.maxwell) - 1
        fit_rows.refresh(settings)


class MATTERFIT_OT_remove_branch(PlainOperator, bpy.types.Operator):
    bl_idname = "matterfit.remove_branch"
    bl_label = "Remove Branch"
    bl_description = "Remove the active Maxwell branch"

    @classmethod
    def poll(cls, context):
        body = scene_props.active_body(context.scene.matterfit)
        return greyed(cls, body is None or not body.material.maxwell, "There is no branch")

    def act(self, context):
        settings = context.scene.matterfit
        material = scene_props.active_body(settings).material
        index = min(material.maxwell_index, len(material.maxwell) - 1)
        material.maxwell.remove(index)
        material.maxwell_index = max(0, index - 1)
        fit_rows.branch_removed(settings, scene_props.active_body(settings).name, index)


CLASSES = (MATTERFIT_OT_apply_fit, MATTERFIT_OT_save_material, MATTERFIT_OT_load_material,
           MATTERFIT_OT_add_preset, MATTERFIT_OT_remove_preset, MATTERFIT_OT_add_branch,
           MATTERFIT_OT_remove_branch)
