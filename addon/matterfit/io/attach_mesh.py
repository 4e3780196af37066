# SPDX-License-Identifier: GPL-3.0-or-later
"""The artist's own mesh, moved with the material of its body."""

import os

import bpy
from mathutils import Quaternion, Vector

from ..jobs import JobError
from . import attached, frames, meshes, point_cache, refinement, shapes
from .attached import TAG
from .visibility import CHOSEN_TAG, HIDDEN_TAG


def render_mesh(work, entry, points):
    """A copy of the artist's object, without its animation: the cache holds it all. It shows the
    artist's own mesh, or what modifiers have made of it, and keeps what refines either; where that was
    refined before it was bound, the finer mesh."""
    _index, body = work.body(entry["body"])
    if body is None or body.object is None:
        return
    source = body.object
    how = refinement.how_refined(os.path.join(work.folder, entry.get("mesh", "")))
    bound = shapes.bound_shape(source) if how is None else shapes.refined_shape(source)

    def make(label):
        if source.type != "MESH":
            mesh = bpy.data.meshes.new(label)
            mesh[TAG] = _kind(bound, how)
            return bpy.data.objects.new(label, mesh)
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

    _remove_other_kind(work, f"mesh:{entry['name']}", _kind(bound, how))
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
    _give_mesh(work, item, source, bound, how)
    count = len(item.data.vertices)
    if count != points.points:
        raise JobError(f"{points.path}: holds {points.points} points, but the mesh of "
                       f"'{source.name}' has {count} vertices. It was changed after the bake: "
                       "bake again.")
    # No material of ours: a slot would be made in the artist's mesh, which is shown here.
    point_cache.play(item, points, work.first)


def _give_mesh(work, item, source, bound, how):
    """The artist's mesh itself; a mesh of ours where modifiers have made other vertices, or we have."""
    before = item.data
    if bound.made:
        item.data = _made_mesh(work, source, bound, how)
    elif before is not source.data:
        item.data = source.data
    if before is not item.data and before.get(TAG) and before.users == 0:
        bpy.data.meshes.remove(before)


def _made_mesh(work, source, bound, how):
    """What the modifiers before `bound` make of the object at the first frame."""
    with meshes.shown([source]), frames.frame_kept(work.scene):
        work.scene.frame_set(work.first)
        if how is None:
            mesh = refinement.made_mesh(source, bound)
        else:
            mesh = refinement.refined_mesh(source, how)
    mesh.name = f"{source.name} {work.take.name}"
    mesh[TAG] = _kind(bound, how)
    return mesh


def _kind(bound, how):
    """Which mesh is shown: 0 the object's own, 1 what modifiers have made of it, 2 a refined one."""
    return 2 if how is not None else int(bound.made)


def _remove_other_kind(work, tag, kind):
    """An object that shows another kind has other modifiers: it is made anew."""
    for item in [item for item in work.items
                 if item[TAG] == tag and item.data.get(TAG, 0) != kind]:
        work.items.remove(item)
        attached.remove([item])
