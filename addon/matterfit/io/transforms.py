# SPDX-License-Identifier: GPL-3.0-or-later
"""Object transforms as the job document writes them: metres, quaternions [w, x, y, z]."""

import math

from mathutils import Euler, Quaternion, Vector

from .files import numbers

# Parts of a frame between the poses that a velocity is measured from.
VELOCITY_STEP = 0.05


def metres(scene):
    """Metres in one Blender unit."""
    return scene.unit_settings.scale_length


def split(matrix, scale_length):
    """(position [m], rotation, 3×3 stretch) with matrix = position · rotation · stretch.

    The stretch holds scale, shear and mirroring; it belongs to the shape.
    """
    rotation = matrix.decompose()[1].normalized()
    stretch = rotation.to_matrix().inverted() @ matrix.to_3x3()
    return matrix.translation * scale_length, rotation, stretch


def quaternion_list(rotation):
    """[w, x, y, z] with w ≥ 0, so that equal rotations give equal text."""
    rotation = rotation.normalized()
    if rotation.w < 0.0:
        rotation = -rotation
    return numbers(rotation)


def pose(position, rotation):
    return {"position": numbers(position), "rotation": quaternion_list(rotation)}


def upright(up):
    """The quaternion that turns a file's axes to Blender's, by what points up in it (FILE_UP_AXES)."""
    return Quaternion((1.0, 0.0, 0.0), {"Z": 0.0, "Y": math.pi / 2, "-Y": -math.pi / 2}[up])


def keyed(frames, values):
    """{frames, values, interpolation}, or the value alone where it never changes."""
    if all(value == values[0] for value in values):
        return values[0]
    return {"frames": list(frames), "values": list(values), "interpolation": "linear"}


def velocity_times(frame):
    """The times [frames] at which motion_velocity() wants the matrices."""
    return (frame - VELOCITY_STEP, frame, frame + VELOCITY_STEP)


def motion_velocity(matrices, scale_length, fps):
    """(linear [m/s], angular [rad/s]) of an object's origin from its matrices at velocity_times().

    The steeper of the differences before and after the frame: a throw either begins there or has
    been going on until there, and keys hold still on the other side.
    """
    best = (Vector(), Vector())
    for before, after in zip(matrices, matrices[1:], strict=False):
        linear, angular = velocity_between(before, after, scale_length, VELOCITY_STEP / fps)
        if linear.length + angular.length > best[0].length + best[1].length:
            best = (linear, angular)
    return best


def velocity_between(before, after, scale_length, seconds):
    """(linear [m/s], angular [rad/s]) that takes an object's origin from one matrix to the other."""
    turn = after.decompose()[1].normalized() @ before.decompose()[1].normalized().conjugated()
    if turn.w < 0.0:
        turn = -turn
    angular = turn.axis * (turn.angle / seconds) if turn.angle > 1e-9 else Vector()
    return (after.translation - before.translation) * (scale_length / seconds), angular


def take_placement(throw, scale_length):
    """(position [m], rotation) of a throw's own placement."""
    return Vector(throw.location) * scale_length, Euler(throw.rotation).to_quaternion()


def turned(rotation, points):
    """`points` (N, 3) numpy, turned."""
    import numpy
    return points @ numpy.array(rotation.to_matrix(), dtype=numpy.float64).T
