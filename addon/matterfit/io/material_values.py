# SPDX-License-Identifier: GPL-3.0-or-later
"""A material of the panel and the `material` of a document, each from the other."""

import os
import zlib

import bpy

from .. import laws, quantities
from ..compat import translate
from ..jobs import EXIT_COMPUTE, JobError
from . import files
from .files import number, numbers

WEIGHTS_SUFFIXES = (".safetensors", ".pt")  # the second of the published law alone
_NO_CORRECTION = (0.0,) * quantities.material("correction").size
_LATENT = "latent"  # the weights that the library carries for the law of that name


def document(material):
    """{law, parameters}, only those the law takes; damping and branches only where there are
    some."""
    found = {"law": material.law.lower()}
    weights = weights_of(material)
    if weights:
        found["weights"] = weights
    for name in laws.PARAMETERS[material.law]:
        if name != "latent":
            found[name] = number(getattr(material, name))
        elif material.use_latent:
            found[name] = numbers(material.latent)
    for name in laws.DAMPING:
        if getattr(material, name) > 0.0:
            found[name] = number(getattr(material, name))
    if any(material.correction):
        found["correction"] = numbers(material.correction)
    if material.maxwell:
        found["maxwell"] = [{"modulus": number(branch.modulus), "time": number(branch.time)}
                            for branch in material.maxwell]
    return found


def excited(material):
    """The `excited` of a document: what a material was seen at when it was fitted; None where it was
    not."""
    strain, compression, expansion, slowest, fastest = numbers(material.excited)
    if not (strain > 0.0 and 0.0 < slowest <= fastest):
        return None
    return {"strain": strain, "compression": compression, "expansion": expansion,
            "rates": [slowest, fastest]}


def fill(material, values, like="", seen=None):
    """Sets law and parameters from the `material` of a document; `like` is the known law that it is
    most like, in the document's words, `seen` the document's `excited`."""
    law = values["law"].upper()
    if law == "NEURAL_ISOTROPIC":  # before the numbers, which they fill in
        _fill_weights(material, values.get("weights", laws.STARTS[0][0].lower()))
    elif law == "LATENT":
        _fill_latent(material, values)
        material.pours = laws.flows(like)
    elif law == "NEURAL":
        weights = values.get("weights", laws.STARTS[0][0].lower())
        is_start = weights.upper() in laws.START_NUMBERS
        material.published_file = "" if is_start else weights
        material.published_weights = weights.upper() if is_start else "FILE"
    for name in laws.PARAMETERS[law]:
        if name != "latent":
            setattr(material, name, values.get(name, quantities.material(name).absent))
    for name in laws.DAMPING:
        setattr(material, name, values.get(name, 0.0))
    material.correction = values.get("correction", _NO_CORRECTION)
    material.maxwell.clear()
    for branch in values.get("maxwell", []):
        added = material.maxwell.add()
        added.modulus, added.time = branch["modulus"], branch["time"]
    material.law = law  # last: the list of a fit's parameters begins with the values
    if seen:
        material.excited = (seen["strain"], seen["compression"], seen["expansion"], *seen["rates"])


def _fill_weights(material, weights):
    is_start = weights.upper() in laws.START_NUMBERS
    material.weights = weights.upper() if is_start else "FILE"
    material.weights_file = "" if is_start else weights


def _fill_latent(material, values):
    weights = values.get("weights", _LATENT)
    material.decoder_file = "" if weights == _LATENT else weights
    material.use_latent = "latent" in values
    if material.use_latent:
        material.latent = values["latent"]


def differ(material, values):
    """Whether a material is another one than the `material` of a document."""
    if values["law"].upper() != material.law:
        return True
    weights = weights_of(material)
    if values.get("weights", weights) != weights:
        return True
    for name in (*laws.PARAMETERS[material.law], *laws.DAMPING):
        if name == "latent":
            if _code_differs(material, values.get(name)):
                return True
        elif not _equal(getattr(material, name), values.get(name, quantities.material(name).absent)):
            return True
    if not all(map(_equal, material.correction, values.get("correction", _NO_CORRECTION))):
        return True
    branches = values.get("maxwell", [])
    return len(branches) != len(material.maxwell) or any(
        not _equal(getattr(ours, name), theirs[name])
        for ours, theirs in zip(material.maxwell, branches, strict=True)
        for name in ("modulus", "time"))


def _code_differs(material, code):
    if material.use_latent != (code is not None):
        return True
    return material.use_latent and not all(map(_equal, material.latent, code))


def _equal(value, wanted):
    return abs(value - wanted) <= 1e-5 * max(abs(wanted), 1e-12)


# -- weights of the neural laws ----------------------------------------------------------------

def weights_of(material):
    """The weights of a neural law in the document's words: a name, or a file; "" of other laws."""
    if material.law == "LATENT":
        return bpy.path.abspath(material.decoder_file) or _LATENT
    if material.law == "NEURAL":
        weights = laws.published_weights(material)
        return bpy.path.abspath(material.published_file) if weights == "FILE" else weights.lower()
    if material.law != "NEURAL_ISOTROPIC":
        return ""
    weights = material.weights
    return bpy.path.abspath(material.weights_file) if weights == "FILE" else weights.lower()


def _weights_file(values):
    """The file that `values` name, "" where their weights have a name."""
    weights = str(values.get("weights", ""))
    return weights if weights.endswith(WEIGHTS_SUFFIXES) else ""


def resolve(values, folder):
    """Gives the file of weights, which a document in `folder` names, by its whole path."""
    file = _weights_file(values)
    if file:
        values["weights"] = os.path.normpath(os.path.join(folder, file))


def weights_paths(path):
    """Where the weights of the material in the file `path` may lie."""
    return [os.path.splitext(path)[0] + suffix for suffix in WEIGHTS_SUFFIXES]


def with_weights_beside(values, path):
    """`values` with the weights' file, where they have one, copied beside the file `path`."""
    file = _weights_file(values)
    if not file:
        return values
    beside = os.path.splitext(path)[0] + os.path.splitext(file)[1]
    _copy(file, beside)
    return {**values, "weights": os.path.basename(beside)}


def with_weights_kept(values, folder):
    """`values` with the weights' file, where that lies in the fit's cache folder and goes with it,
    copied beside the .blend file. The name is that of the content, so that no copy takes another's
    place."""
    file = _weights_file(values)
    if os.path.dirname(file) != os.path.normpath(folder):
        return values
    kept = f"//matterfit_weights_{zlib.crc32(_read(file)):08x}{os.path.splitext(file)[1]}"
    _copy(file, bpy.path.abspath(kept))
    return {**values, "weights": kept}


def _copy(source, target):
    if os.path.abspath(source) == os.path.abspath(target):
        return
    files.write_bytes(target, _read(source))


def _read(path):
    try:
        with open(path, "rb") as stream:
            return stream.read()
    except OSError as error:
        raise JobError(translate("{path}: the weights of this material could not be read: {error}. "
                                 "Fit again.").format(path=path, error=error.strerror or error),
                       EXIT_COMPUTE) from error
