# SPDX-License-Identifier: GPL-3.0-or-later
"""A material: a law and its parameters, in SI units."""

import bpy
from bpy.props import (
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    IntProperty,
    StringProperty,
)

from . import choices


def _preset_items(_self, _context):
    from ..io import presets
    return presets.enum_items()


def _preset_changed(self, _context):
    from ..io import presets
    presets.apply(self)


def _law_changed(self, _context):
    from ..io import fit_parameters
    fit_parameters.refresh(self.id_data.matterfit)


class MatterfitMaxwell(bpy.types.PropertyGroup):
    """A Maxwell branch: a spring that relaxes, beside the law."""

    name: StringProperty(name="Name", default="Branch", description="A name for this branch")
    modulus: FloatProperty(
        name="Modulus [Pa]", default=1e4, min=0.0, soft_min=1.0, max=1e12, soft_max=1e9,
        precision=1, step=1000,
        description="Shear modulus in pascals that the branch adds before it relaxes; the law's own "
                    "stiffness is what stays")
    time: FloatProperty(
        name="Relaxation Time [s]", default=0.1, min=1e-6, soft_min=1e-4, max=1e5, soft_max=100.0,
        precision=5, step=1,
        description="Seconds in which a held stress of the branch falls to 37 %")


class MatterfitMaterial(bpy.types.PropertyGroup):
    """SI values whatever the scene's units are: a material does not change with the scale."""

    preset: EnumProperty(
        name="Material Preset", items=_preset_items, update=_preset_changed,
        description="A material with published or hand-picked values; the values below can be "
                    "changed afterwards")
    source: StringProperty(
        name="Source", description="Where the preset's values come from")
    law: EnumProperty(
        name="Law", items=choices.LAWS, default="FIXED_COROTATED", update=_law_changed,
        description="The constitutive law: how stress follows from deformation")
    E: FloatProperty(
        name="Young's Modulus [Pa]", default=1e5, min=1e-3, soft_min=1e2, max=1e13, soft_max=1e9,
        precision=0, step=10000,
        description="Stiffness in tension, in pascals: jelly 1e4, rubber 1e6, wood 1e10")
    nu: FloatProperty(
        name="Poisson's Ratio", default=0.3, min=-0.9, soft_min=0.0, max=0.4999, soft_max=0.499,
        precision=4, step=1,
        description="Sideways shrinking over stretching, without unit: .5 keeps its volume")
    yield_stress: FloatProperty(
        name="Yield Stress [Pa]", default=5e3, min=0.0, soft_min=1.0, max=1e12, soft_max=1e6,
        precision=1, step=1000,
        description="Uniaxial stress in pascals from which the material keeps its new shape")
    hardening: FloatProperty(
        name="Hardening [Pa]", default=0.0, min=0.0, soft_min=0.0, max=1e12, soft_max=1e6,
        precision=1, step=1000,
        description="Growth of the yield stress in pascals per unit of plastic strain")
    viscosity: FloatProperty(
        name="Viscosity [Pa s]", default=1.0, min=0.0, soft_min=1e-3, max=1e9, soft_max=1e4,
        precision=4, step=10,
        description="Dynamic viscosity in pascal seconds: water .001, honey 10, toothpaste 100")
    exponent: FloatProperty(
        name="Flow Exponent", default=1.0, min=0.1, soft_min=0.3, max=4.0, soft_max=1.5,
        precision=2, step=5,
        description="Herschel-Bulkley exponent, without unit: below 1 it thins as it flows")
    friction_angle: FloatProperty(
        name="Friction Angle [°]", default=30.0, min=0.0, soft_min=10.0, max=89.0, soft_max=50.0,
        precision=1, step=50,
        description="Angle of internal friction in degrees: dry sand 25 to 40")
    cohesion: FloatProperty(
        name="Cohesion [Pa]", default=0.0, min=0.0, soft_min=0.0, max=1e9, soft_max=1e5,
        precision=1, step=100,
        description="Shear strength without pressure, in pascals: dry sand 0, wet sand 1e3")
    bulk_modulus: FloatProperty(
        name="Bulk Modulus [Pa]", default=1e5, min=1.0, soft_min=1e3, max=1e12, soft_max=1e8,
        precision=0, step=10000,
        description="Resistance to compression in pascals; lower than real water (2.2e9) so that "
                    "the time step stays practical")
    damping_shear: FloatProperty(
        name="Shear Damping [Pa s]", default=0.0, min=0.0, soft_min=0.0, max=1e9, soft_max=1e4,
        precision=3, step=10,
        description="Kelvin-Voigt viscosity against change of shape, in pascal seconds")
    damping_bulk: FloatProperty(
        name="Bulk Damping [Pa s]", default=0.0, min=0.0, soft_min=0.0, max=1e9, soft_max=1e4,
        precision=3, step=10,
        description="Kelvin-Voigt viscosity against change of volume, in pascal seconds")
    maxwell: CollectionProperty(type=MatterfitMaxwell)
    maxwell_index: IntProperty(
        name="Active Branch", default=0, min=0, soft_max=5, max=100000,
        description="The branch shown below the list")


CLASSES = (MatterfitMaxwell, MatterfitMaterial)
