# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials that the artist has given a result stay when it gets another mesh; those that came from his
object follow that."""

from .attached import TAG

GIVEN = "matterfit_materials"  # on a mesh of ours: names of the materials that it was made with


def on_mesh(mesh, before, source):
    """`mesh` takes the place of `before`; what it is made with is remembered."""
    made = [slot.material for slot in source.material_slots] or list(mesh.materials)
    while len(mesh.materials) < len(made):
        mesh.materials.append(None)
    for index, material in enumerate(made):
        mesh.materials[index] = material
    given = _names(mesh.materials)
    for index, material in _chosen(before, source):
        while len(mesh.materials) <= index:
            mesh.materials.append(None)
        mesh.materials[index] = material
    mesh[GIVEN] = given


def on_object(item, before, source):
    """The object shows the artist's own mesh in place of `before`, whose materials are not ours to
    change: the object has its own then."""
    for index, material in _chosen(before, source):
        if index < len(item.material_slots):
            item.material_slots[index].link = "OBJECT"
            item.material_slots[index].material = material


def _chosen(mesh, source):
    """[(slot, material)] that the artist has chosen for a mesh of ours since it was made. An older version
    did not say with which that was: with those of `source`, then."""
    if mesh.get(TAG) is None:
        return []
    now = _names(slot.material for slot in source.material_slots)
    given = mesh.get(GIVEN, now).split("\n")
    return [(index, material) for index, material in enumerate(mesh.materials)
            if index >= len(given) or _names([material]) != given[index]]


def _names(materials):
    return "\n".join("" if material is None else material.name for material in materials)
