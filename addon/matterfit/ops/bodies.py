# SPDX-License-Identifier: GPL-3.0-or-later
"""The Bodies list, pins and masses."""

import bpy
from bpy.props import EnumProperty, IntProperty

from ..compat import translate
from ..io import attached, fit_rows, frames, motion, presets, resolution, splat_preview, visibility
from ..jobs import JobError
from ..names import for_file, unique
from ..props import scene as scene_props
from .base import PlainOperator, greyed, remove_active

USABLE = {"MESH", "CURVE", "SURFACE", "META", "FONT"}


def add_body(settings, item, role):
    """A row for the object; the first preset is Jelly, so that it moves at once."""
    name = unique(for_file(item.name) if item is not None else translate("Body"), settings.bodies)
    body = settings.bodies.add()
    body.name = name
    body.role = role
    body.object = item
    if role == "BODY":
        body.material.preset = "JELLY"
        if item is not None and motion.is_keyed(item):
            body.velocity_from = "ANIMATION"
    settings.body_index = len(settings.bodies) - 1
    return body


class MATTERFIT_OT_add_body(PlainOperator, bpy.types.Operator):
    bl_idname = "matterfit.add_body"
    bl_label = "Add Body"
    bl_description = "Make the selected objects bodies or colliders of the simulation"

    role: EnumProperty(
        name="Role", default="BODY", description="Simulated, or run into",
        items=(("BODY", "Body", "Simulated"), ("COLLIDER", "Collider", "Bodies run into it")))

    def act(self, context):
        settings = context.scene.matterfit
        chosen = [item for item in context.selected_objects if item.type in USABLE
                  or (self.role == "COLLIDER" and item.type == "EMPTY")]
        used = {body.object for body in settings.bodies if body.object is not None}
        chosen = [item for item in chosen if item not in used]
        if not chosen:
            raise JobError(translate("No new object with a surface is selected. Select one that "
                                     "is not in the list."))
        for item in chosen:
            attached.refuse(item, translate("Bodies"))
        for item in sorted(chosen, key=lambda other: other.name):
            body = add_body(settings, item, self.role)
            if item.type == "EMPTY":
                body.collider_shape = "PLANE"
        resolution.apply_quality(settings.solver, context.scene)


class MATTERFIT_OT_add_body_file(PlainOperator, bpy.types.Operator):
    bl_idname = "matterfit.add_body_file"
    bl_label = "Add Body from File"
    bl_description = "Add a body made from a points file or from 3D Gaussians"

    def act(self, context):
        body = add_body(context.scene.matterfit, None, "BODY")
        body.source = "POINTS"


class _ActiveBody:
    @classmethod
    def poll(cls, context):
        return greyed(cls, scene_props.active_body(context.scene.matterfit) is None,
                      "Add a body first")


class MATTERFIT_OT_remove_body(_ActiveBody, PlainOperator, bpy.types.Operator):
    bl_idname = "matterfit.remove_body"
    bl_label = "Remove Body"
    bl_description = "Remove the active body from the list; the object stays"

    def act(self, context):
        settings = context.scene.matterfit
        body = scene_props.active_body(settings)
        if body.object is not None:
            visibility.show_original(body.object)
            visibility.hide_results(settings, body)
        splat_preview.hide(body)
        remove_active(settings, "bodies", "body_index")
        fit_rows.refresh(settings)
        resolution.flow_changed(context.scene)


class MATTERFIT_OT_move_body(PlainOperator, bpy.types.Operator):
    bl_idname = "matterfit.move_body"
    bl_label = "Move Body"
    bl_description = "Move the active body up or down in the list"

    step: IntProperty(name="Step", default=1, min=-1, max=1, description="-1 is up, 1 is down")

    def act(self, context):
        settings = context.scene.matterfit
        target = settings.body_index + self.step
        if 0 <= target < len(settings.bodies):
            settings.bodies.move(settings.body_index, target)
            settings.body_index = target
            fit_rows.refresh(settings)


class MATTERFIT_OT_add_pin(_ActiveBody, PlainOperator, bpy.types.Operator):
    bl_idname = "matterfit.add_pin"
    bl_label = "Add Pin"
    bl_description = "Hold or move a region of the active body"

    def act(self, context):
        body = scene_props.active_body(context.scene.matterfit)
        pin = body.pins.add()
        pin.name = f"{translate('Pin')} {len(body.pins)}"
        item = body.object
        if item is not None and item.type == "MESH" and item.vertex_groups:
            pin.vertex_group = (item.vertex_groups.active or item.vertex_groups[0]).name
        else:
            pin.kind = "PLANE"
        scale = 2.0 * context.scene.matterfit.solver.particle_separation
        pin.radius = scale
        body.pin_index = len(body.pins) - 1
        fit_rows.hold(context.scene.matterfit, body.name)


