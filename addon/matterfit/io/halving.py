# SPDX-License-Identifier: GPL-3.0-or-later
"""Long edges of a mesh are halved until none is left, or the mesh has as many faces as it may."""

import math

import bmesh
import numpy

from . import meshes

# Faces that are added where 0, 1, … edges of a triangle, and of a face of four, are halved, at most.
_OF_THREE, _OF_FOUR = numpy.array((0, 1, 2, 3)), numpy.array((0, 2, 3, 4, 3))
_OF_AN_EDGE = 4  # and of a single edge


def lengths(arrays):
    """(F,) of each face (meshes.read_arrays) the side of a square as long across as it."""
    if not len(arrays["face_sizes"]):
        return numpy.zeros(0)
    corners = arrays["vertices"][arrays["face_vertices"]].astype(numpy.float64)
    first = _first(arrays)
    extent = (numpy.maximum.reduceat(corners, first) - numpy.minimum.reduceat(corners, first))
    return numpy.linalg.norm(extent, axis=1) / math.sqrt(2.0)


def _first(arrays):
    """(F,) where the corners of each face begin."""
    sizes = arrays["face_sizes"].astype(numpy.int64)
    return numpy.cumsum(sizes) - sizes


def area(arrays):
    """The area of all faces."""
    if not len(arrays["face_sizes"]):
        return 0.0
    first = _first(arrays)
    corners = arrays["vertices"][arrays["face_vertices"]].astype(numpy.float64)
    corners -= numpy.repeat(corners[first], arrays["face_sizes"], axis=0)
    following = numpy.arange(1, len(corners) + 1)
    following[first + arrays["face_sizes"] - 1] = first
    crosses = numpy.add.reduceat(numpy.cross(corners, corners[following]), first)
    return 0.5 * float(numpy.linalg.norm(crosses, axis=1).sum())


def halve(mesh, stretch, longest, most):
    """Halves edges of a mesh that are longer, `stretch`ed, than `longest`; the longest first where not
    all can be, so that there are no more faces than `most`."""
    longest = max(longest, math.sqrt(area(meshes.read_arrays(mesh, stretch, 1.0)) / most))
    while True:
        arrays = meshes.read_arrays(mesh, stretch, 1.0)
        left = most - len(arrays["face_sizes"])
        # Corners that lie apart in a face of many are joined, or its middle would stay flat.
        wide = numpy.nonzero((arrays["face_sizes"] > 4) & (lengths(arrays) > longest))[0]
        edges = _edges(mesh, arrays["vertices"])
        long = numpy.nonzero(edges > longest)[0]
        if not len(wide) and not len(long):
            return
        if (arrays["face_sizes"][wide] - 3 if len(wide) else _added(mesh, arrays, long)).sum() > left:
            # The faces that may still be added are too few for another look at all edges.
            if len(wide) or left < most / 8:
                return
            long = long[numpy.argsort(-edges[long], kind="stable")[:left // _OF_AN_EDGE]]
        work = bmesh.new()
        try:
            work.from_mesh(mesh)
            if len(wide):
                work.faces.ensure_lookup_table()
                bmesh.ops.triangulate(work, faces=[work.faces[index] for index in wide])
            else:
                work.edges.ensure_lookup_table()
                bmesh.ops.subdivide_edges(work, edges=[work.edges[index] for index in sorted(long)],
                                          cuts=1, use_grid_fill=True)
            work.to_mesh(mesh)
        finally:
            work.free()


def _added(mesh, arrays, edges):
    """(F,) how many faces are added to each where these edges are halved, at most."""
    halved = numpy.zeros(len(mesh.edges), dtype=numpy.int64)
    halved[edges] = 1
    of_corners = numpy.empty(len(mesh.loops), dtype=numpy.int32)
    mesh.loops.foreach_get("edge_index", of_corners)
    sizes = arrays["face_sizes"]
    counts = numpy.add.reduceat(halved[of_corners], _first(arrays))
    return numpy.where(sizes == 3, _OF_THREE[numpy.minimum(counts, 3)],
                       numpy.where(sizes == 4, _OF_FOUR[numpy.minimum(counts, 4)], 2 * counts))


def _edges(mesh, vertices):
    """(E,) lengths of the edges."""
    pairs = numpy.empty(len(mesh.edges) * 2, dtype=numpy.int32)
    mesh.edges.foreach_get("vertices", pairs)
    pairs = pairs.reshape(-1, 2)
    return numpy.linalg.norm(vertices[pairs[:, 0]].astype(numpy.float64) - vertices[pairs[:, 1]], axis=1)
