# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether a file's JSON is a material as fits and the panel write it."""

import math

from .. import laws, library, quantities
from ..compat import translate
from ..jobs import JobError
from . import number_text

SCHEMA = "matterfit.material/1"


def check(document, name):
    """The document, if it is a material; JobError that says what is wrong otherwise."""
    schema = document.get("schema") if isinstance(document, dict) else None
    if schema != SCHEMA:
        raise JobError(translate("{name}: schema is {schema}, expected '{expected}'.").format(
            name=name, schema=repr(schema), expected=SCHEMA))
    _check_needed(name, document, ("material", "name", "source", "density"))
    for key in ("name", "source"):
        _check_text(name, key, document[key])
    material = document["material"] if isinstance(document["material"], dict) else {}
    law = str(material.get("law", "")).upper()
    if law not in laws.PARAMETERS:
        raise JobError(translate("{name}: law is {law}, which is not known.").format(
            name=name, law=repr(material.get("law"))))
    parameters = laws.PARAMETERS[law]
    numbers = {*parameters, *laws.DAMPING} - {"latent"}
    known = {"law", "maxwell", "correction", *parameters, *laws.DAMPING}
    if law in laws.NEURAL:
        known.add("weights")
        _check_text(name, "weights", material.get("weights", ""))
    for key in material:
        if key not in known:
            raise JobError(translate("{name}: '{key}' is not a parameter of {law}.").format(
                name=name, key=key, law=material["law"]))
    _check_needed(name, material,
                  [key for key in parameters if quantities.material(key).absent is None])
    for key in sorted(numbers):
        row = quantities.material(key)
        _check_number(name, row, key, material.get(key, row.absent))
    for key in ("latent", "correction"):
        if key in material:
            _check_code(name, key, material[key])
    _check_number(name, quantities.DENSITY, "density", document["density"])
    if document.get("excited") is not None:
        _check_excited(name, document["excited"])
    branches = material.get("maxwell", [])
    if not isinstance(branches, list) or len(branches) > library.MOST_BRANCHES:
        raise JobError(translate("{name}: 'maxwell' is not a list of at most {n} branches.").format(
            name=name, n=library.MOST_BRANCHES))
    for branch in branches:
        for key in ("modulus", "time"):
            _check_number(name, quantities.find(f"material.maxwell.{key}"), f"maxwell {key}",
                          branch.get(key) if isinstance(branch, dict) else None)
    return document


def _check_needed(name, document, keys):
    for key in keys:
        if key not in document:
            raise JobError(translate("{name}: '{key}' is missing.").format(name=name, key=key))


def _check_text(name, key, value):
    if not isinstance(value, str):
        raise JobError(translate("{name}: {key} is {value}, expected a text.").format(
            name=name, key=key, value=repr(value)))


def _check_number(name, quantity, key, value):
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    if not is_number or not math.isfinite(value):
        raise JobError(translate("{name}: {key} is {value}, expected a number.").format(
            name=name, key=key, value=repr(value)))
    if value < 0.0 <= quantity.least or value == 0.0 and quantity.positive:
        raise JobError(translate("{name}: {key} is {value}, expected a number above 0.").format(
            name=name, key=key, value=repr(value)))
    if not quantity.takes(value):
        raise JobError(translate("{name}: {key} is {value}, and the panel takes from {least} to {most}.").format(
            name=name, key=key, value=repr(value), least=number_text.short(quantity.least, 6),
            most=number_text.short(quantity.most, 6)))


def _check_code(name, key, code):
    row = quantities.material(key)
    if not isinstance(code, list) or len(code) != row.size:
        raise JobError(translate("{name}: '{key}' is not a list of {n} numbers.").format(
            name=name, key=key, n=row.size))
    for value in code:
        _check_number(name, row, key, value)


def _check_excited(name, seen):
    rates = seen.get("rates") if isinstance(seen, dict) else None
    entries = [] if rates is None else [seen.get(key) for key in
                                        ("strain", "compression", "expansion")]
    sound = isinstance(rates, list) and len(rates) == 2 and all(
        isinstance(value, int | float) and math.isfinite(value) and value >= 0.0
        for value in (*entries, *rates))
    if not sound:
        raise JobError(translate("{name}: 'excited' does not hold strains and two rates.").format(
            name=name))
