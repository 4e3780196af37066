# SPDX-License-Identifier: GPL-3.0-or-later
"""The constitutive laws: names, and which numbers each of them takes. Identifiers are upper case, as
in the panel; the job document's words come from lower-casing them."""

from . import library

LAWS = (
    ("FIXED_COROTATED", "Fixed Corotated", "Elastic; robust at large rotation"),
    ("NEO_HOOKEAN", "Neo-Hookean", "Elastic rubber, nearly incompressible if wished"),
    ("STVK_HENCKY", "StVK-Hencky", "Elastic in logarithmic strain; the law under the plastic ones"),
    ("VON_MISES", "von Mises", "Yields in shear: plasticine, clay, metal"),
    ("HERSCHEL_BULKLEY", "Herschel-Bulkley", "Yields, then flows: cream, toothpaste, mud"),
    ("DRUCKER_PRAGER", "Drucker-Prager", "Grains: sand, soil, snow with cohesion"),
    ("NEWTONIAN", "Newtonian Fluid", "Weakly compressible liquid: water, honey, oil"),
    ("NEURAL_ISOTROPIC", "Neural (isotropic)",
     "A small network, pre-trained: elastic, plastic, grains or liquid by its numbers; its form can "
     "be fitted"),
    ("LATENT", "Unknown",
     "No class is given: eight numbers, which a fit finds, say where the material lies among elastic "
     "solids, plastic ones, pastes, grains and liquids"),
    ("NEURAL", "Neural (published)",
     "Two networks of a file, as NCLaw publishes and trains them. It has no numbers that a fit could "
     "find; All Weights of a fit moves what the networks learned"),
)

# Parameters of each law in the job document's words, in the panel's order; quantities.py says what
# they are.
PARAMETERS = {name.upper(): keys for name, keys in library.PARAMETERS.items()}
PARAMETERS["LATENT"] += ("latent",)  # its code, a list and no number in a document
# A fit can look for laws that have numbers.
CANDIDATES = tuple(law for law in LAWS if PARAMETERS[law[0]])
NEURAL = frozenset({"NEURAL_ISOTROPIC", "LATENT", "NEURAL"})
# The neural law's start weights that the library carries, and the numbers that each stands for.
STARTS = (
    ("JELLY", "Jelly", "Elastic: fixed corotated, E 1e5 Pa"),
    ("PLASTICINE", "Plasticine", "Yields in shear at 2 % of strain, E 3e5 Pa"),
    ("SAND", "Sand", "Grains of friction angle 25°, E 1e6 Pa"),
    ("WATER", "Water", "Liquid, bulk modulus 8.3e4 Pa"),
    ("FILE", "File", "Weights of a file that matterfit pretrain wrote"),
)
START_NUMBERS = {name.upper(): numbers for name, numbers in library.STARTS.items()}
_POURING_STARTS = frozenset({"SAND", "WATER"})  # of the published law
# Laws whose particles are shown, each as grains.
GRANULAR = frozenset({"DRUCKER_PRAGER"})
DAMPING = ("damping_shear", "damping_bulk")


def name_of(law):
    """What the panel calls a law of the job document."""
    return next((item[1] for item in LAWS if item[0] == law.upper()), law)


def flows(law):
    """Whether a body of this law (either case) pours: a mesh that is bound to it is torn to shreds, its
    surface is the picture."""
    return law.lower() in library.FLOWING


def granular(law):
    """Whether a body of this law (either case) is shown as grains."""
    return law.upper() in GRANULAR


def any_granular(bodies):
    """Whether any of the bodies that are simulated is shown as grains."""
    return any(body.enabled and body.role == "BODY" and granular(body.material.law) for body in bodies)


def any_flows(bodies):
    """Whether any of the bodies that are simulated pours."""
    return any(body.enabled and body.role == "BODY" and material_flows(body.material)
               for body in bodies)


def published_weights(material):
    """Which weights the published law has: a start's name, or "FILE". A file that an older scene
    names counts."""
    if material.published_file and not material.is_property_set("published_weights"):
        return "FILE"
    return material.published_weights


def material_flows(material):
    """The same of a material, whose numbers may decide it."""
    if material.law == "LATENT":
        return material.pours
    if material.law == "NEURAL":
        return published_weights(material) in _POURING_STARTS
    if material.law != "NEURAL_ISOTROPIC":
        return flows(material.law)
    liquid = max(material.yield_strain, material.internal_friction) < library.LIQUID_STRAIN
    return material.tear_strain < library.NEVER_STRAIN or liquid
