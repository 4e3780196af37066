# SPDX-License-Identifier: GPL-3.0-or-later
"""A material: a law and its parameters, in SI units."""

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatVectorProperty,
    IntProperty,
    StringProperty,
)

from .. import laws, quantities
from ..compat import PATH_OPTIONS
from . import reactions
from .numbers import number, vector


def _preset_items(_self, _context):
    return reactions.preset_items()


def _preset_changed(self, _context):
    reactions.preset_chosen(self)


def _law_changed(self, _context):
    # Another law was not seen at anything, and its values are of no preset.
    self.excited, self.source = (0.0,) * 5, ""
    reactions.fit_list_outdated(self.id_data.matterfit)
    reactions.flow_changed(self.id_data)


def _pours_changed(self, _context):
    """A number, or a switch, that may decide whether the material pours."""
    reactions.flow_changed(self.id_data)


def _weights_changed(self, _context):
    """Other weights stand for other numbers."""
    numbers = laws.START_NUMBERS.get(self.weights)
    if numbers is None:
        return
    for name in laws.PARAMETERS["NEURAL_ISOTROPIC"]:
        setattr(self, name, numbers.get(name, quantities.material(name).default))


def _published_file_changed(self, _context):
    self.published_weights = "FILE" if self.published_file else "JELLY"


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
    weights: EnumProperty(
        name="Weights", items=laws.STARTS, default="JELLY", update=_weights_changed,
        description="The weights that the neural law begins with; they fill in its numbers")
    weights_file: StringProperty(
        name="Weights File", subtype="FILE_PATH", options=PATH_OPTIONS,
        description="A file *.safetensors with weights of the isotropic neural law")
    form_1: number("material.form_1")
    form_2: number("material.form_2")
    form_3: number("material.form_3")
    form_4: number("material.form_4")
    yield_strain: number("material.yield_strain", update=_pours_changed)
    internal_friction: number("material.internal_friction")
    strain_hardening: number("material.strain_hardening")
    tear_strain: number("material.tear_strain", update=_pours_changed)
    flow_rate: number("material.flow_rate")
    flow_thinning: number("material.flow_thinning")
    use_latent: BoolProperty(
        name="Kind of Material", default=False,
        description="Its eight numbers are known, as after a fit; else it is an elastic solid until a "
                    "fit has looked for them")
    latent: vector("material.latent")
    show_latent: BoolProperty(
        name="Numbers", default=False, options=set(),
        description="Show the eight numbers that say what kind of material it is")
    decoder_file: StringProperty(
        name="Weights File", subtype="FILE_PATH", options=PATH_OPTIONS,
        description="A file *.safetensors that matterfit pretrain --latent wrote; empty: the weights "
                    "that come with Matterfit")
    published_weights: EnumProperty(
        name="Weights", items=laws.STARTS, default="JELLY", update=_pours_changed,
        description="The weights of the published law's two networks")
    published_file: StringProperty(
        name="Weights File", subtype="FILE_PATH", options=PATH_OPTIONS,
        update=_published_file_changed,
        description="The two networks of the published law: a file *.safetensors, or *.pt as PyTorch "
                    "saves it")
    pours: BoolProperty(
        name="Pours", default=False, update=_pours_changed,
        description="It pours like sand or water, so that its surface is shown and not the object's "
                    "own mesh; a fitted material says it by the known law that it is most like")
    correction: vector("material.correction")
    show_correction: BoolProperty(
        name="Correction", default=False, options=set(),
        description="Show the five numbers by which the material differs from its law")
    excited: FloatVectorProperty(
        name="Seen When Fitted", size=5, min=0.0, soft_min=0.0, max=1e12, soft_max=1e12,
        description="What the recording showed that the material was fitted to: largest strain, loss "
                    "and gain of volume, slowest and fastest rate [1/s]; zeros: it was not fitted")
    damping_shear: number("material.damping_shear")
    damping_bulk: number("material.damping_bulk")
    maxwell: CollectionProperty(type=MatterfitMaxwell)
    maxwell_index: IntProperty(
        name="Active Branch", default=0, min=0, soft_max=5, max=100000,
        description="The branch shown below the list")


CLASSES = (MatterfitMaxwell, MatterfitMaterial)
