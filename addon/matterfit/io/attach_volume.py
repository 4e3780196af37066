# SPDX-License-Identifier: GPL-3.0-or-later
"""A VDB sequence as a Volume object, and its level set as a mesh."""

import bpy

from ..props import reactions
from . import nodes, result_objects
from .attached import TAG

SEPARATION_TAG = "matterfit_separation"  # [m], of the particles that a surface is around
SMOOTH = "Matterfit Smooth"
VELOCITY = "Matterfit Velocity"


def volume(work, name, sequence, grids):
    """Shows a body's volumes; `work` is the Attachment. Returns how many frames there are."""
    fog = next((grid for grid in grids if grid != "surface"), None)
    item = _object(work, "volume", name, sequence, fog or "surface")
    if "surface" in grids:
        # Its voxels are smaller than those of fog, so that the two are shifted apart.
        _surface(work, name, _object(work, "level", name, sequence, "surface") if fog else item)
    return sequence.last - sequence.first + 1


def _object(work, kind, name, sequence, grid):
    """The Volume object of that kind, placed so that `grid` lies where the file has it."""
    item = work.object(
        f"{kind}:{name}", f"{name} {kind}",
        lambda label: bpy.data.objects.new(label, bpy.data.volumes.new(label)))
    item.scale = (work.unit,) * 3
    volume = item.data
    volume.filepath = nodes.relative_path(sequence.path(sequence.first))
    volume.is_sequence = True
    volume.frame_start = sequence.first
    volume.frame_offset = sequence.first - 1
    volume.frame_duration = sequence.last - sequence.first + 1
    volume.sequence_mode = "EXTEND"
    if hasattr(volume, "velocity_unit"):
        volume.velocity_unit = "SECOND"
    item.delta_location = (-0.5 * _voxel(sequence.path(sequence.first), grid) * work.unit,) * 3
    if not volume.materials:
        index, _body = work.body(name)
        volume.materials.append(nodes.volume_material(f"Matterfit {name} Volume",
                                                      nodes.COLORS[index % len(nodes.COLORS)]))
    return item


def _voxel(path, wanted):
    """Width [m] of the voxels of a file's grid of that name. Blender takes the value of a voxel for that
    of a cube from its place on, and shifts fog and Volume to Mesh by half a voxel; in the files the place
    is the middle of the cube, as everywhere else."""
    # A sequence knows its file only where it is evaluated.
    single = bpy.data.volumes.new("Matterfit")
    try:
        single.filepath = path
        single.grids.load()
        return next((grid.matrix_object[0][0] for grid in single.grids if grid.name == wanted), 0.0)
    finally:
        bpy.data.volumes.remove(single)


def _surface(work, name, volume_object):
    def make(label):
        mesh = bpy.data.meshes.new(label)
        mesh.materials.append(work.material(name))
        return bpy.data.objects.new(label, mesh)

    item = work.object(f"surface:{name}", f"{name} surface", make)
    modifier = item.modifiers.get("Matterfit Surface")
    if modifier is None:
        modifier = item.modifiers.new("Matterfit Surface", "VOLUME_TO_MESH")
    modifier.object = volume_object
    modifier.grid_name = "surface"
    modifier.resolution_mode = "GRID"
    modifier.use_smooth_shade = True
    item.active_material = item.active_material or work.material(name)
    item[SEPARATION_TAG] = work.separation
    _style(item, work.scene.matterfit.output)


def blur(work):
    """Gives each surface the velocity of the particles, where those have one."""
    if "velocity" not in work.document.get("output", {}).get("attributes", []):
        return
    shown = [(item, result_objects.kind_and_body(item)) for item in work.items]
    clouds = {name: item for item, (kind, name) in shown if kind == "points"}
    for item, (kind, name) in shown:
        if kind == "surface" and name in clouds:
            modifier = item.modifiers.get(VELOCITY) or item.modifiers.new(VELOCITY, "NODES")
            modifier.node_group = nodes.velocity_tree(f"{VELOCITY} {item.name}", clouds[name],
                                                     work.unit)


@reactions.surface_restyled.done_by
def restyle(settings):
    """Every surface of the scene as Output has it now."""
    for item in settings.id_data.objects:
        if item.get(TAG, "").startswith("surface:"):
            _style(item, settings.output)


def _style(item, output):
    separation = item.get(SEPARATION_TAG, 0.0)
    item.modifiers["Matterfit Surface"].threshold = output.surface_offset * separation
    modifier = item.modifiers.get(SMOOTH)
    if modifier is None:
        modifier = item.modifiers.new(SMOOTH, "SMOOTH")
    modifier.iterations = output.surface_smoothing
    modifier.show_viewport = modifier.show_render = output.surface_smoothing > 0
