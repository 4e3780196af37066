# SPDX-License-Identifier: GPL-3.0-or-later
import bpy

from .. import laws
from ..compat import translate
from ..io import frames, motion, number_text, presets, shapes, splat_preview, throws, transforms
from ..props import scene as scene_props
from .common import MatterfitPanel, contact, form, lines, menu, quantity, switched

MOTIONS = {"STATIC": "Stands still", "RIGID": "Moves with its object's animation",
           "DEFORMING": "Its mesh is sampled at every frame"}


class MATTERFIT_UL_bodies(bpy.types.UIList):
    def draw_item(self, _context, layout, _data, item, _icon, _active, _name, _index=0):
        row = layout.row(align=True)
        row.prop(item, "name", text="", emboss=False,
                 icon="MESH_ICOSPHERE" if item.role == "BODY" else "MOD_PHYSICS")
        row.prop(item, "enabled", text="")


class MATTERFIT_UL_names(bpy.types.UIList):
    """Pins, masses: a name a row."""

    def draw_item(self, _context, layout, _data, item, _icon, _active, _name, _index=0):
        layout.prop(item, "name", text="", emboss=False)


class MATTERFIT_PT_bodies(MatterfitPanel, bpy.types.Panel):
    bl_label = "Bodies"
    bl_order = 2
    bl_options = set()

    def draw(self, context):
        layout = self.layout
        settings = context.scene.matterfit
        row = layout.row()
        row.template_list("MATTERFIT_UL_bodies", "", settings, "bodies", settings, "body_index",
                          rows=3)
        column = row.column(align=True)
        column.operator("matterfit.add_body", text="", icon="ADD").role = "BODY"
        column.operator("matterfit.remove_body", text="", icon="REMOVE")
        column.operator("matterfit.add_body_file", text="", icon="FILE_FOLDER")
        column.separator()
        column.operator("matterfit.move_body", text="", icon="TRIA_UP").step = -1
        column.operator("matterfit.move_body", text="", icon="TRIA_DOWN").step = 1
        column = layout.column(align=True)
        column.operator("matterfit.add_body", text="Add Body", icon="MESH_ICOSPHERE").role = "BODY"
        column.operator("matterfit.add_body", text="Add Collider",
                        icon="MOD_PHYSICS").role = "COLLIDER"
        body = scene_props.active_body(settings)
        if body is None:
            if not settings.bodies:
                lines(layout, translate("Select an object that is to be simulated, and press Add "
                                        "Body."), icon="INFO")
            return
        form(layout).prop(body, "role")
        if body.role == "COLLIDER":
            self._collider(layout, body)
        else:
            self._body(context, layout, settings, body)

    def _collider(self, layout, body):
        column = form(layout)
        column.prop(body, "object")
        column.prop(body, "collider_kind")
        if body.collider_kind == "AUTO" and body.object is not None:
            lines(column, translate(MOTIONS[motion.collider_kind(body)]), icon="INFO")
        if body.collider_kind != "DEFORMING":
            column.prop(body, "collider_shape")
        contact(layout, body.contact)

    def _body(self, context, layout, settings, body):
        column = form(layout)
        column.prop(body, "source")
        if body.source == "OBJECT":
            column.prop(body, "object")
            if body.object is not None:
                lines(column, _shape_text(body.object), icon="INFO")
                _offer_animation(column, body)
                _slow_start(column, context.scene, body)
        else:
            column.prop(body, "filepath")
            column.prop(body, "file_up")
            column.prop(body, "file_scale", text="Scale")
            if body.source == "GAUSSIANS":
                _splats(column, body)
        material = body.material
        column = form(layout)
        column.separator()
        row = column.row(align=True)
        row.prop(material, "preset", text="Preset")
        if presets.differs(material):
            row.operator("matterfit.reset_material", text="", icon="LOOP_BACK")
        if presets.is_users(material.preset):
            row.operator("matterfit.remove_preset", text="", icon="TRASH")
        row.operator("matterfit.load_material", text="", icon="FILE_FOLDER")
        for fault in presets.faults():
            lines(column, fault, icon="ERROR")
        menu(column, material, "law")
        if material.law == "NEURAL_ISOTROPIC":
            column.prop(material, "weights")
            if material.weights == "FILE":
                column.prop(material, "weights_file", text="File")
        elif material.law == "NEURAL":
            column.prop(material, "published_weights")
            if laws.published_weights(material) == "FILE":
                column.prop(material, "published_file", text="File")
                if not material.published_file:
                    lines(column, translate("Choose a file of weights for this law."), icon="ERROR")
        for name in laws.PARAMETERS[material.law]:
            if name != "latent":
                quantity(column, material, "material." + name)
        quantity(column, body, "density")
        if material.law == "LATENT":
            _unknown(column, material)
        if any(material.correction):
            _folded(column, material, "correction")
        column.prop(settings, "show_curves")


