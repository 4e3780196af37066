# SPDX-License-Identifier: GPL-3.0-or-later
"""Evaluated meshes, read the way the job needs them."""

import contextlib

import bpy
import numpy

from ..compat import translate
from ..jobs import JobError
from .shapes import emptied_by, modifiers_limited


def edge_creases(mesh):
    """(E,) creases 0 … 1: an attribute from 4.0, a property of edges before."""
    creases = numpy.zeros(len(mesh.edges), dtype=numpy.float32)
    attribute = mesh.attributes.get("crease_edge")
    if attribute is not None:
        attribute.data.foreach_get("value", creases)
    elif len(mesh.edges) and "crease" in mesh.edges[0].bl_rna.properties:
        mesh.edges.foreach_get("crease", creases)
    return creases


def read_arrays(mesh, stretch, scale_length, creases=False):
    """The arrays of a mesh file, vertices stretched and in metres.

    vertices (V, 3) float32, face_sizes (F,) int32, face_vertices (ΣF,) int32, and with `creases`
    crease_edges (C, 2) int32, crease_sharpness (C,) float32.
    """
    vertices = numpy.empty(len(mesh.vertices) * 3, dtype=numpy.float32)
    mesh.vertices.foreach_get("co", vertices)
    matrix = numpy.array(stretch, dtype=numpy.float64) * scale_length
    vertices = (vertices.reshape(-1, 3).astype(numpy.float64) @ matrix.T).astype(numpy.float32)
    sizes = numpy.empty(len(mesh.polygons), dtype=numpy.int32)
    mesh.polygons.foreach_get("loop_total", sizes)
    corners = numpy.empty(len(mesh.loops), dtype=numpy.int32)
    mesh.loops.foreach_get("vertex_index", corners)
    if numpy.linalg.det(matrix) < 0.0:
        # A mirrored object has its faces inside out: turn each round, first corner kept.
        corners = _reversed_faces(sizes, corners)
    arrays = {"vertices": vertices, "face_sizes": sizes, "face_vertices": corners}
    if creases:
        values = edge_creases(mesh)
        marked = numpy.nonzero(values > 0.0)[0]
        pairs = numpy.empty(len(mesh.edges) * 2, dtype=numpy.int32)
        mesh.edges.foreach_get("vertices", pairs)
        arrays["crease_edges"] = pairs.reshape(-1, 2)[marked]
        # Blender's creases go to OpenSubdiv as 10 c².
        arrays["crease_sharpness"] = (10.0 * values[marked] ** 2).astype(numpy.float32)
    return arrays


def _reversed_faces(sizes, corners):
    result = corners.copy()
    start = 0
    for size in sizes:
        result[start + 1:start + size] = corners[start + 1:start + size][::-1]
        start += size
    return result


def read_shape(item, shape, stretch, scale_length, creases=False):
    """read_arrays() of the object as `shape` says, at the present frame."""
    with modifiers_limited(item, shape.stop):
        depsgraph = bpy.context.evaluated_depsgraph_get()
        with evaluated_mesh(item, depsgraph) as mesh:
            return read_arrays(mesh, stretch, scale_length, creases)


def _chains(layer, item):
    """Each way from the view layer's collections down to the object: lists of LayerCollections, none
    of them switched off."""
    for child in layer.children:
        if child.exclude:
            continue
        for chain in _chains(child, item):
            yield [child, *chain]
    if item.name in layer.collection.objects:
        yield []


def _hidden_parts(item):
    """The hidden collections because of which the object is not evaluated; [] where it is. JobError
    where the view layer does not have it."""
    ways = [[part for part in chain if part.hide_viewport or part.collection.hide_viewport]
            for chain in _chains(bpy.context.view_layer.layer_collection, item)]
    if not ways:
        raise _not_there(item)
    return min(ways, key=len)


def _not_there(item):
    return JobError(f"object '{item.name}': is not in this view layer. Add it to the scene, or switch "
                    "its collection on.")


@contextlib.contextmanager
def shown(items):
    """The objects can be evaluated inside: one that is hidden, itself or by its collection, has no
    evaluated mesh."""
    hidden, collections = [], []
    try:
        for item in items:
            for part in _hidden_parts(item):
                collections.append((part, part.hide_viewport, part.collection.hide_viewport))
                part.hide_viewport = part.collection.hide_viewport = False
        for item in items:
            hidden.append((item.name, item.hide_viewport, item.hide_get()))
            item.hide_viewport = False
            try:
                item.hide_set(False)
            except RuntimeError as error:
                raise _not_there(item) from error
        bpy.context.view_layer.update()
        yield
    finally:
        for name, viewport, eye in hidden:
            item = bpy.data.objects[name]
            with contextlib.suppress(RuntimeError):
                item.hide_set(eye)
            item.hide_viewport = viewport
        for part, eye, viewport in reversed(collections):
            part.hide_viewport, part.collection.hide_viewport = eye, viewport


