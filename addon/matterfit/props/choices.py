# SPDX-License-Identifier: GPL-3.0-or-later
"""The enumerations of the panel. Identifiers are upper case; the job document's words come from
lower-casing them."""

LAWS = (
    ("FIXED_COROTATED", "Fixed Corotated", "Elastic; robust at large rotation"),
    ("NEO_HOOKEAN", "Neo-Hookean", "Elastic rubber, nearly incompressible if wished"),
    ("STVK_HENCKY", "StVK-Hencky", "Elastic in logarithmic strain; the law under the plastic ones"),
    ("VON_MISES", "von Mises", "Yields in shear: plasticine, clay, metal"),
    ("HERSCHEL_BULKLEY", "Herschel-Bulkley", "Yields, then flows: cream, toothpaste, mud"),
    ("DRUCKER_PRAGER", "Drucker-Prager", "Grains: sand, soil, snow with cohesion"),
    ("NEWTONIAN", "Newtonian Fluid", "Weakly compressible liquid: water, honey, oil"),
)

# Parameters of each law in the job document's words, the order in which the panel shows them.
LAW_PARAMETERS = {
    "FIXED_COROTATED": ("E", "nu"),
    "NEO_HOOKEAN": ("E", "nu"),
    "STVK_HENCKY": ("E", "nu"),
    "VON_MISES": ("E", "nu", "yield_stress", "hardening"),
    "HERSCHEL_BULKLEY": ("E", "nu", "yield_stress", "viscosity", "exponent"),
    "DRUCKER_PRAGER": ("E", "nu", "friction_angle", "cohesion"),
    "NEWTONIAN": ("bulk_modulus", "viscosity"),
}
# Those of them that a material has to have; the others are 0 where they are left out (exponent 1).
NEEDED_PARAMETERS = ("E", "nu", "yield_stress", "friction_angle", "bulk_modulus")
DAMPING_PARAMETERS = ("damping_shear", "damping_bulk")
MOST_BRANCHES = 6  # Maxwell branches that the solver takes

FORMULATIONS = (
    ("AUTO", "Automatic", "Total Lagrangian for elastic materials, updated for all that flow"),
    ("TOTAL", "Total Lagrangian",
     "The grid belongs to the body: no numerical damping, no tearing, no self-contact"),
    ("UPDATED", "Updated Lagrangian", "The grid stands still: flows, tears, mixes"),
)

CONTACT_KINDS = (
    ("FRICTION", "Friction", "May lift off; Coulomb friction while it touches"),
    ("SEPARATING", "Separating", "May lift off; no friction"),
    ("SLIP", "Slip", "Never lifts off; slides freely"),
    ("STICKY", "Sticky", "Never moves relative to the surface"),
)

QUALITIES = (
    ("PREVIEW", "Preview", "3 cells across the thinnest part: seconds, for staging"),
    ("STANDARD", "Standard", "6 cells across the thinnest part: frequencies right to a few percent"),
    ("FINE", "Fine", "9 cells across the thinnest part: for final bakes"),
    ("CUSTOM", "Custom", "The particle separation typed below"),
)

UNITS = (
    ("AUTO", "From File", "What a C3D file says; metres for the other kinds"),
    ("M", "Metres", "Positions are in metres"),
    ("CM", "Centimetres", "Positions are in centimetres"),
    ("MM", "Millimetres", "Positions are in millimetres"),
    ("CUSTOM", "Custom Scale", "Positions are multiplied by Scale to give metres"),
)
UP_AXES = (
    ("AUTO", "From File", "What the file says; Z where it says nothing"),
    ("Z", "Z Up", "Blender, most motion capture"),
    ("Y", "Y Up", "Most games and film packages"),
    ("X", "X Up", "Rare"),
)


def law_name(law):
    """What the panel calls a law of the job document."""
    return next((item[1] for item in LAWS if item[0] == law.upper()), law)
