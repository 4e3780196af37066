# SPDX-License-Identifier: GPL-3.0-or-later
"""Takes: reruns of the scene with another throw, each with its own cache."""

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)

from .numbers import vector


class MatterfitThrow(bpy.types.PropertyGroup):
    """How one body starts in one take."""

    name: StringProperty(name="Body", description="The body that is thrown")
    use_placement: BoolProperty(
        name="New Position", default=False, description="Start somewhere else than the object is")
    location: vector("placement.position", name="Position", subtype="TRANSLATION",
                     unit="LENGTH")
    rotation: vector("placement.rotation", name="Rotation", subtype="EULER", unit="ROTATION")
    velocity_from: EnumProperty(
        name="Velocity From", default="BODY",
        items=(("BODY", "Body", "The velocity and spin set in Bodies"),
               ("VALUE", "Values Below", "Another velocity and spin in this take"),
               ("ANIMATION", "Animation",
                "Linear and angular velocity of the object's own animation at the first frame")),
        description="Where the initial velocity comes from")
    velocity: vector("velocity", name="Velocity", subtype="VELOCITY", unit="VELOCITY")
    spin: vector("spin")


class MatterfitTakeCollider(bpy.types.PropertyGroup):
    """A collider's switch in one take."""

    name: StringProperty(name="Collider", description="The collider this switch is for")
    enabled: BoolProperty(
        name="Enabled", default=True, description="Bodies run into this collider in this take")


class MatterfitTake(bpy.types.PropertyGroup):
    """One row of the Takes list. Its cache is `folder`, which no other take uses."""

    name: StringProperty(name="Name", default="Take", description="A name for this take")
    folder: StringProperty(
        name="Cache Folder", description="Relative to the .blend file: //cache_matterfit_…/")
    owner: StringProperty(
        name="Owner", description="The .blend file that baked this take")
    throws: CollectionProperty(type=MatterfitThrow)
    use_gravity: BoolProperty(
        name="Own Gravity", default=False, description="Another gravity in this take")
    gravity: vector(
        "gravity", default=(0.0, 0.0, -9.81),
        description="Acceleration of gravity in this take, in metres per second squared")
    colliders: CollectionProperty(type=MatterfitTakeCollider)

    baked: BoolProperty(name="Baked", default=False, description="A cache has been baked")
    first_frame: IntProperty(name="First Frame", default=0, min=0, max=1048574, soft_max=10000,
                             description="First baked scene frame")
    frames_done: IntProperty(name="Frames Done", default=0, min=0, max=1048574, soft_max=10000,
                             description="How many frames the cache holds")
    frame_count: IntProperty(name="Frames", default=0, min=0, max=1048574, soft_max=10000,
                             description="How many frames the cache should hold")
    extended: BoolProperty(
        name="Preview of a Diagnosis", default=False,
        description="The cache holds the model that a diagnosis has extended, not what the scene is")
    compared: BoolProperty(
        name="Compared", default=False,
        description="The cache holds a comparison with the captures as they are")
    collection: PointerProperty(
        name="Results", type=bpy.types.Collection,
        description="The collection that holds the objects of this take")


CLASSES = (MatterfitThrow, MatterfitTakeCollider, MatterfitTake)
