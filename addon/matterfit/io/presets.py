# SPDX-License-Identifier: GPL-3.0-or-later
"""Material and quality presets: JSON files with provenance, read once."""

import os

from ..jobs import JobError
from ..props import choices
from . import files

SCHEMA = "matterfit.material/1"
_materials = None
_items = None  # Blender keeps no reference to the texts of a dynamic enumeration.
_applying = []


def folder():
    """presets/ inside the package where it was packaged, else beside addon/ in the tree."""
    package = os.path.dirname(os.path.dirname(os.path.realpath(__file__)))
    for candidate in (os.path.join(package, "presets"),
                      os.path.join(os.path.dirname(os.path.dirname(package)), "presets")):
        if os.path.isdir(candidate):
            return candidate
    raise JobError("The folder 'presets' is missing beside the add-on. Install the package again.")


def materials():
    """{identifier: document} of all material presets, in their files' order."""
    global _materials
    if _materials is None:
        base = os.path.join(folder(), "materials")
        _materials = {}
        for name in sorted(os.listdir(base)):
            if name.endswith(".json"):
                _materials[name[:-5].upper()] = check(files.read_json(os.path.join(base, name)),
                                                      name)
    return _materials


def cells_across(quality):
    """Cells across the thinnest part for a quality ('STANDARD')."""
    document = files.read_json(os.path.join(folder(), "quality.json"))
    return document["presets"][quality.lower()]["cells_across"]


def check(document, name):
    """The document, if it is a material; JobError that says what is wrong otherwise."""
    if document.get("schema") != SCHEMA:
        raise JobError(f"{name}: schema is {document.get('schema')!r}, expected '{SCHEMA}'.")
    material = document.get("material", {})
    law = str(material.get("law", "")).upper()
    if law not in choices.LAW_PARAMETERS:
        raise JobError(f"{name}: law is {material.get('law')!r}, which is not known.")
    known = {"law", *choices.LAW_PARAMETERS[law], *choices.DAMPING_PARAMETERS}
    for key in material:
        if key not in known:
            raise JobError(f"{name}: '{key}' is not a parameter of {material['law']}.")
    for key in ("name", "source", "density"):
        if key not in document:
            raise JobError(f"{name}: '{key}' is missing.")
    return document


def enum_items():
    """Items of the preset enumeration; Custom keeps the number 0 so that files stay readable."""
    global _items
    if _items is None:
        _items = [("CUSTOM", "Custom", "The values below, as they are", 0)]
        for identifier, document in materials().items():
            _items.append((identifier, document["name"], document["source"], document["number"]))
    return _items


def apply(material):
    """Fills in the chosen preset. The density goes to the body that owns the material."""
    if _applying or material.preset == "CUSTOM":
        return
    document = materials()[material.preset]
    _applying.append(material.preset)
    try:
        values = document["material"]
        material.law = values["law"].upper()
        for name in choices.LAW_PARAMETERS[material.law]:
            default = material.bl_rna.properties[name].default
            setattr(material, name, values.get(name, default if name in ("exponent",) else 0.0))
        for name in choices.DAMPING_PARAMETERS:
            setattr(material, name, values.get(name, 0.0))
        material.source = document["source"]
        owner = owner_of(material)
        if owner is not None:
            owner.density = document["density"]
    finally:
        _applying.pop()


def owner_of(material):
    """The body whose material this is."""
    scene = material.id_data
    for body in scene.matterfit.bodies:
        if body.material == material:
            return body
    return None


def differs(material):
    """True where values were changed after the preset was chosen."""
    if material.preset == "CUSTOM":
        return False
    values = materials()[material.preset]["material"]
    if values["law"].upper() != material.law:
        return True
    for name in (*choices.LAW_PARAMETERS[material.law], *choices.DAMPING_PARAMETERS):
        default = 1.0 if name == "exponent" else 0.0
        wanted = values.get(name, default)
        if abs(getattr(material, name) - wanted) > 1e-5 * max(abs(wanted), 1e-12):
            return True
    return False
