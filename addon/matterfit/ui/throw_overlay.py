# SPDX-License-Identifier: GPL-3.0-or-later
"""The throw of each body in the 3D View: an arrow along its velocity, and the path that it would fly
through nothing but gravity until it meets the ground or the scene ends."""

from dataclasses import dataclass

import bpy
import numpy
from mathutils import Euler, Vector

from .. import compat
from ..io import frames, motion, transforms
from ..props import scene as scene_props

ARROW_SECONDS = 0.1  # an arrow is as long as the way of this time, from the body's box on
HEAD = 0.2  # of its length
MOST_POINTS = 250
COLOR = (1.0, 0.6, 0.2, 1.0)


@dataclass
class Flight:
    """The flight of one body, in Blender units: `start`, `velocity` a second, `path` (N, 3) from the
    start; how far the body's box `reaches` along the velocity."""

    name: str
    start: Vector
    velocity: Vector
    path: numpy.ndarray
    reaches: float = 0.0


def flights(scene):
    """The flight of every body that is thrown: with typed values, or by keys of its own or of its parents.
    Where more than those moves it, that is not known before the frames are played."""
    settings = scene.matterfit
    take = scene_props.active_take(settings)
    thrown = {} if take is None else {throw.name: throw for throw in take.throws}
    own = take is not None and take.use_gravity
    unit = 1.0 / transforms.metres(scene)
    gravity = Vector(take.gravity if own else settings.solver.gravity) * unit
    ground = settings.solver.ground_height if settings.solver.use_ground else None
    first, end = frames.frame_range(scene)
    fps = scene.render.fps / scene.render.fps_base
    times = numpy.linspace(0.0, (end - 1 - first) / fps, min(max(end - first, 2), MOST_POINTS))
    found = []
    for body in settings.bodies:
        if not body.enabled or body.role != "BODY" or body.source != "OBJECT" or body.object is None:
            continue
        throw = thrown.get(body.name)
        source = body if throw is None or throw.velocity_from == "BODY" else throw
        thrown_at = _start(body.object, throw, source, first, fps)
        if thrown_at is None or thrown_at[1].length == 0.0:
            continue
        start, velocity, around = thrown_at
        half = max(abs(corner.z) for corner in around)
        reaches = max(corner.dot(velocity.normalized()) for corner in around)
        path = numpy.array(start) + times[:, None] * numpy.array(velocity) + (
            0.5 * times[:, None] ** 2 * numpy.array(gravity))
        found.append(Flight(body.name, start, velocity, _until(path, ground, half), reaches))
    return found


def _start(item, throw, source, first, fps):
    """(middle of the object's box, its velocity, the box's corners from the middle) where the throw begins;
    None where that is not known."""
    matrix, spin, velocity = item.matrix_world, Vector(), Vector(source.velocity)
    if source.velocity_from == "ANIMATION":
        found = motion.keyed_matrices(item, transforms.velocity_times(first))
        if found is None:
            return None
        matrix = found[1]
        velocity, spin = transforms.motion_velocity(found, 1.0, fps)
    corners = [matrix @ Vector(corner) for corner in item.bound_box]
    middle = sum(corners, Vector()) / 8.0
    around = [corner - middle for corner in corners]
    origin = matrix.translation
    if throw is not None and throw.use_placement:
        turn = Euler(throw.rotation).to_matrix() @ matrix.to_3x3().normalized().inverted()
        middle, origin = Vector(throw.location) + turn @ (middle - origin), Vector(throw.location)
        around = [turn @ corner for corner in around]
    return middle, velocity + spin.cross(middle - origin), around


def _until(path, ground, half):
    """The path to where the body's underside meets the ground, which it may have done before."""
    if ground is None:
        return path
    below = numpy.nonzero(path[1:, 2] < ground + half)[0]
    if not len(below) or path[0, 2] <= ground + half:
        return path
    end = int(below[0])
    before, after = path[end], path[end + 1]
    part = (before[2] - ground - half) / max(before[2] - after[2], 1e-12)
    return numpy.concatenate((path[:end + 1], [before + part * (after - before)]))


def arrow(flight, facing):
    """(6, 3) ends of the three lines of an arrow whose head lies across `facing`; it begins where it can be
    seen, outside of the body."""
    start = flight.start + flight.reaches * flight.velocity.normalized()
    tip = start + ARROW_SECONDS * flight.velocity
    along = (tip - start) * HEAD
    side = along.cross(facing)
    side = side.normalized() * (0.5 * along.length) if side.length > 1e-12 else Vector()
    return numpy.array([start, tip, tip, tip - along + side, tip, tip - along - side],
                       dtype=numpy.float32)


def draw():
    context = bpy.context
    scene = context.scene
    if not scene.matterfit.show_throws:
        return
    found = flights(scene)
    if not found:
        return
    import gpu
    from gpu_extras.batch import batch_for_shader
    region = context.region_data
    facing = region.view_rotation @ Vector((0.0, 0.0, 1.0)) if region else Vector((0.0, 1.0, 0.0))
    shader = compat.uniform_shader()
    gpu.state.blend_set("ALPHA")
    shader.bind()
    for flight in found:
        for kind, points, opacity, width in (
                ("LINE_STRIP", flight.path.astype(numpy.float32), 0.5, 1.0),
                ("LINES", arrow(flight, facing), 1.0, 3.0)):
            gpu.state.line_width_set(width)
            shader.uniform_float("color", (*COLOR[:3], opacity))
            batch_for_shader(shader, kind, {"pos": points}).draw(shader)
    gpu.state.line_width_set(1.0)
    gpu.state.blend_set("NONE")
