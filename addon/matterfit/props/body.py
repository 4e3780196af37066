# SPDX-License-Identifier: GPL-3.0-or-later
"""Bodies and colliders, and what is attached to them."""

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)

from ..compat import PATH_OPTIONS
from . import choices, reactions
from .material import MatterfitMaterial
from .numbers import number, vector


def list_changed(self, _context):
    """For what adds to the list of a fit's parameters, or takes from it."""
    reactions.fit_list_outdated(self.id_data.matterfit)


def _role_changed(self, context):
    list_changed(self, context)
    reactions.flow_changed(self.id_data)


def _enabled_changed(self, _context):
    reactions.flow_changed(self.id_data)


def _splats_changed(self, _context):
    reactions.splats_changed(self)


def _source_changed(self, _context):
    """A .spz file says by its format that y points up: so does the row, until somebody says otherwise."""
    if not reactions.rewriting():
        spz = self.source == "GAUSSIANS" and choices.has_y_up(self.filepath)
        if spz and not self.is_property_set("file_up"):
            self.file_up = "Y"
            self.up_of_file = True
        elif not spz and self.up_of_file:
            self.up_of_file = False
            self.property_unset("file_up")
    reactions.splats_changed(self)


def _up_changed(self, _context):
    self.up_of_file = False
    reactions.splats_changed(self)


class MatterfitContact(bpy.types.PropertyGroup):
    """How a body touches a surface."""

    kind: EnumProperty(
        name="Contact", items=choices.CONTACT_KINDS, default="FRICTION", update=list_changed,
        description="What happens where a body touches this surface")
    mu: number("contact.mu")
    use_stiffness: BoolProperty(
        name="Stiffness", default=False,
        description="Use the stiffness below instead of one derived from the body")
    stiffness: number("contact.stiffness")
    use_damping: BoolProperty(
        name="Damping", default=False,
        description="Use the damping below instead of the solver's default")
    damping: number("contact.damping")


class MatterfitPair(bpy.types.PropertyGroup):
    """How two bodies touch each other."""

    first: StringProperty(name="Body", description="One of the two bodies")
    second: StringProperty(name="Other Body", description="The body that it touches")
    contact: PointerProperty(type=MatterfitContact)


class MatterfitPin(bpy.types.PropertyGroup):
    """A region of a body that is held or moved."""

    name: StringProperty(name="Name", default="Pin", description="A name for this pin")
    kind: EnumProperty(
        name="Region", default="VERTEX_GROUP",
        items=(("VERTEX_GROUP", "Vertex Group", "Material near the vertices of a vertex group"),
               ("PLANE", "Behind a Plane", "Material behind an empty's local XY plane, opposite "
                                           "to its Z axis"),
               ("BOX", "Inside a Box", "Material inside the world box around an object"),
               ("ALL", "Whole Body", "The whole body moves as prescribed")),
        description="Which part of the body at rest is held")
    vertex_group: StringProperty(
        name="Vertex Group", description="Vertices with a weight of at least one half are held")
    radius: FloatProperty(
        name="Reach", default=0.02, min=1e-6, soft_min=1e-3, max=1e4, soft_max=1.0, precision=4,
        unit="LENGTH", description="Material within this distance of a pinned vertex is held")
    object: PointerProperty(
        name="Object", type=bpy.types.Object,
        description="The empty whose plane, or the object whose world box, marks the region")
    follow: PointerProperty(
        name="Follow", type=bpy.types.Object,
        description="The held region moves with this object, sampled once a frame; empty: it "
                    "stands still")
    use_release: BoolProperty(
        name="Release", default=False, description="Let go at a frame")
    release: IntProperty(
        name="Release Frame", default=1, min=0, soft_min=0, max=1048574, soft_max=10000,
        description="Scene frame from which the pin no longer holds")


class MatterfitMass(bpy.types.PropertyGroup):
    """A point mass hung on a body."""

    name: StringProperty(name="Name", default="Mass", description="A name for this mass")
    object: PointerProperty(
        name="Position", type=bpy.types.Object,
        description="The mass hangs where this object is at the first frame")
    mass: FloatProperty(
        name="Mass [kg]", default=0.05, min=0.0, soft_min=0.0, max=1e6, soft_max=10.0, precision=4,
        description="Inertia and weight, in kilograms")
    use_attach: BoolProperty(
        name="Attach At", default=False, description="Hang the mass on at a frame")
    attach: IntProperty(
        name="Attach Frame", default=1, min=0, soft_min=0, max=1048574, soft_max=10000,
        description="Scene frame from which the mass is there")


def _object_poll(_self, item):
    return item.type in {"MESH", "CURVE", "SURFACE", "META", "FONT", "EMPTY"}


