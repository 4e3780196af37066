# SPDX-License-Identifier: GPL-3.0-or-later
"""What Blender itself moves: whether an object's transform or its mesh changes from frame to frame."""

from dataclasses import dataclass

from mathutils import Euler, Matrix, Quaternion, Vector

from . import shapes, transforms

# Modifiers that move a mesh in time by themselves.
_MOVING = frozenset({"ARMATURE", "CLOTH", "MESH_CACHE", "MESH_SEQUENCE_CACHE", "SOFT_BODY", "WAVE",
                     "BUILD", "EXPLODE", "OCEAN", "FLUID", "DYNAMIC_PAINT"})
_MOVING_NODES = frozenset({"GeometryNodeInputSceneTime", "GeometryNodeSimulationInput"})


def moves(item):
    """Whether the object may be somewhere else at another frame."""
    while item is not None:
        if item.animation_data is not None or item.constraints or item.rigid_body is not None:
            return True
        item = item.parent
    return False


def is_keyed(item):
    """Whether the object has keys or drivers, or something has that it is parented or constrained to."""
    return any(_has_keys(other) or _has_keys(other.data) for other in _movers(item))


def _has_keys(block):
    animation = getattr(block, "animation_data", None)
    return animation is not None and (animation.action is not None or bool(animation.drivers)
                                      or bool(animation.nla_tracks))


def _movers(item):
    """The object, its parents, and what their constraints follow, theirs too."""
    found, left = [], [item]
    while left:
        other = left.pop()
        if other is None or other in found:
            continue
        found.append(other)
        left.append(other.parent)
        left += [getattr(constraint, "target", None) for constraint in other.constraints
                 if not constraint.mute and constraint.influence > 0.0]
    return found


def leaves_keys(body):
    """Whether the object of a body is animated (is_keyed) and the body starts without that."""
    return (body.role == "BODY" and body.source == "OBJECT" and body.velocity_from == "VALUE"
            and body.object is not None and is_keyed(body.object))


def deforms(item):
    """Whether the object's mesh may have another shape at another frame."""
    if _has_keys(getattr(item.data, "shape_keys", None)) or _has_keys(item.data):
        return True
    return any(_is_moving(modifier) for modifier in item.modifiers
               if shapes.is_used(modifier) and not shapes.is_own(modifier)) or _keys_modifiers(item)


def _is_moving(modifier):
    if modifier.type in _MOVING:
        return True
    if modifier.type == "NODES":
        return _nodes_move(modifier.node_group)
    target = getattr(modifier, "object", None) or getattr(modifier, "target", None)
    return target is not None and (moves(target) or _has_keys(getattr(target.data, "shape_keys", None)))


def _nodes_move(tree):
    """Whether a group of Geometry Nodes gives another mesh at another frame by itself."""
    if tree is None:
        return False
    return _has_keys(tree) or any(
        node.bl_idname in _MOVING_NODES
        or node.bl_idname == "GeometryNodeGroup" and _nodes_move(node.node_tree) for node in tree.nodes)


def scales(item):
    """Whether keys or drivers change the scale of the object, or of one that it is parented to."""
    while item is not None:
        animation = item.animation_data
        if animation is not None:
            curves = [*animation.drivers, *(curve for curve in _curves(animation.action) if _varies(curve))]
            if any(curve.data_path in {"scale", "delta_scale"} for curve in curves):
                return True
        item = item.parent
    return False


def _varies(curve):
    values = [point.co.y for point in curve.keyframe_points]
    return not values or bool(curve.modifiers) or max(values) - min(values) > 1e-6


def _keys_modifiers(item):
    """Whether a value of a modifier is keyed or driven."""
    animation = item.animation_data
    if animation is None:
        return False
    curves = [*animation.drivers, *_curves(animation.action)]
    return any(curve.data_path.startswith("modifiers[") for curve in curves)


def _curves(action):
    if action is None:
        return []
    # Actions have layers from 4.4 on, and lose `fcurves` with 5.0.
    found = getattr(action, "fcurves", None)
    if found is None:
        found = [curve for layer in action.layers for strip in layer.strips
                 for bag in strip.channelbags for curve in bag.fcurves]
    return list(found)


