# SPDX-License-Identifier: GPL-3.0-or-later
"""Material and quality presets: JSON files with provenance, read once. Ours come with the add-on;
those that the user adds lie in Blender's folder for data files."""

import contextlib
import functools
import os
import zlib

import bpy

from ..compat import translate
from ..jobs import EXIT_COMPUTE, JobError
from ..props import reactions
from . import files, material_values
from .material_check import check

_materials = None
_items = None  # Blender keeps no reference to the texts of a dynamic enumeration.
_old_items = []  # Those that a menu may still show.
_applying = []
_faults = []
USER_NUMBERS = 1 << 24  # A user's presets have numbers from here on.


def folder():
    """presets/ inside the package where it was packaged, else beside addon/ in the tree."""
    package = os.path.dirname(os.path.dirname(os.path.realpath(__file__)))
    for candidate in (os.path.join(package, "presets"),
                      os.path.join(os.path.dirname(os.path.dirname(package)), "presets")):
        if os.path.isdir(candidate):
            return candidate
    raise JobError(translate("The folder 'presets' is missing beside the add-on. Install the "
                             "package again."))


def user_folder():
    """Where the user's own presets lie; it may not exist."""
    return os.path.join(bpy.utils.user_resource("DATAFILES"), "matterfit", "materials")


def materials():
    """{identifier: document} of all material presets, in their files' order; the user's last."""
    global _materials
    if _materials is None:
        base = os.path.join(folder(), "materials")
        _materials = {}
        _faults.clear()
        for name in _json_files(base):
            _materials[name[:-5].upper()] = read(os.path.join(base, name), name)
        base = user_folder()
        for name in _json_files(base):
            # One damaged file of the user must not take the panel away.
            try:
                document = read(os.path.join(base, name), name)
            except JobError as error:
                _faults.append(str(error))
                continue
            identifier = _user_identifier(name[:-5])
            document["number"] = _user_number(identifier)
            document["path"] = os.path.join(base, name)
            _materials[identifier] = document
    return _materials


def _json_files(base):
    try:
        return sorted(name for name in os.listdir(base) if name.endswith(".json"))
    except OSError:
        return []


def _user_identifier(name):
    return "USER_" + files.safe_name(name).upper()


def _user_number(identifier):
    """The same on every machine, so that files keep their choice; at most 2³¹ - 1."""
    taken = {document["number"] for document in _materials.values()}
    number = USER_NUMBERS + zlib.crc32(identifier.encode()) % (1 << 30)
    while number in taken:
        number += 1
    return number


def faults():
    """What is wrong with presets of the user that are left out."""
    return list(_faults)


def forget():
    """Reads the presets anew when they are asked for next."""
    global _materials, _items
    if _items is not None:
        _old_items.append(_items)
    _materials = _items = None


def is_users(identifier):
    return "path" in materials().get(identifier, {})


def add(document, name):
    """Adds a preset of the user; returns its identifier."""
    document = check({**document, "name": name}, name)
    path = os.path.join(user_folder(), files.safe_name(name) + ".json")
    identifier = _user_identifier(name)
    if identifier in materials() or os.path.exists(path):
        raise JobError(translate("preset '{name}': there is one of this name. Choose another name, "
                                 "or remove that one first.").format(name=name))
    write(path, document, name)
    forget()
    return identifier


def remove(identifier):
    """Deletes a preset of the user; materials that had it keep their values."""
    path = materials()[identifier]["path"]
    try:
        for one in (*material_values.weights_paths(path), path):
            with contextlib.suppress(FileNotFoundError):
                os.remove(one)
    except OSError as error:
        raise JobError(translate(
            "{path}: could not be deleted: {error}. Change the folder's permissions.").format(
                path=path, error=error.strerror or error), EXIT_COMPUTE) from error
    using = [body.material for scene in bpy.data.scenes for body in scene.matterfit.bodies
             if body.material.preset == identifier]
    for material in using:
        material.preset = "CUSTOM"
    forget()


def read(path, name=""):
    """The material in a file, checked; `name` is what messages call the file. Weights that lie beside
    it are given by their whole path."""
    document = check(files.read_json(path), name or path)
    material_values.resolve(document["material"], os.path.dirname(path))
    return document


def write(path, document, name):
    """Writes a material to a file, under that name, and its weights beside it, where it has a file of
    them."""
    document = saved(document, name)
    document["material"] = material_values.with_weights_beside(document["material"], path)
    files.write_json(path, document)


def cells_across(quality):
    """Cells across the thinnest part for a quality ('STANDARD')."""
    return _quality(quality)["cells_across"]


def poured_particles(quality):
    """Particles of a scene in which something pours, at least, for a quality."""
    return _quality(quality)["poured_particles"]


def _quality(quality):
    return _qualities()[quality.lower()]


@functools.cache  # panels ask for it at every redraw
def _qualities():
    return files.read_json(os.path.join(folder(), "quality.json"))["presets"]


@reactions.preset_items.done_by
def enum_items():
    """Items of the preset enumeration; Custom keeps the number 0 so that files stay readable."""
    global _items
    if _items is None:
        _items = [("CUSTOM", "Custom", "The values below, as they are", 0)]
        for identifier, document in materials().items():
            about = " ".join(filter(None, (document["source"], warning(document))))
            _items.append((identifier, document["name"], about, document["number"]))
    return _items


def saved(document, name):
    """A material as it is written to a file: under another name, without what is only ours."""
    kept = {key: value for key, value in document.items() if key not in ("number", "path")}
    return {**kept, "name": name}


def warning(document):
    """What the fit that found a material says against using it; "" where it says nothing."""
    provenance = document.get("provenance")
    return str(provenance.get("warning") or "") if isinstance(provenance, dict) else ""


@reactions.preset_chosen.done_by
def apply(material):
    """Fills in the chosen preset. The density goes to the body that owns the material."""
    if _applying or material.preset not in materials():
        return
    document = materials()[material.preset]
    _applying.append(material.preset)
    try:
        material_values.fill(material, document["material"], like_of(document),
                             document.get("excited"))
        material.source = document["source"]
        owner = owner_of(material)
        if owner is not None:
            owner.density = document["density"]
    finally:
        _applying.pop()


def like_of(document):
    """The known law that a material without a class is most like, "" where its file does not say."""
    provenance = document.get("provenance")
    like = provenance.get("like") if isinstance(provenance, dict) else None
    return str(like.get("law") or "") if isinstance(like, dict) else ""


def owner_of(material):
    """The body whose material this is."""
    scene = material.id_data
    for body in scene.matterfit.bodies:
        if body.material == material:
            return body
    return None


def differs(material):
    """True where values were changed after the preset was chosen."""
    if material.preset not in materials():  # Custom, or one that this machine does not have
        return False
    return material_values.differ(material, materials()[material.preset]["material"])