def _offer_animation(column, body):
    """Keys that came after Add Body move nothing until they are chosen."""
    if motion.leaves_keys(body):
        lines(column, translate("It is animated, but starts with the velocity that is typed."),
              icon="QUESTION")
        column.prop_enum(body, "velocity_from", "ANIMATION", text="Start as Keyed")


def _slow_start(column, scene, body):
    """What is thrown by its keys begins with the velocity of one frame, which may be none."""
    take = scene_props.active_take(scene.matterfit)
    if throws.velocity_from(body, throws.of(take, body.name)) != "ANIMATION":
        return
    first, end = frames.frame_range(scene)
    found = motion.slow_start(body.object, first, end)
    if found is None:
        return
    unit = transforms.metres(scene) * scene.render.fps / scene.render.fps_base
    text = translate("Its keys hold still from frame {first} on: it starts at rest.")
    if found.fastest > 0.0:
        text = translate("Its keys set off slowly: {speed} m/s at frame {first}, where the simulation "
                         "begins, {fastest} m/s at frame {frame}. Make them linear, or begin there: Solver "
                         "> Own Range.")
    elif found.turns:
        text = translate("Its keys hardly turn it at frame {first}, where the simulation begins, and "
                         "fastest at frame {frame}. Make them linear, or begin there: Solver > Own Range.")
    lines(column, text.format(first=first, frame=found.frame, speed=f"{unit * found.speed:.2g}",
                              fastest=f"{unit * found.fastest:.2g}"), icon="QUESTION")


def _splats(column, body):
    column.prop(body, "crop")
    column.prop(body, "opacity_threshold", text="Opacity")
    item = splat_preview.shown(body)
    column.operator("matterfit.show_splats", text="Hide Splats" if item else "Show Splats",
                    icon="HIDE_ON" if item else "HIDE_OFF")
    if item:
        count, seen = item[splat_preview.TOLD]
        lines(column, translate("{seen} of {count} Gaussians are shown").format(
            seen=number_text.grouped(seen), count=number_text.grouped(count)), icon="INFO")
    drawn = column.operator("matterfit.render_splats", icon="RENDER_STILL")
    drawn.filepath, drawn.up, drawn.scale = bpy.path.abspath(body.filepath), body.file_up, body.file_scale
    drawn.crop, drawn.opacity_threshold = body.crop.name if body.crop else "", body.opacity_threshold
    column.prop(body, "fill_inside")


def _unknown(column, material):
    """What a material without a class is, as far as a fit has told it; its numbers are folded away."""
    _unsplit(column, material, "use_latent")
    if not material.use_latent:
        lines(column, translate("Not known yet: an elastic solid. Fit, with the law Unknown, finds "
                                "what it is."), icon="INFO")
    elif material.source:
        lines(column, material.source, icon="BOOKMARKS")
    if material.decoder_file:
        column.prop(material, "decoder_file", text="File")
    column.prop(material, "pours")
    if material.use_latent:
        _folded(column, material, "latent")


def _unsplit(column, item, name, **options):
    """A switch with the whole width for its name."""
    row = column.row()
    row.use_property_split = False
    row.prop(item, name, **options)