class MatterfitBody(bpy.types.PropertyGroup):
    """One row of the Bodies list."""

    name: StringProperty(name="Name", default="Body", update=list_changed,
                         description="The name in the job document")
    role: EnumProperty(
        name="Role", default="BODY", update=_role_changed,
        items=(("BODY", "Body", "Simulated", "MESH_ICOSPHERE", 0),
               ("COLLIDER", "Collider", "Bodies run into it", "MOD_PHYSICS", 1)),
        description="Simulated, or something that bodies run into")
    enabled: BoolProperty(
        name="Enabled", default=True, update=_enabled_changed,
        description="Takes part in the simulation")

    source: EnumProperty(
        name="Source", default="OBJECT", update=_source_changed,
        items=(("OBJECT", "Object", "An object of this scene, filled with particles"),
               ("POINTS", "Points File", "Particles from a .ply, .npz or .npy file"),
               ("GAUSSIANS", "Gaussians File", "3D Gaussian splats of a .ply, .splat or .spz file, their inside "
                                            "filled")),
        description="What the body is made from")
    object: PointerProperty(
        name="Object", type=bpy.types.Object, poll=_object_poll,
        description="The object that is simulated, or run into")
    filepath: StringProperty(
        name="File", subtype="FILE_PATH", options=PATH_OPTIONS, update=_source_changed,
        description="A file of particles or Gaussians")
    preview: PointerProperty(
        name="Preview", type=bpy.types.Object,
        description="The object that shows the file's Gaussians in the viewport")
    file_up: EnumProperty(
        name="Up Axis", default="Z", items=choices.FILE_UP_AXES, update=_up_changed,
        description="What points up in the file")
    up_of_file: BoolProperty(
        name="Up Axis of the Format", default=False, options={"HIDDEN"},
        description="The axis above is what the file's format says, and nobody's choice")
    file_scale: FloatProperty(
        name="File Scale", default=1.0, min=1e-9, soft_min=1e-3, max=1e9, soft_max=1e3, precision=4,
        update=_splats_changed,
        description="Metres that one unit of the file stands for")
    crop: PointerProperty(
        name="Crop Box", type=bpy.types.Object, poll=_object_poll, update=_splats_changed,
        description="Gaussians whose centres lie outside of this object's bounds, along the world's axes, are "
                    "left out; an empty is a box of its size")
    fill_inside: BoolProperty(
        name="Fill Inside", default=True,
        description="Fill the inside of the Gaussians' surface with particles")
    opacity_threshold: FloatProperty(
        name="Opacity Threshold", default=0.1, min=0.0, soft_min=0.0, max=1.0, soft_max=0.5,
        subtype="FACTOR", update=_splats_changed,
        description="Gaussians with less opacity are left out, neither filled nor drawn; without unit")

    material: PointerProperty(type=MatterfitMaterial)
    density: number("density")
    formulation: EnumProperty(
        name="Formulation", items=choices.FORMULATIONS, default="AUTO",
        description="Where the computation's grid lives")
    velocity_from: EnumProperty(
        name="Velocity From", default="VALUE", items=choices.VELOCITY_SOURCES,
        update=list_changed, description="Where the initial velocity comes from")
    velocity: vector("velocity", name="Velocity", subtype="VELOCITY", unit="VELOCITY")
    spin: vector("spin")
    seed: IntProperty(
        name="Seed", default=0, min=0, soft_min=0, max=2147483647, soft_max=1000,
        description="Changes the places of jittered particles; without effect on solids")
    pins: CollectionProperty(type=MatterfitPin)
    pin_index: IntProperty(name="Active Pin", default=0, min=0, soft_max=100, max=100000,
                           description="The pin shown below the list")
    masses: CollectionProperty(type=MatterfitMass)
    mass_index: IntProperty(name="Active Mass", default=0, min=0, soft_max=100, max=100000,
                            description="The mass shown below the list")

    # Numbered: files store the number.
    collider_kind: EnumProperty(
        name="Motion", default="AUTO",
        items=(("AUTO", "Automatic", "As its object is animated: not at all, as a whole, or its mesh",
                "NONE", 3),
               ("STATIC", "Static", "Stands still where it is at the first frame", "NONE", 0),
               ("RIGID", "Rigid", "Its transform is sampled once a frame", "NONE", 1),
               ("DEFORMING", "Deforming", "Its evaluated mesh is sampled at every frame", "NONE", 2)),
        description="How the collider moves")
    collider_shape: EnumProperty(
        name="Shape", default="MESH",
        items=(("MESH", "Mesh", "The mesh itself, as a distance grid"),
               ("PLANE", "Plane", "Everything below the object's local XY plane is solid"),
               ("SPHERE", "Sphere", "The sphere around the object's bounding box, exactly"),
               ("BOX", "Box", "The object's bounding box, exactly"),
               ("CAPSULE", "Capsule", "A capsule along the longest side of the bounding box")),
        description="What bodies run into; all but Mesh are exact at any resolution")
    contact: PointerProperty(type=MatterfitContact)


CLASSES = (MatterfitContact, MatterfitPair, MatterfitPin, MatterfitMass, MatterfitBody)