class MATTERFIT_OT_remove_pin(_ActiveBody, PlainOperator, bpy.types.Operator):
    bl_idname = "matterfit.remove_pin"
    bl_label = "Remove Pin"
    bl_description = "Remove the active pin"

    def act(self, context):
        remove_active(scene_props.active_body(context.scene.matterfit), "pins", "pin_index")


class MATTERFIT_OT_add_mass(_ActiveBody, PlainOperator, bpy.types.Operator):
    bl_idname = "matterfit.add_mass"
    bl_label = "Add Mass"
    bl_description = "Hang a point mass on the active body; the active empty says where"

    def act(self, context):
        body = scene_props.active_body(context.scene.matterfit)
        mass = body.masses.add()
        mass.name = f"{translate('Mass')} {len(body.masses)}"
        item = context.active_object
        if item is not None and item.type == "EMPTY":
            mass.object = item
        body.mass_index = len(body.masses) - 1


class MATTERFIT_OT_remove_mass(_ActiveBody, PlainOperator, bpy.types.Operator):
    bl_idname = "matterfit.remove_mass"
    bl_label = "Remove Mass"
    bl_description = "Remove the active mass"

    def act(self, context):
        remove_active(scene_props.active_body(context.scene.matterfit), "masses", "mass_index")


def unpaired(settings):
    """The first two bodies whose contact is not in the list, or None."""
    names = [body.name for body in settings.bodies if body.role == "BODY"]
    listed = {frozenset((pair.first, pair.second)) for pair in settings.pairs}
    return next(((first, second) for place, first in enumerate(names)
                 for second in names[place + 1:] if frozenset((first, second)) not in listed), None)


class MATTERFIT_OT_add_pair(PlainOperator, bpy.types.Operator):
    bl_idname = "matterfit.add_pair"
    bl_label = "Add Contact"
    bl_description = "Set how two bodies touch each other"

    @classmethod
    def poll(cls, context):
        return greyed(cls, unpaired(context.scene.matterfit) is None,
                      "There are no two bodies whose contact is not set yet")

    def act(self, context):
        settings = context.scene.matterfit
        first, second = unpaired(settings)
        pair = settings.pairs.add()
        pair.first, pair.second = first, second
        settings.pair_index = len(settings.pairs) - 1


class MATTERFIT_OT_remove_pair(PlainOperator, bpy.types.Operator):
    bl_idname = "matterfit.remove_pair"
    bl_label = "Remove Contact"
    bl_description = "The two bodies touch as the solver has it by itself again"

    @classmethod
    def poll(cls, context):
        return greyed(cls, not context.scene.matterfit.pairs, "There is no contact in the list")

    def act(self, context):
        remove_active(context.scene.matterfit, "pairs", "pair_index")


class MATTERFIT_OT_reset_material(_ActiveBody, PlainOperator, bpy.types.Operator):
    bl_idname = "matterfit.reset_material"
    bl_label = "Reset to Preset"
    bl_description = "Fill in the preset's values again"

    def act(self, context):
        presets.apply(scene_props.active_body(context.scene.matterfit).material)


class MATTERFIT_OT_set_resolution(PlainOperator, bpy.types.Operator):
    bl_idname = "matterfit.set_resolution"
    bl_label = "Set from Quality"
    bl_description = ("Measure the thinnest part of the bodies, where the simulation begins, and set the "
                      "particle separation that the quality asks for")

    def act(self, context):
        with frames.at_first(context.scene):
            self._measure(context)

    def _measure(self, context):
        solver = context.scene.matterfit.solver
        if solver.quality == "CUSTOM":
            solver.quality = "STANDARD"
        if resolution.thinnest(context.scene) is None:
            raise JobError(translate("There is no body made from a mesh to measure. Add a body, or "
                                     "type the particle separation."))
        resolution.apply_quality(solver, context.scene)


CLASSES = (MATTERFIT_OT_add_body, MATTERFIT_OT_add_body_file, MATTERFIT_OT_remove_body,
           MATTERFIT_OT_move_body, MATTERFIT_OT_add_pin, MATTERFIT_OT_remove_pin,
           MATTERFIT_OT_add_mass, MATTERFIT_OT_remove_mass, MATTERFIT_OT_reset_material,
           MATTERFIT_OT_add_pair, MATTERFIT_OT_remove_pair, MATTERFIT_OT_set_resolution)
