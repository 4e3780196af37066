# SPDX-License-Identifier: GPL-3.0-or-later
"""A material: a law and its parameters, in SI units."""

import bpy
from bpy.props import (
    CollectionProperty,
    EnumProperty,
    IntProperty,
    StringProperty,
)

from .. import laws
from . import reactions
from .numbers import number


def _preset_items(_self, _context):
    return reactions.preset_items()


def _preset_changed(self, _context):
    reactions.preset_chosen(self)


def _law_changed(self, _context):
    reactions.fit_list_outdated(self.id_data.matterfit)


class MatterfitMaxwell(bpy.types.PropertyGroup):
    """A Maxwell branch: a spring that relaxes, beside the law."""

    name: StringProperty(name="Name", default="Branch", description="A name for this branch")
    modulus: number("material.maxwell.modulus")
    time: number("material.maxwell.time")


class MatterfitMaterial(bpy.types.PropertyGroup):
    """SI values whatever the scene's units are: a material does not change with the scale."""

    preset: EnumProperty(
        name="Material Preset", items=_preset_items, update=_preset_changed,
        description="A material with published or hand-picked values; the values below can be "
                    "changed afterwards")
    source: StringProperty(
        name="Source", description="Where the preset's values come from")
    law: EnumProperty(
        name="Law", items=laws.LAWS, default="FIXED_COROTATED", update=_law_changed,
        description="The constitutive law: how stress follows from deformation")
    E: number("material.E")
    nu: number("material.nu")
    yield_stress: number("material.yield_stress")
    hardening: number("material.hardening")
    viscosity: number("material.viscosity")
    exponent: number("material.exponent")
    friction_angle: number("material.friction_angle")
    cohesion: number("material.cohesion")
    bulk_modulus: number("material.bulk_modulus")
    damping_shear: number("material.damping_shear")
    damping_bulk: number("material.damping_bulk")
    maxwell: CollectionProperty(type=MatterfitMaxwell)
    maxwell_index: IntProperty(
        name="Active Branch", default=0, min=0, soft_max=5, max=100000,
        description="The branch shown below the list")


CLASSES = (MatterfitMaxwell, MatterfitMaterial)
