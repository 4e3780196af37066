# SPDX-License-Identifier: GPL-3.0-or-later
"""The mesh that a mesh cache moves, with faces short enough to bend with the particles.

A cache on the eight corners of a cube moves eight points, and what lies between them stays flat,
through the floor if need be. So where faces are much longer than the distance of particles, the mesh is
taken after what refines it as well, and its long edges are halved. That leaves its looks as they are, with
UVs, colours and materials.
"""

import contextlib
import math
import zipfile

import bmesh
import bpy
import numpy
from mathutils import Matrix

from . import meshes, shapes

COARSE = 3.0  # particle separations: faces longer than this do not bend as the body does
FINE = 2.0  # and these do
MOST_FACES = 100000


def is_coarse(arrays, separation):
    """Whether faces of a mesh (meshes.read_arrays) are much longer than the separation."""
    return len(arrays["face_sizes"]) > 0 and float(_lengths(arrays).max()) > COARSE * separation


def _lengths(arrays):
    """(F,) of each face the side of a square as long across as it."""
    corners = arrays["vertices"][arrays["face_vertices"]].astype(numpy.float64)
    sizes = arrays["face_sizes"].astype(numpy.int64)
    first = numpy.cumsum(sizes) - sizes
    extent = (numpy.maximum.reduceat(corners, first) - numpy.minimum.reduceat(corners, first))
    return numpy.linalg.norm(extent, axis=1) / math.sqrt(2.0)


def is_bound_refined(item, stretch, separation):
    """Whether the result moves a refined mesh of ours; lengths in Blender units. Hair grows on faces of
    the object's own mesh, which it then keeps."""
    if item.type != "MESH":
        return True
    bound = shapes.bound_shape(item)
    if not bound.made and any(shapes.is_hair(modifier) for modifier in item.modifiers):
        return False
    return is_coarse(meshes.read_shape(item, bound, stretch, 1.0), separation)


def made_mesh(item, shape):
    """What modifiers before `shape` make of the object at the present frame, as a mesh of its own."""
    with shapes.modifiers_limited(item, shape.stop):
        return _evaluated(item)


def read_refined(item, stretch, separation):
    """The arrays of the refined mesh at the present frame, with what refined_mesh() makes it of again;
    lengths in Blender units."""
    how = {"stretch": numpy.array(stretch, dtype=numpy.float64),
           "longest_edge": numpy.array([FINE * separation])}
    mesh = refined_mesh(item, how)
    arrays = {**meshes.read_arrays(mesh, stretch, 1.0, creases=True), **how}
    bpy.data.meshes.remove(mesh)
    return arrays


def how_refined(path):
    """How the mesh in a file of read_refined() was refined; None where it is the object's own."""
    try:
        with numpy.load(path) as arrays:
            return {name: arrays[name] for name in ("stretch", "longest_edge")}
    except (OSError, KeyError, ValueError, zipfile.BadZipFile):
        return None


def refined_mesh(item, how):
    """The refined mesh of the object at the present frame."""
    shape = shapes.refined_shape(item)
    with _levels(item, shape, _smooth_level(item, how)), shapes.modifiers_limited(item, shape.stop, refined=True):
        mesh = _evaluated(item)
    _halve(mesh, Matrix(how["stretch"].tolist()), float(how["longest_edge"][0]))
    return mesh


def _evaluated(item):
    depsgraph = bpy.context.evaluated_depsgraph_get()
    return bpy.data.meshes.new_from_object(
        item.evaluated_get(depsgraph), preserve_all_data_layers=True, depsgraph=depsgraph)


def _smooth_level(item, how):
    """How often a cage that is shaded smooth is subdivided until its faces are short enough: halved
    straight they would keep its corners, where the limit surface is what was simulated."""
    stop = shapes.bound_shape(item).stop
    if (item.type != "MESH" or stop == len(item.modifiers) or item.modifiers[stop].type != "SUBSURF"
            or item.modifiers[stop].subdivision_type != "CATMULL_CLARK"
            or not all(polygon.use_smooth for polygon in item.data.polygons)):
        return 0
    longest = _lengths(meshes.read_shape(item, shapes.bound_shape(item), how["stretch"], 1.0)).max()
    return math.ceil(math.log2(max(longest / float(how["longest_edge"][0]), 1.0)))


@contextlib.contextmanager
def _levels(item, shape, least):
    """Subdivision is as fine as a render has it inside, and at least of the level `least`, up to
    MOST_FACES; Simplify is off."""
    render = bpy.context.scene.render
    before, simplify = {}, render.use_simplify
    render.use_simplify = False
    corners = max(len(item.data.loops), 1) if item.type == "MESH" else 1
    for modifier in list(item.modifiers)[:shape.stop]:
        if modifier.type == "SUBSURF" and shapes.is_used(modifier):
            most = max(1, int(math.log(max(4.0 * MOST_FACES / corners, 1.0), 4)))
            before[modifier.name] = modifier.levels
            shown = modifier.levels if modifier.show_viewport else 0
            rendered = modifier.render_levels if modifier.show_render else 0
            modifier.levels = min(max(shown, rendered, least), most)
            least = 0
            corners *= 4 ** modifier.levels
    try:
        yield
    finally:
        for name, level in before.items():
            item.modifiers[name].levels = level
        render.use_simplify = simplify


def _halve(mesh, stretch, longest):
    """Halves edges until none is longer, stretched, than `longest`, or as many would be too many."""
    area = sum(polygon.area for polygon in mesh.polygons) * abs(stretch.determinant()) ** (2.0 / 3.0)
    longest = max(longest, math.sqrt(area / MOST_FACES))
    work = bmesh.new()
    try:
        work.from_mesh(mesh)
        while True:
            long = [edge for edge in work.edges
                    if (stretch @ (edge.verts[0].co - edge.verts[1].co)).length > longest]
            # Corners that lie apart in a face of many are joined, or its middle would stay flat.
            wide = [face for face in work.faces
                    if len(face.verts) > 4 and _width(face, stretch) > longest]
            if not long and not wide:
                break
            if wide:
                bmesh.ops.triangulate(work, faces=wide)
                continue
            bmesh.ops.subdivide_edges(work, edges=long, cuts=1, use_grid_fill=True)
        work.to_mesh(mesh)
    finally:
        work.free()


def _width(face, stretch):
    places = [stretch @ vertex.co for vertex in face.verts]
    return math.dist([min(place[axis] for place in places) for axis in range(3)],
                     [max(place[axis] for place in places) for axis in range(3)]) / math.sqrt(2.0)
