# SPDX-License-Identifier: GPL-3.0-or-later
"""PC2 files, played by Blender's Mesh Cache modifier."""

from .. import compat
from . import nodes, shapes

NAME = "Matterfit Cache"


def play(item, points, first, mirrored=False):
    """Moves the vertices of `item` by a PointCache whose first sample is at scene frame `first`; `mirrored`
    where the object is scaled by -1 along X, and the cache is not."""
    modifier = item.modifiers.get(NAME)
    if modifier is None:
        stop = shapes.cache_place(item)
        modifier = item.modifiers.new(NAME, "MESH_CACHE")
        compat.move_modifier(item, NAME, stop)
        modifier = item.modifiers[NAME]
    modifier.cache_format = "PC2"
    modifier.filepath = nodes.relative_path(points.path)
    modifier.interpolation = "LINEAR"
    modifier.deform_mode = "OVERWRITE"
    modifier.play_mode = "SCENE"
    modifier.time_mode = "FRAME"
    modifier.frame_start = float(first)
    modifier.frame_scale = 1.0
    modifier.forward_axis = "POS_Y"
    modifier.up_axis = "POS_Z"
    compat.flip_mesh_cache(modifier, "X" if mirrored else "")
