# SPDX-License-Identifier: GPL-3.0-or-later
"""The quality presets: how many cells lie across the thinnest part that matters."""

import numpy
from mathutils import Vector
from mathutils.bvhtree import BVHTree

from ..props import reactions
from . import presets

RAYS = 400
HITS = 8
# Particles in a body's bounding box that a preset goes to: an ear or a fin must not ask for tens
# of millions. A person who wants them types the separation.
MOST_PARTICLES = 4e6
_applying = []


@reactions.separation_typed.done_by
def separation_typed(solver):
    """Called when the particle separation changes; typing it makes the quality Custom."""
    if not _applying and solver.quality != "CUSTOM":
        _set(solver, "quality", "CUSTOM")


@reactions.quality_chosen.done_by
def apply_quality(solver, scene):
    """Sets the particle separation from the quality; without bodies nothing changes."""
    if _applying or solver.quality == "CUSTOM":
        return
    thickness = thinnest(scene)
    if thickness is not None:
        least = (largest_box(scene) / MOST_PARTICLES) ** (1.0 / 3.0)
        found = max(separation(thickness, solver.quality), least)
        # Four digits: a thickness measured in floats must not leave 0.0024999 m.
        _set(solver, "particle_separation", float(f"{found:.4g}"))


def separation(thickness, quality):
    """Particle separation for a thickness: a cell is twice the separation."""
    return thickness / (2.0 * presets.cells_across(quality))


def thinnest(scene):
    """Thickness of the thinnest body in Blender units, or None where there is no body."""
    found = [object_thickness(body.object) for body in scene.matterfit.bodies
             if body.enabled and body.role == "BODY" and body.source == "OBJECT"
             and body.object is not None and body.object.type == "MESH"]
    found = [value for value in found if value]
    return min(found) if found else None


def largest_box(scene):
    """Volume of the largest body's bounding box in cubic Blender units; 0 where there is none."""
    sides = [body.object.dimensions for body in scene.matterfit.bodies
             if body.enabled and body.role == "BODY" and body.source == "OBJECT"
             and body.object is not None and body.object.type == "MESH"]
    return max((x * y * z for x, y, z in sides), default=0.0)


def object_thickness(item):
    """The 5th percentile of the distances from face centres straight through the object.

    Rays that find no other side (open meshes) do not count; without any the smallest side of the
    bounding box is taken.
    """
    mesh = item.data
    scale = item.matrix_world.to_3x3()
    vertices = [scale @ vertex.co for vertex in mesh.vertices]
    if not vertices:
        return None
    extent = numpy.ptp(numpy.array(vertices), axis=0)
    sides = [float(side) for side in extent if side > 1e-9]
    smallest = min(item.dimensions) if min(item.dimensions) > 1e-9 else min(sides, default=None)
    polygons = [tuple(polygon.vertices) for polygon in mesh.polygons]
    if not polygons:
        return smallest
    tree = BVHTree.FromPolygons(vertices, polygons)
    step = max(1, len(polygons) // RAYS)
    distances = []
    for index in range(0, len(polygons), step):
        corners = [vertices[vertex] for vertex in polygons[index]]
        center = sum(corners, Vector()) / len(corners)
        normal = (corners[1] - corners[0]).cross(corners[-1] - corners[0])
        if normal.length < 1e-12:
            continue
        normal.normalize()
        near = 1e-5 * float(max(extent))
        start, through = center - normal * near, 0.0
        for _ in range(HITS):
            place, facing, _, distance = tree.ray_cast(start, -normal)
            if place is None:
                break
            through += distance
            if facing.dot(normal) < 0.0:
                distances.append(through)
                break
            # The face itself where it is not planar, or a shell inside: on to the other side.
            start = place - normal * near
    if not distances:
        return smallest
    return float(numpy.percentile(distances, 5.0))


def cells_across(scene):
    """Cells across the thinnest part with the present separation, or None."""
    thickness = thinnest(scene)
    return None if thickness is None else thickness / (
        2.0 * scene.matterfit.solver.particle_separation)


def _set(solver, name, value):
    _applying.append(name)
    try:
        setattr(solver, name, value)
    finally:
        _applying.pop()
