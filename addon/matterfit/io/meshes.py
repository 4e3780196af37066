# SPDX-License-Identifier: GPL-3.0-or-later
"""Evaluated meshes, read the way the job needs them."""

import contextlib
from dataclasses import dataclass

import bpy
import numpy

from ..jobs import JobError
from . import files

# Everything we put on an artist's object carries this prefix.
OWN_PREFIX = "Matterfit"

# Modifiers that keep the number and order of vertices; any other may change them.
DEFORMERS = frozenset({
    "ARMATURE", "CAST", "CURVE", "DISPLACE", "HOOK", "LAPLACIANDEFORM", "LATTICE", "MESH_DEFORM",
    "SHRINKWRAP", "SIMPLE_DEFORM", "SMOOTH", "CORRECTIVE_SMOOTH", "LAPLACIANSMOOTH",
    "SURFACE_DEFORM", "WARP", "WAVE", "CLOTH", "SOFT_BODY", "MESH_CACHE", "COLLISION", "SURFACE",
    "PARTICLE_SYSTEM", "DATA_TRANSFER", "NORMAL_EDIT", "WEIGHTED_NORMAL", "UV_PROJECT", "UV_WARP",
    "VERTEX_WEIGHT_EDIT", "VERTEX_WEIGHT_MIX", "VERTEX_WEIGHT_PROXIMITY",
})


@dataclass(frozen=True)
class Shape:
    """Which shape of an object is used, and why. `stop` is the first modifier left out."""

    kind: str  # "mesh" or "cage"
    stop: int
    level: int
    text: str


def is_own(modifier):
    return modifier.name.startswith(OWN_PREFIX)


def is_used(modifier):
    """Counts in the viewport or in a render: a result must be right in both."""
    return modifier.show_viewport or modifier.show_render


def subdivision_level(modifier):
    """The level of a Subdivision modifier where it is seen, at least 1."""
    return max(modifier.levels if modifier.show_viewport else modifier.render_levels, 1)


def first_topology_modifier(item, own=False):
    """Index of the first modifier in use that may change the vertices, or their number.

    Ours do not count, unless `own`.
    """
    for index, modifier in enumerate(item.modifiers):
        if (is_own(modifier) and not own) or not is_used(modifier):
            continue
        if modifier.type not in DEFORMERS:
            return index
    return len(item.modifiers)


def body_shape(item):
    """The shape that is filled with particles: the cage of a subdivided mesh, else all of it."""
    if item.type != "MESH":
        return Shape("mesh", len(item.modifiers), 0, "the evaluated surface")
    stop = first_topology_modifier(item)
    if stop == len(item.modifiers):
        return Shape("mesh", stop, 0, "the mesh after its deformers")
    modifier = item.modifiers[stop]
    rest = [other for other in item.modifiers[stop + 1:]
            if is_used(other) and not is_own(other) and other.type not in DEFORMERS]
    if modifier.type == "SUBSURF" and modifier.subdivision_type == "CATMULL_CLARK" and not rest:
        return Shape("cage", stop, subdivision_level(modifier),
                     f"the limit surface of the cage before '{modifier.name}'")
    # What is evaluated is the viewport's mesh.
    seen = [other.name for other in item.modifiers if other.show_viewport and not is_own(other)]
    text = (f"the mesh after all modifiers (the last is '{seen[-1]}')" if seen
            else "the mesh without modifiers, as the viewport shows it")
    return Shape("mesh", len(item.modifiers), 0, text)


def render_shape(item):
    """The shape that a mesh cache moves: the mesh before the first topology modifier."""
    stop = first_topology_modifier(item)
    if stop < len(item.modifiers):
        return Shape("mesh", stop, 0, f"the mesh before '{item.modifiers[stop].name}'")
    return Shape("mesh", stop, 0, "the mesh after its deformers")


@contextlib.contextmanager
def modifiers_limited(item, stop):
    """Our own modifiers and those from index `stop` on are off inside."""
    changed = []
    for index, modifier in enumerate(item.modifiers):
        if (index >= stop or is_own(modifier)) and modifier.show_viewport:
            changed.append(modifier.name)
            modifier.show_viewport = False
    try:
        if changed:
            bpy.context.view_layer.update()
        yield
    finally:
        for name in changed:
            item.modifiers[name].show_viewport = True
        if changed:
            bpy.context.view_layer.update()


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


def check_faces(item, arrays):
    if len(arrays["vertices"]) == 0 or len(arrays["face_sizes"]) == 0:
        raise JobError(f"object '{item.name}': its mesh has {len(arrays['vertices'])} vertices and "
                       f"{len(arrays['face_sizes'])} faces, so it has no surface. Choose an "
                       "object with faces, or a points file.")
    if not numpy.isfinite(arrays["vertices"]).all():
        raise JobError(f"object '{item.name}': its mesh has vertices that are not finite. "
                       "Check its modifiers and transform.")


def write_mesh(path, arrays):
    return files.write_npz(path, arrays)


def center_of_mass(arrays):
    """Volume centroid of the triangulated faces [m]; the vertices' mean for an open mesh."""
    vertices = arrays["vertices"].astype(numpy.float64)
    middle = vertices.mean(axis=0)
    volume, moment, start = 0.0, numpy.zeros(3), 0
    for size in arrays["face_sizes"]:
        face = vertices[arrays["face_vertices"][start:start + size]] - middle
        start += size
        for second in range(1, size - 1):
            a, b, c = face[0], face[second], face[second + 1]
            part = float(numpy.dot(a, numpy.cross(b, c))) / 6.0
            volume += part
            moment += part * (a + b + c) / 4.0
    extent = numpy.ptp(vertices, axis=0)
    if abs(volume) < 1e-9 * float(numpy.prod(numpy.maximum(extent, 1e-12))):
        return middle
    return middle + moment / volume
