# SPDX-License-Identifier: GPL-3.0-or-later
"""The artist's own mesh, moved with the material of its body."""

import bpy
from mathutils import Quaternion, Vector

from ..jobs import JobError
from . import frames, meshes, point_cache, shapes
from .attached import TAG
from .visibility import CHOSEN_TAG, HIDDEN_TAG


def render_mesh(work, entry, points):
    """A copy of the artist's object, without its animation: the cache holds it all. It shows the
    artist's own mesh, or what modifiers have made of it, and keeps what refines either."""
    _index, body = work.body(entry["body"])
    if body is None or body.object is None:
        return
    source = body.object
    bound = shapes.bound_shape(source)

    def make(label):
        copy = source.copy()
        copy.name = label
        copy.animation_data_clear()
        copy.constraints.clear()
        copy.parent = None
        for modifier in [other for other in copy.modifiers
                         if shapes.is_own(other) or other.type == "PARTICLE_SYSTEM"
                         and not (shapes.is_hair(other) and not bound.made)]:
            copy.modifiers.remove(modifier)
        for modifier in list(source.modifiers)[:bound.stop] if bound.made else ():
            if modifier.name in copy.modifiers:
                copy.modifiers.remove(copy.modifiers[modifier.name])
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
    _give_mesh(work, item, source, bound)
    count = len(item.data.vertices)
    if count != points.points:
        raise JobError(f"{points.path}: holds {points.points} points, but the mesh of "
                       f"'{source.name}' has {count} vertices. It was changed after the bake: "
                       "bake again.")
    # No material of ours: a slot would be made in the artist's mesh, which is shown here.
    point_cache.play(item, points, work.first)


def _give_mesh(work, item, source, bound):
    """The artist's mesh itself; a mesh of ours where modifiers have made other vertices."""
    before = item.data
    if bound.made:
        item.data = _made_mesh(work, source, bound)
    elif before is not source.data:
        item.data = source.data
    if before.get(TAG) and before.users == 0:
        bpy.data.meshes.remove(before)


def _made_mesh(work, source, bound):
    """What the modifiers before `bound` make of the object at the first frame."""
    with meshes.shown([source]), frames.frame_kept(work.scene):
        work.scene.frame_set(work.first)
        with shapes.modifiers_limited(source, bound.stop):
            depsgraph = bpy.context.evaluated_depsgraph_get()
            mesh = bpy.data.meshes.new_from_object(
                source.evaluated_get(depsgraph), preserve_all_data_layers=True,
                depsgraph=depsgraph)
    mesh.name = f"{source.name} {work.take.name}"
    mesh[TAG] = 1
    return mesh