@contextlib.contextmanager
def evaluated_mesh(item, depsgraph):
    """The object's evaluated mesh; freed on leaving."""
    if item.mode == "EDIT":
        item.update_from_editmode()
    evaluated = item.evaluated_get(depsgraph)
    try:
        mesh = evaluated.to_mesh()
    except RuntimeError as error:
        raise JobError(f"object '{item.name}': has no mesh ({error}). Choose an object with a "
                       "surface.") from error
    if mesh is None:
        raise JobError(f"object '{item.name}': has no mesh. Choose an object with a surface.")
    try:
        yield mesh
    finally:
        evaluated.to_mesh_clear()


def evaluated_copy(item):
    """The object's evaluated mesh as one of its own, with all of its layers and materials."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    return bpy.data.meshes.new_from_object(
        item.evaluated_get(depsgraph), preserve_all_data_layers=True, depsgraph=depsgraph)


def group_points(item, shape, group):
    """(N, 3) float64, local: vertices of the shape that weigh at least one half in a vertex group."""
    with modifiers_limited(item, shape.stop):
        depsgraph = bpy.context.evaluated_depsgraph_get()
        with evaluated_mesh(item, depsgraph) as mesh:
            return numpy.array([tuple(vertex.co) for vertex in mesh.vertices
                                if any(entry.group == group.index and entry.weight >= 0.5
                                       for entry in vertex.groups)]).reshape(-1, 3)


def check_faces(item, arrays):
    if len(arrays["vertices"]) == 0 or len(arrays["face_sizes"]) == 0:
        name = emptied_by(item)
        if name:
            raise JobError(f"object '{item.name}': its modifier '{name}' leaves no surface. Change it, or "
                           "switch it off.")
        raise JobError(f"object '{item.name}': its mesh has {len(arrays['vertices'])} vertices and "
                       f"{len(arrays['face_sizes'])} faces, so it has no surface. Choose an "
                       "object with faces, or a points file.")
    if not numpy.isfinite(arrays["vertices"]).all():
        raise JobError(f"object '{item.name}': its mesh has vertices that are not finite. "
                       "Check its modifiers and transform.")


def check_solid(item, arrays):
    """JobError where all vertices lie in one plane, whatever its direction: there is nothing to
    fill. Call it after check_faces()."""
    points = arrays["vertices"].astype(numpy.float64)
    points -= points.mean(axis=0)
    # Rounding of float32 vertices: of where they are, which may be far from the origin.
    least = 1e-6 * float(numpy.abs(arrays["vertices"]).max())
    _values, axes = numpy.linalg.eigh(points.T @ points)
    if min(float(numpy.ptp(points @ axis)) for axis in axes.T) <= least:
        scale = item.matrix_world.to_scale()
        if min(map(abs, scale)) <= 1e-6 * max(map(abs, scale)):
            raise JobError(translate("'{name}' is flat: its Scale, or a parent's, is 0 along an axis. Give it "
                                     "another one.").format(name=item.name))
        how = "Solidify" if item.type == "MESH" else "Geometry > Extrude"
        raise JobError(f"'{item.name}' is flat: give it a thickness ({how}).")


def _parts(arrays):
    """(middle, volumes, centres): the tetrahedra between the vertices' mean and the triangles that
    the faces are cut into."""
    vertices = arrays["vertices"].astype(numpy.float64)
    middle = vertices.mean(axis=0)
    corners = vertices[arrays["face_vertices"]] - middle
    sizes = arrays["face_sizes"].astype(numpy.int64)
    first = numpy.repeat(numpy.cumsum(sizes) - sizes, numpy.maximum(sizes - 2, 0))
    place = numpy.concatenate([numpy.arange(1, size - 1) for size in sizes]
                              or [numpy.zeros(0, numpy.int64)]).astype(numpy.int64)
    a, b, c = corners[first], corners[first + place], corners[first + place + 1]
    volumes = numpy.einsum("ij,ij->i", a, numpy.cross(b, c)) / 6.0
    return middle, volumes, (a + b + c) / 4.0


def volume(arrays):
    """Volume that the faces enclose, negative where they look inside; of no meaning for an open
    mesh."""
    return float(_parts(arrays)[1].sum())


def center_of_mass(arrays):
    """Volume centroid of the triangulated faces [m]; the vertices' mean for an open mesh."""
    middle, volumes, centres = _parts(arrays)
    extent = numpy.ptp(arrays["vertices"].astype(numpy.float64), axis=0)
    if abs(volumes.sum()) < 1e-9 * float(numpy.prod(numpy.maximum(extent, 1e-12))):
        return middle
    return middle + (volumes[:, None] * centres).sum(axis=0) / volumes.sum()
