# SPDX-License-Identifier: GPL-3.0-or-later
"""The kinds of effects that the panel offers: what a scene's model is extended by.

Their numbers are those of `scene.effects[]` in docs/formats.md, by the same words, as the library
has them (library.py).
"""

from dataclasses import dataclass

from . import library


@dataclass(frozen=True)
class Kind:
    """One kind. `at_rest`: it is a part of the body, told where the body starts."""

    name: str
    title: str
    about: str
    icon: str
    at_rest: bool = False

    @property
    def numbers(self):
        """The keys of its numbers; those of PLACED come from an object where one is chosen."""
        return tuple(library.EFFECTS[self.name])

    @property
    def keyed(self):
        """The numbers that a document may give a value of at every frame."""
        return frozenset(key for key, row in library.EFFECTS[self.name].items() if row["keyed"])

    @property
    def identifier(self):
        return self.name.upper()

    @property
    def has_place(self):
        return not PLACED.isdisjoint(self.numbers)


KINDS = (
    Kind("drag_linear", "Linear Drag",
         "Takes speed from the bodies in proportion to it: a thick medium", "FORCE_DRAG"),
    Kind("drag_quadratic", "Air Drag",
         "The air brakes the bodies: twice the speed, four times the force", "FORCE_DRAG"),
    Kind("wind", "Wind",
         "What moving air adds to still air; Air Drag beside it brakes", "FORCE_WIND"),
    Kind("buoyancy", "Buoyancy",
         "Air or water carries a part of the weight, and has to be moved aside", "MOD_FLUIDSIM"),
    Kind("force_field", "Force Field", "An acceleration around a place", "FORCE_FORCE"),
    Kind("vortex", "Vortex", "An acceleration around an axis", "FORCE_VORTEX"),
    Kind("frame_acceleration", "Shaking",
         "What the bodies are seen from is accelerated, or shaken", "FORCE_TURBULENCE"),
    Kind("stiffness_inclusion", "Inclusion",
         "A stiffer or softer place inside a body, told where the body starts", "META_BALL",
         at_rest=True),
    Kind("stiffness_gradient", "Stiffness Gradient",
         "One end of a body is stiffer than the other", "IPO_LINEAR", at_rest=True),
    Kind("fibres", "Fibres", "The material is stiffer along one direction: a grain, print lines",
         "STRANDS", at_rest=True),
    Kind("strain_stiffening", "Strain Stiffening",
         "The material becomes stiffer the farther it is stretched, as rubber does", "IPO_EXPO",
         at_rest=True),
    Kind("second_invariant", "Mooney Term",
         "A rubber that softens when pulled along one axis, less when pulled along two", "IPO_QUAD",
         at_rest=True),
)

# Parameters that an object in the scene gives: by its origin, or by its local Z.
PLACED = frozenset({"center", "axis", "direction"})

# Lengths, which a scene has in its own unit.
LENGTHS = frozenset({"center", "radius"})
# Areas likewise, by the unit squared.
AREAS = frozenset({"area"})


def find(identifier):
    """The kind that a property's identifier or a document's word names."""
    name = identifier.lower()
    return next(kind for kind in KINDS if kind.name == name)
