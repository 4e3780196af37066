# SPDX-License-Identifier: GPL-3.0-or-later
"""Walking through the scene's frames and putting it back where it was."""

import contextlib
import math

import bpy

_SIMULATED = {"CLOTH", "SOFT_BODY", "PARTICLE_SYSTEM", "DYNAMIC_PAINT", "FLUID"}


@contextlib.contextmanager
def frame_kept(scene):
    """Restores the current frame and subframe on leaving, of a scene that is there still."""
    name, frame, subframe = scene.name, scene.frame_current, scene.frame_subframe
    try:
        yield
    finally:
        found = bpy.data.scenes.get(name)
        if found is not None:
            found.frame_set(frame, subframe=subframe)


@contextlib.contextmanager
def at_first(scene):
    """The scene stands at the first simulated frame inside."""
    first, _end = frame_range(scene)
    if (scene.frame_current, scene.frame_subframe) == (first, 0.0):
        yield
        return
    with frame_kept(scene):
        scene.frame_set(first)
        yield


def follow_each_other(scene):
    """Whether what is at a frame depends on the frames before having been visited in order: simulations
    of Blender's that are not baked."""
    return scene.rigidbody_world is not None or any(
        modifier.type in _SIMULATED or modifier.type == "NODES" and _has_memory(modifier.node_group)
        for item in scene.objects for modifier in item.modifiers)


def _has_memory(tree):
    return tree is not None and any(
        node.bl_idname == "GeometryNodeSimulationInput"
        or node.type == "GROUP" and _has_memory(node.node_tree) for node in tree.nodes)


def visit(scene, frame, visitors):
    """Calls every visitor(frame, depsgraph) at `frame`, whole or not."""
    whole = math.floor(frame)
    scene.frame_set(whole, subframe=frame - whole)
    depsgraph = bpy.context.evaluated_depsgraph_get()
    for visitor in visitors:
        visitor(frame, depsgraph)


def frame_range(scene):
    """[first, end) of the simulation: Blender's ranges include their last frame."""
    solver = scene.matterfit.solver
    if solver.use_range:
        return solver.frame_start, solver.frame_end + 1
    return scene.frame_start, scene.frame_end + 1


def frames_per_second(scene):
    """[numerator, denominator] where Blender's base makes a fraction (29.97), else a number."""
    fps, base = scene.render.fps, scene.render.fps_base
    if abs(base - 1.0) < 1e-9:
        return fps
    if abs(base - 1.001) < 1e-6:
        return [fps * 1000, 1001]
    return float(f"{fps / base:.9g}")
