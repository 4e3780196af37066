# SPDX-License-Identifier: GPL-3.0-or-later
"""The artist's own mesh, moved with the material of its body."""

from mathutils import Quaternion, Vector

from ..jobs import JobError
from . import meshes, point_cache
from .visibility import CHOSEN_TAG, HIDDEN_TAG


def render_mesh(work, entry, points):
    """A linked copy of the artist's object, without its animation: the cache holds it all."""
    _index, body = work.body(entry["body"])
    if body is None or body.object is None:
        return
    source = body.object

    def make(label):
        copy = source.copy()
        copy.name = label
        copy.animation_data_clear()
        copy.constraints.clear()
        copy.parent = None
        for modifier in [other for other in copy.modifiers
                         if meshes.is_own(other) or other.type == "PARTICLE_SYSTEM"]:
            copy.modifiers.remove(modifier)
        copy.hide_render = False
        copy.hide_viewport = False
        for tag in (HIDDEN_TAG, CHOSEN_TAG):
            if tag in copy:
                del copy[tag]
        return copy

    item = work.object(f"mesh:{entry['name']}", f"{body.name} mesh", make)
    place = entry["transform"]
    item.rotation_mode = "QUATERNION"
    item.location = Vector(place["position"]) * work.unit
    item.rotation_quaternion = Quaternion(place["rotation"])
    item.scale = (1.0, 1.0, 1.0)
    for name in ("delta_location",):
        setattr(item, name, (0.0, 0.0, 0.0))
    item.delta_rotation_quaternion = (1.0, 0.0, 0.0, 0.0)
    item.delta_scale = (1.0, 1.0, 1.0)
    if item.data is not source.data:
        item.data = source.data
    count = len(source.data.vertices)
    if count != points.points:
        raise JobError(f"{points.path}: holds {points.points} points, but the mesh of "
                       f"'{source.name}' has {count} vertices. It was changed after the bake: "
                       "bake again.")
    # No material of ours: a slot would be made in the artist's mesh, which is shown here.
    point_cache.play(item, points, work.first)