def _folded(column, material, key):
    """The numbers of a code, which few people set by hand."""
    shown = getattr(material, f"show_{key}")
    _unsplit(column, material, f"show_{key}", icon="TRIA_DOWN" if shown else "TRIA_RIGHT")
    if shown:
        column.prop(material, key, text="")


def _shape_text(item):
    return translate("Used: {shape}").format(shape=translate(shapes.body_shape(item).text))


class _BodyDetail(MatterfitPanel):
    bl_parent_id = "MATTERFIT_PT_bodies"

    @classmethod
    def poll(cls, context):
        body = scene_props.active_body(context.scene.matterfit)
        return body is not None and body.role == "BODY"


def _name_list(layout, owner, items, index, noun):
    """The list of `owner`'s `items` with buttons that add and remove a `noun`; its active item."""
    row = layout.row()
    row.template_list("MATTERFIT_UL_names", items, owner, items, owner, index, rows=2)
    column = row.column(align=True)
    column.operator(f"matterfit.add_{noun}", text="", icon="ADD")
    column.operator(f"matterfit.remove_{noun}", text="", icon="REMOVE")
    return scene_props.active_item(getattr(owner, items), getattr(owner, index))


class MATTERFIT_PT_body_motion(_BodyDetail, bpy.types.Panel):
    bl_label = "Motion and Formulation"

    def draw(self, context):
        body = scene_props.active_body(context.scene.matterfit)
        column = form(self.layout)
        if body.velocity_from == "ANIMATION" or body.object is not None and motion.moves(body.object):
            column.prop(body, "velocity_from", text="From")
        if body.velocity_from == "VALUE":
            column.prop(body, "velocity")
            quantity(column, body, "spin")
        menu(column, body, "formulation")
        column.prop(body, "seed")
        column.label(text="Damping")
        for name in laws.DAMPING:
            quantity(column, body.material, "material." + name)
        if body.material.source:
            lines(self.layout, body.material.source, icon="BOOKMARKS")


class MATTERFIT_PT_body_relaxation(_BodyDetail, bpy.types.Panel):
    bl_label = "Relaxation"

    def draw(self, context):
        layout = self.layout
        material = scene_props.active_body(context.scene.matterfit).material
        branch = _name_list(layout, material, "maxwell", "maxwell_index", "branch")
        if branch is None:
            return
        column = form(layout)
        quantity(column, branch, "material.maxwell.modulus")
        quantity(column, branch, "material.maxwell.time")


class MATTERFIT_PT_body_pins(_BodyDetail, bpy.types.Panel):
    bl_label = "Pins"

    def draw(self, context):
        layout = self.layout
        body = scene_props.active_body(context.scene.matterfit)
        pin = _name_list(layout, body, "pins", "pin_index", "pin")
        if pin is None:
            return
        column = form(layout)
        column.prop(pin, "kind")
        if pin.kind == "VERTEX_GROUP":
            if body.object is not None:
                column.prop_search(pin, "vertex_group", body.object, "vertex_groups", text="Group")
            column.prop(pin, "radius")
        elif pin.kind != "ALL":
            column.prop(pin, "object")
        column.prop(pin, "follow")
        switched(column, pin, "use_release", "release")


class MATTERFIT_PT_body_masses(_BodyDetail, bpy.types.Panel):
    bl_label = "Masses"

    def draw(self, context):
        layout = self.layout
        body = scene_props.active_body(context.scene.matterfit)
        mass = _name_list(layout, body, "masses", "mass_index", "mass")
        if mass is None:
            return
        column = form(layout)
        column.prop(mass, "object")
        column.prop(mass, "mass")
        switched(column, mass, "use_attach", "attach")


CLASSES = (MATTERFIT_UL_bodies, MATTERFIT_UL_names, MATTERFIT_PT_bodies, MATTERFIT_PT_body_motion,
           MATTERFIT_PT_body_relaxation, MATTERFIT_PT_body_pins, MATTERFIT_PT_body_masses)
