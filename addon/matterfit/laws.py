# SPDX-License-Identifier: GPL-3.0-or-later
"""The constitutive laws: names, and which numbers each of them takes. Identifiers are upper case, as
in the panel; the job document's words come from lower-casing them."""

LAWS = (
    ("FIXED_COROTATED", "Fixed Corotated", "Elastic; robust at large rotation"),
    ("NEO_HOOKEAN", "Neo-Hookean", "Elastic rubber, nearly incompressible if wished"),
    ("STVK_HENCKY", "StVK-Hencky", "Elastic in logarithmic strain; the law under the plastic ones"),
    ("VON_MISES", "von Mises", "Yields in shear: plasticine, clay, metal"),
    ("HERSCHEL_BULKLEY", "Herschel-Bulkley", "Yields, then flows: cream, toothpaste, mud"),
    ("DRUCKER_PRAGER", "Drucker-Prager", "Grains: sand, soil, snow with cohesion"),
    ("NEWTONIAN", "Newtonian Fluid", "Weakly compressible liquid: water, honey, oil"),
)

# Parameters of each law in the job document's words, in the panel's order; quantities.py says what
# they are.
PARAMETERS = {
    "FIXED_COROTATED": ("E", "nu"),
    "NEO_HOOKEAN": ("E", "nu"),
    "STVK_HENCKY": ("E", "nu"),
    "VON_MISES": ("E", "nu", "yield_stress", "hardening"),
    "HERSCHEL_BULKLEY": ("E", "nu", "yield_stress", "viscosity", "exponent"),
    "DRUCKER_PRAGER": ("E", "nu", "friction_angle", "cohesion"),
    "NEWTONIAN": ("bulk_modulus", "viscosity"),
}
# Laws of what pours: a mesh bound to such a body is torn to shreds, its surface is the picture.
FLOWING = frozenset({"HERSCHEL_BULKLEY", "DRUCKER_PRAGER", "NEWTONIAN"})
DAMPING = ("damping_shear", "damping_bulk")
MOST_BRANCHES = 6  # Maxwell branches that the solver takes


def name_of(law):
    """What the panel calls a law of the job document."""
    return next((item[1] for item in LAWS if item[0] == law.upper()), law)


def flows(law):
    """Whether a body of this law (either case) pours, so that it has no mesh of its own."""
    return law.upper() in FLOWING
