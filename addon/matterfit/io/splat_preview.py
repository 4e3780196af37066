# SPDX-License-Identifier: GPL-3.0-or-later
"""Ellipsoids that show where a body's file of Gaussian splats lies, to place and crop it by."""

import os
import tempfile

import bpy
import numpy
from mathutils import Matrix

from .. import native
from ..compat import translate
from ..jobs import JobError
from ..props import reactions
from . import files, splat_nodes, transforms

MOST = 20000  # ellipsoids
MODIFIER = "Matterfit Splats"
# On the object: the file that it shows; how many splats that has, and how many are shown.
FILE, TOLD = "matterfit_splats", "matterfit_splats_told"


def shown(body):
    """The object that shows the row's file, None where there is none, or it was deleted."""
    item = body.preview
    if item is None or item.name not in body.id_data.objects or item.data is None:
        return None
    return item


def show(scene, body):
    """Reads the row's file and shows it, in place of what was shown of the row; the object."""
    where = translate("Body '{name}'").format(name=body.name)
    if not body.filepath:
        raise JobError(translate("{where}: no file is chosen. Choose one.").format(where=where))
    path = files.absolute(body.filepath)
    files.require_file(path, where)
    arrays, told = _read(path)
    hide(body)
    # A splat that is shown stands for several where they are thinned out: together they have the volume of all.
    grown = (told["gaussians"] / told["written"]) ** (1.0 / 3.0)
    mesh = _mesh(f"{body.name} Splats", arrays, grown)
    item = bpy.data.objects.new(mesh.name, mesh)
    item[FILE] = path
    item[TOLD] = [told["gaussians"], told["written"]]
    item.hide_render = True  # Blender blends splats otherwise: Render Splats draws them
    item.hide_select = True
    item.lock_location = item.lock_rotation = item.lock_scale = (True, True, True)
    scene.collection.objects.link(item)
    body.preview = item
    follow(body)
    return item


def hide(body):
    """Removes what shows the row's file, with its mesh and nodes."""
    item, body.preview = body.preview, None
    if item is None or FILE not in item:
        return
    mesh = item.data
    trees = [modifier.node_group for modifier in item.modifiers if modifier.type == "NODES"]
    bpy.data.objects.remove(item)
    if mesh is not None and mesh.users == 0:
        bpy.data.meshes.remove(mesh)
    for tree in trees:
        if tree is not None and tree.users == 0:
            bpy.data.node_groups.remove(tree)


@reactions.splats_changed.done_by
def follow(body):
    """What is shown of the row follows its axis, scale, crop box and opacity; of another file, or where the
    body is made from something else, nothing is shown any more."""
    item = shown(body)
    if item is None:
        return
    if body.source != "GAUSSIANS" or files.absolute(body.filepath) != item[FILE]:
        if not reactions.rewriting():
            hide(body)
        return
    scale = body.file_scale / transforms.metres(body.id_data)
    item.matrix_world = transforms.upright(body.file_up).to_matrix().to_4x4() @ Matrix.Scale(scale, 4)
    modifier = item.modifiers.get(MODIFIER) or item.modifiers.new(MODIFIER, "NODES")
    modifier.node_group = splat_nodes.ellipsoids_tree(modifier.node_group, item.name, body.crop,
                                                      body.opacity_threshold)


def _read(path):
    handle, npz = tempfile.mkstemp(suffix=".npz", dir=bpy.app.tempdir or None)
    os.close(handle)
    try:
        told = native.splats(path, npz, {"most": MOST})
        with numpy.load(npz, allow_pickle=False) as arrays:
            return dict(arrays), told
    finally:
        os.remove(npz)


def _mesh(name, arrays, grown):
    """Points with the attributes of splat_nodes, their sizes `grown` times."""
    places = arrays["positions"]
    mesh = bpy.data.meshes.new(name)
    mesh.vertices.add(len(places))
    mesh.vertices.foreach_set("co", numpy.ascontiguousarray(places, dtype=numpy.float32).ravel())
    colours = numpy.ones((len(places), 4), dtype=numpy.float32)
    colours[:, :3] = _linear(arrays["colours"])
    for attribute, kind, key, values in (
            (splat_nodes.COLOUR, "FLOAT_COLOR", "color", colours),
            (splat_nodes.TURN, "FLOAT_VECTOR", "vector", euler_angles(arrays["rotations"])),
            (splat_nodes.SIZE, "FLOAT_VECTOR", "vector", grown * arrays["scales"]),
            (splat_nodes.OPACITY, "FLOAT", "value", arrays["opacities"])):
        of_points = mesh.attributes.new(attribute, kind, "POINT")
        of_points.data.foreach_set(key, numpy.ascontiguousarray(values, dtype=numpy.float32).ravel())
    mesh.update()
    return mesh


def _linear(colours):
    """sRGB as light."""
    return numpy.where(colours <= 0.04045, colours / 12.92, ((colours + 0.055) / 1.055) ** 2.4)


def euler_angles(turns):
    """(N, 3) Euler angles XYZ of quaternions (N, 4), w first."""
    w, x, y, z = turns.astype(numpy.float64).T
    across = numpy.clip(2.0 * (w * y - z * x), -1.0, 1.0)
    return numpy.stack((numpy.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)),
                        numpy.arcsin(across),
                        numpy.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))), axis=1)
