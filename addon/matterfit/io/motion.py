# SPDX-License-Identifier: GPL-3.0-or-later
"""What Blender itself moves: whether an object's transform or its mesh changes from frame to frame."""

from . import shapes

# Modifiers that move a mesh in time by themselves.
_MOVING = frozenset({"ARMATURE", "CLOTH", "MESH_CACHE", "MESH_SEQUENCE_CACHE", "SOFT_BODY", "WAVE",
                     "BUILD", "EXPLODE", "OCEAN", "FLUID", "DYNAMIC_PAINT"})


def moves(item):
    """Whether the object may be somewhere else at another frame."""
    while item is not None:
        if item.animation_data is not None or item.constraints or item.rigid_body is not None:
            return True
        item = item.parent
    return False


def is_keyed(item):
    """Whether the object has keys or drivers of its own."""
    animation = item.animation_data
    return animation is not None and (animation.action is not None or bool(animation.drivers))


def deforms(item):
    """Whether the object's mesh may have another shape at another frame."""
    keys = getattr(item.data, "shape_keys", None)
    if keys is not None and keys.animation_data is not None:
        return True
    return any(_is_moving(modifier) for modifier in item.modifiers
               if shapes.is_used(modifier) and not shapes.is_own(modifier)) or _keys_modifiers(item)


def _is_moving(modifier):
    if modifier.type in _MOVING:
        return True
    target = getattr(modifier, "object", None) or getattr(modifier, "target", None)
    return target is not None and moves(target)


def _keys_modifiers(item):
    """Whether a value of a modifier is keyed or driven."""
    animation = item.animation_data
    if animation is None:
        return False
    curves = list(animation.drivers)
    action = animation.action
    if action is not None:
        # Actions have layers from 4.4 on, and lose `fcurves` with 5.0.
        found = getattr(action, "fcurves", None)
        if found is None:
            found = [curve for layer in action.layers for strip in layer.strips
                     for bag in strip.channelbags for curve in bag.fcurves]
        curves += list(found)
    return any(curve.data_path.startswith("modifiers[") for curve in curves)


def collider_kind(body):
    """'STATIC', 'RIGID' or 'DEFORMING' of a collider, which the artist may have left to its object."""
    if body.collider_kind != "AUTO":
        return body.collider_kind
    item = body.object
    if item is None:
        return "STATIC"
    if body.collider_shape == "MESH" and item.type == "MESH" and deforms(item):
        return "DEFORMING"
    return "RIGID" if moves(item) else "STATIC"
