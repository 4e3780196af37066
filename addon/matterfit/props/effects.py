# SPDX-License-Identifier: GPL-3.0-or-later
"""Effects: what the model of a scene is extended by, one property a number; those that a
document may have keyed can be animated."""

import re

import bpy
from bpy.props import (
    BoolProperty,
    EnumProperty,
    FloatProperty,
    FloatVectorProperty,
    PointerProperty,
    StringProperty,
)

from .. import effects
from ..compat import translate_label
from ..names import unique

_KINDS = [(kind.identifier, kind.title, kind.about, kind.icon, index)
          for index, kind in enumerate(effects.KINDS)]


def _kind_changed(self, _context):
    """A name that nobody has typed follows the kind."""
    titles = {translate_label(kind.title) for kind in effects.KINDS}
    if self.name and re.sub(r" \d+$", "", self.name) not in titles:
        return
    others = [other for other in self.id_data.matterfit.effects if other != self]
    self.name = unique(translate_label(effects.find(self.kind).title), others)


class MatterfitEffect(bpy.types.PropertyGroup):
    """One row of the list of effects."""

    name: StringProperty(name="Name", description="A name for this effect")
    kind: EnumProperty(name="Kind", items=_KINDS, default="WIND", update=_kind_changed,
                       description="What the effect does")
    enabled: BoolProperty(name="Enabled", default=True,
                          description="The effect acts in simulations and fits")
    body: StringProperty(name="Body", description="The body that it acts on; empty: all of them")
    place: PointerProperty(
        name="Object", type=bpy.types.Object,
        description="Where it is: the object's origin, and its local Z as the axis. It may move")

    rate: FloatProperty(
        name="Rate [1/s]", default=0.5, min=0.0, max=1e3, soft_max=5.0, precision=3, step=5,
        description="Share of its speed that a free body loses in a second")
    drag_coefficient: FloatProperty(
        name="Drag Coefficient", default=0.5, min=0.0, max=100.0, soft_max=2.0, precision=3, step=5,
        description="c_d of the whole body, without unit: a ball has .5, a cube 1.05, a flat plate "
                    "across the flow 1.2")
    area: FloatProperty(
        name="Reference Area", default=0.0, min=0.0, max=1e6, soft_max=1.0, precision=4, step=1,
        unit="AREA",
        options=set(),
        description="What the drag coefficient refers to; 0: the cross-section of a ball of the "
                    "body's volume")
    air_density: FloatProperty(
        name="Density [kg/m³]", default=1.204, min=0.0, max=2e4, soft_max=1e3, precision=3, step=10,
        description="Density of the medium in kilograms per cubic metre: air 1.204, water 998")
    velocity: FloatVectorProperty(
        name="Velocity [m/s]", size=3, subtype="XYZ", default=(0.0, 0.0, 0.0), min=-300.0, max=300.0,
        soft_min=-30.0, soft_max=30.0, precision=2, step=10,
        description="Where the air goes, in metres per second whatever the scene's scale")
    medium_density: FloatProperty(
        name="Density [kg/m³]", default=1.204, min=0.0, max=2e4, soft_max=1e3, precision=3, step=10,
        options=set(),
        description="Density of what the body displaces, in kilograms per cubic metre: air 1.204, "
                    "water 998")
    added_mass: FloatProperty(
        name="Added Mass", default=0.5, min=0.0, max=10.0, soft_max=1.0, precision=2, step=5,
        options=set(),
        description="Share of the displaced medium that moves along, without unit: a ball has .5")
    center: FloatVectorProperty(
        name="Centre", size=3, default=(0.0, 0.0, 0.0), min=-1e6, max=1e6, soft_min=-10.0,
        soft_max=10.0, precision=3, subtype="TRANSLATION", unit="LENGTH",
        description="Where it is strongest, in the world")
    axis: FloatVectorProperty(
        name="Axis", size=3, default=(0.0, 0.0, 1.0), min=-1e6, max=1e6, soft_min=-1.0,
        soft_max=1.0, precision=2, subtype="XYZ",
        description="The direction that it turns about, right-handed")
    radius: FloatProperty(
        name="Radius", default=1.0, min=1e-4, max=1e6, soft_max=10.0, precision=3, unit="LENGTH",
        description="Where it has faded away")
    acceleration: FloatVectorProperty(
        name="Acceleration [m/s²]", size=3, subtype="XYZ", default=(0.0, 0.0, 0.0), min=-1e5, max=1e5,
        soft_min=-30.0, soft_max=30.0, precision=2, step=10,
        description="What it does to a free body, in metres per second squared whatever the "
                    "scene's scale")
    strength: FloatProperty(
        name="Strength [m/s²]", default=0.0, min=-1e5, max=1e5, soft_min=-30.0, soft_max=30.0,
        precision=2, step=10,
        description="The largest acceleration, in metres per second squared, at .38 of the radius")
    frequency: FloatProperty(
        name="Frequency [Hz]", default=0.0, min=0.0, max=1e5, soft_max=50.0, precision=2, step=10,
        options=set(),
        description="How often it shakes in a second; 0: a steady acceleration")
    phase: FloatProperty(
        name="Phase [°]", default=0.0, min=-360.0, max=360.0, soft_min=-180.0, soft_max=180.0,
        precision=1, step=100,
        options=set(),
        description="Where in a period the first frame lies, in degrees; -90 starts from none")
    modulus: FloatProperty(
        name="Added E [Pa]", default=0.0, min=-1e9, max=1e12, soft_min=-1e6, soft_max=1e6,
        precision=0, step=100000, options=set(),
        description="What is added to Young's modulus, in pascals: at the centre of an inclusion, "
                    "along fibres, or of a stiffening to the shear modulus where the first "
                    "invariant is 4 in place of 3. Below 0 it is softer")
    nu: FloatProperty(
        name="Poisson's Ratio", default=0.3, min=0.0, max=0.49, precision=3, step=1, options=set(),
        description="Of the added stiffness, without unit")
    slope: FloatVectorProperty(
        name="Slope [Pa/m]", size=3, subtype="XYZ", default=(0.0, 0.0, 0.0), min=-1e9, max=1e9, soft_min=-1e7,
        soft_max=1e7, precision=0, step=100000, options=set(),
        description="How Young's modulus grows along each axis of the world, in pascals per metre "
                    "whatever the scene's scale")
    direction: FloatVectorProperty(
        name="Direction", size=3, default=(0.0, 0.0, 1.0), min=-1e6, max=1e6, soft_min=-1.0,
        soft_max=1.0, precision=2, subtype="XYZ", options=set(),
        description="Along the fibres where the body starts, in the world")
    exponent: FloatProperty(
        name="Exponent", default=1.0, min=0.5, max=6.0, precision=2, step=10, options=set(),
        description="How suddenly it sets in, without unit")


CLASSES = (MatterfitEffect,)
