# SPDX-License-Identifier: GPL-3.0-or-later
"""A VDB sequence as a Volume object, and its level set as a mesh."""

import bpy

from . import nodes


def volume(work, name, sequence, grids):
    """Shows a body's volumes; `work` is the Attachment. Returns how many frames there are."""
    count = sequence.last - sequence.first + 1
    item = work.object(
        f"volume:{name}", f"{name} volume",
        lambda label: bpy.data.objects.new(label, bpy.data.volumes.new(label)))
    item.scale = (work.unit,) * 3
    volume = item.data
    volume.filepath = nodes.relative_path(sequence.path(sequence.first))
    volume.is_sequence = True
    volume.frame_start = sequence.first
    volume.frame_offset = sequence.first - 1
    volume.frame_duration = count
    volume.sequence_mode = "EXTEND"
    if hasattr(volume, "velocity_unit"):
        volume.velocity_unit = "SECOND"
    if not volume.materials:
        index, _body = work.body(name)
        volume.materials.append(nodes.volume_material(f"Matterfit {name} Volume",
                                                      nodes.COLORS[index % len(nodes.COLORS)]))
    if "surface" in grids:
        _surface(work, name, item)
    return count


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
    modifier.threshold = 0.0
    modifier.resolution_mode = "GRID"
    modifier.use_smooth_shade = True
    item.active_material = item.active_material or work.material(name)
