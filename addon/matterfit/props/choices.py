# SPDX-License-Identifier: GPL-3.0-or-later
"""The enumerations of the panel. Identifiers are upper case; the job document's words come from
lower-casing them."""

FORMULATIONS = (
    ("AUTO", "Automatic", "Total Lagrangian for elastic materials, updated for all that flow"),
    ("TOTAL", "Total Lagrangian",
     "The grid belongs to the body: no numerical damping, no tearing, no self-contact"),
    ("UPDATED", "Updated Lagrangian", "The grid stands still: flows, tears, mixes"),
    ("RENEWED", "Renewed",
     "As total, but the grid is laid anew as motion asks: flows with a damping that does not depend on the "
     "substep, and sand runs out as far as measured. Not beside updated, without pins and attached masses"),
)

CONTACT_KINDS = (
    ("FRICTION", "Friction", "May lift off; Coulomb friction while it touches"),
    ("SEPARATING", "Separating", "May lift off; no friction"),
    ("SLIP", "Slip", "Never lifts off; slides freely"),
    ("GLUE", "Glue", "Never moves relative to the surface once it has touched it"),
    ("NO_SLIP", "No Slip", "May lift off; does not slide while it is pressed"),
)

QUALITIES = (
    ("PREVIEW", "Preview", "3 cells across the thinnest part, 5 000 particles where something pours: "
     "for staging"),
    ("STANDARD", "Standard", "6 cells across the thinnest part: frequencies right to a few percent; 40 000 "
     "particles where something pours"),
    ("FINE", "Fine", "9 cells across the thinnest part, 100 000 particles where something pours: for final "
     "bakes"),
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
    ("-Y", "Y Down (COLMAP)", "Most scenes that are trained from photographs"),
)

# Axes that may point up in a file of points or splats, which does not say which one does. The items are
# numbered, as .blend files store the number.
FILE_UP_AXES = (
    ("Z", "Z", "As Blender has it", "NONE", 0),
    ("Y", "Y", "Y points up", "NONE", 1),
    ("-Y", "−Y (COLMAP)", "Y points down, as in most trained scenes", "NONE", 2),
)


def has_y_up(path):
    """Whether a file of splats says by its format that y points up; others do not say what does."""
    return path.lower().endswith(".spz")


SPLAT_FORMATS = (
    ("PLY", ".ply", "As trainers write it: every number as it is"),
    ("SPLAT", ".splat", "A seventh of the size and less; colours and opacities rounded to 1/255, and the same "
                        "from all sides"),
)

VELOCITY_SOURCES = (
    ("VALUE", "Values Below", "The velocity and spin typed below"),
    ("ANIMATION", "Animation",
     "Linear and angular velocity of the object's own animation at the first frame"),
)