def keyed_matrices(item, frames):
    """Where the object is in the world at each of `frames`, without playing them; None where nothing or
    anything but keys of its own, or of its parents, moves it."""
    chain = [item]
    while chain[-1].parent is not None:
        if chain[-1].parent_type != "OBJECT" or len(chain) > MOST_PARENTS:
            return None
        chain.append(chain[-1].parent)
    if not any(other.animation_data is not None and other.animation_data.action is not None for other in chain):
        return None
    found = [Matrix() for _frame in frames]
    for other in reversed(chain):
        own = _own_matrices(other, frames)
        if own is None:
            return None
        bound = other.matrix_parent_inverse if other.parent is not None else Matrix()
        found = [above @ bound @ matrix for above, matrix in zip(found, own, strict=True)]
    return found


def _own_matrices(item, frames):
    """Of the object's location, rotation and scale alone."""
    animation = item.animation_data
    if (animation is not None and (animation.drivers or animation.nla_tracks)
            or item.constraints or item.rigid_body is not None
            or any(item.delta_location) or any(item.delta_rotation_euler)):
        return None
    curves = {} if animation is None else {
        (curve.data_path, curve.array_index): curve for curve in _curves(animation.action) if not curve.mute}

    def values(name, frame):
        now = getattr(item, name)
        found = [curves.get((name, index)) for index in range(len(now))]
        return [value if curve is None else curve.evaluate(frame)
                for value, curve in zip(now, found, strict=True)]

    def rotation(frame):
        if item.rotation_mode == "QUATERNION":
            return Quaternion(values("rotation_quaternion", frame)).normalized()
        if item.rotation_mode == "AXIS_ANGLE":
            angle, *axis = values("rotation_axis_angle", frame)
            return Quaternion(axis, angle)
        return Euler(values("rotation_euler", frame), item.rotation_mode)

    return [Matrix.LocRotScale(Vector(values("location", frame)), rotation(frame),
                               Vector(values("scale", frame))) for frame in frames]


MOST_PARENTS = 50
MOST_FRAMES = 100  # that slow_start() looks at
SLOW = 0.05  # of the fastest motion: hardly any


@dataclass(frozen=True)
class SlowStart:
    """Speeds [Blender units a frame] where the simulation begins, and the fastest from there on, with
    the frame of that; 0 where nothing moves later either, or where it only turns."""

    speed: float
    fastest: float
    frame: int
    turns: bool = False


def slow_start(item, first, end):
    """A SlowStart where the keys of the object let it rest at the frame `first`, or hardly move, as keys
    that ease in do; None where it moves or turns at once, or anything but its keys moves it."""
    near = keyed_matrices(item, transforms.velocity_times(first))
    if near is None:
        return None
    later = keyed_matrices(item, range(first, min(end, first + MOST_FRAMES) + 1))
    steps = [transforms.velocity_between(before, after, 1.0, 1.0)
             for before, after in zip(later, later[1:], strict=False)]
    now = transforms.motion_velocity(near, 1.0, 1.0)
    fastest = [max((step[part].length for step in steps), default=0.0) for part in (0, 1)]
    if any(now[part].length > max(SLOW * fastest[part], 1e-6) for part in (0, 1)):
        return None
    part = 0 if fastest[0] > 1e-6 else 1
    if fastest[part] <= 1e-6:
        return SlowStart(now[0].length, 0.0, first)
    step = max(range(len(steps)), key=lambda index: steps[index][part].length)
    return SlowStart(now[0].length, 0.0 if part else fastest[0], first + step, bool(part))


def collider_kind(body):
    """'STATIC', 'RIGID' or 'DEFORMING' of a collider, which the artist may have left to its object."""
    if body.collider_kind != "AUTO":
        return body.collider_kind
    item = body.object
    if item is None:
        return "STATIC"
    if body.collider_shape == "MESH" and item.type != "EMPTY" and (deforms(item) or scales(item)):
        return "DEFORMING"
    return "RIGID" if moves(item) else "STATIC"
