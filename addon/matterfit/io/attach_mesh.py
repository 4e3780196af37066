# SPDX-License-Identifier: GPL-3.0-or-later
"""The artist's own mesh, moved with the material of its body."""

import contextlib
import os

import bpy
from mathutils import Quaternion, Vector

from .. import compat
from ..jobs import JobError
from . import point_cache, refinement, result_mesh, shapes
from .attached import CACHE_TAG, TAG
from .visibility import CHOSEN_TAG, HIDDEN_TAG

# Settings that the object made of text or curves takes over from the artist's.
LOOKS = ("color", "pass_index", "visible_camera", "visible_diffuse", "visible_glossy", "visible_transmission",
         "visible_volume_scatter", "visible_shadow", "is_holdout", "is_shadow_catcher")


def render_mesh(work, entry, points):
    """A copy of the artist's object, without its animation: the cache holds it all. It keeps what
    refines the mesh that it shows (result_mesh); what the artist has done to it stays as it is baked
    again."""
    _index, body = work.body(entry["body"])
    if body is None or body.object is None:
        return
    source = body.object
    path = os.path.join(work.folder, entry.get("mesh") or entry.get("cage", ""))
    how = refinement.how_refined(path)
    bound = (shapes.bound_shape(source) if how is None and source.type == "MESH"
             else shapes.refined_shape(source))

    def make(label):
        if source.type != "MESH":
            return _bare(source, label, result_mesh.kind(bound, how))
        copy = source.copy()
        copy.name = label
        copy.animation_data_clear()
        copy.constraints.clear()
        copy.parent = None
        for modifier in [other for other in copy.modifiers if _left_out(other, bound)]:
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
    # A mesh that a negative scale mirrors has its faces inside out; Blender takes that from the object's scale.
    mirrored = refinement.is_mirrored(path)
    item.scale = (-1.0 if mirrored else 1.0, 1.0, 1.0)
    for name in ("delta_location",):
        setattr(item, name, (0.0, 0.0, 0.0))
    item.delta_rotation_quaternion = (1.0, 0.0, 0.0, 0.0)
    item.delta_scale = (1.0, 1.0, 1.0)
    if item.data.get(TAG, 0) != result_mesh.kind(bound, how):
        _modifiers(item, source, bound)
    result_mesh.give(work, item, source, bound, how, path, points.points)
    count = len(item.data.vertices)
    if count != points.points:
        raise JobError(f"{points.path}: holds {points.points} points, but the mesh of "
                       f"'{source.name}' has {count} vertices. It was changed after the bake: "
                       "bake again.")
    # No material of ours: a slot would be made in the artist's mesh, which is shown here.
    point_cache.play(item, points, work.first, mirrored)


def _bare(source, label, kind):
    """An object with a mesh of ours, which looks as the artist's does."""
    mesh = bpy.data.meshes.new(label)
    mesh[TAG] = kind
    item = bpy.data.objects.new(label, mesh)
    for name in LOOKS:
        setattr(item, name, getattr(source, name))
    for key, value in source.items():
        if key not in {TAG, CACHE_TAG, HIDDEN_TAG, CHOSEN_TAG}:
            with contextlib.suppress(TypeError):  # what other add-ons keep there may be of their own kinds
                item[key] = value
    return item


def _modifiers(item, source, bound):
    """For another kind of mesh: of the modifiers of the artist's object those that follow what the cache
    moves, in its order; what he has added to the result since stays behind them."""
    wanted = [modifier for index, modifier in enumerate(source.modifiers)
              if not (bound.made and index < bound.stop) and not _left_out(modifier, bound)]
    names = {modifier.name for modifier in wanted}
    for modifier in [other for other in item.modifiers
                     if other.name in source.modifiers and other.name not in names and not shapes.is_own(other)]:
        item.modifiers.remove(modifier)
    # Deformers go before the cache, what refines after it.
    cut, place, cache = shapes.cache_place(source), 0, item.modifiers.find(point_cache.NAME)
    for modifier in wanted:
        if modifier.name not in item.modifiers and modifier.type != "PARTICLE_SYSTEM":
            if cache >= 0 and source.modifiers.find(modifier.name) >= cut:
                place = max(place, item.modifiers.find(point_cache.NAME) + 1)
            _copied(item, modifier)
            compat.move_modifier(item, modifier.name, place)
        place = item.modifiers.find(modifier.name) + 1


def _left_out(modifier, bound):
    return shapes.is_own(modifier) or (modifier.type == "PARTICLE_SYSTEM"
                                       and (bound.made or not shapes.is_hair(modifier)))


def _copied(item, modifier):
    """Blender copies modifiers with their object alone."""
    copy = item.modifiers.new(modifier.name, modifier.type)
    for row in modifier.bl_rna.properties:
        if not row.is_readonly and row.identifier not in {"name", "is_active"}:
            with contextlib.suppress(AttributeError, TypeError):  # what another value does not allow
                setattr(copy, row.identifier, getattr(modifier, row.identifier))
    for key, value in modifier.items() if modifier.type == "NODES" else ():
        copy[key] = value
