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

import bpy
import numpy

from . import halving, meshes, shapes

COARSE = 3.0  # particle separations: faces longer than this do not bend as the body does
FINE = 2.0  # and these do
MOST_FACES = 100000  # a mesh of more stays as it is
MIRRORED = "mirrored"  # in the file of a mesh: the object's scale is negative, the file's faces look outside


def is_coarse(arrays, separation):
    """Whether faces of a mesh (meshes.read_arrays) are much longer than the separation, and few enough
    that more may be made of them."""
    return (0 < len(arrays["face_sizes"]) <= MOST_FACES
            and float(halving.lengths(arrays).max()) > COARSE * separation)


def read(item, stretch, separation):
    """(the arrays of the mesh that the result moves, whether it is a refined one of ours), at the present
    frame; lengths in Blender units. With a refined one is what refined_mesh() makes it of again. Hair
    grows on faces of the object's own mesh, which it then keeps."""
    cage = None
    if item.type == "MESH":
        bound = shapes.bound_shape(item)
        cage = _Cage(item, bound, stretch)
        haired = not bound.made and any(shapes.is_hair(modifier) for modifier in item.modifiers)
        if haired or not is_coarse(cage.arrays, separation):
            return cage.arrays, False
    how = {"stretch": numpy.array(stretch, dtype=numpy.float64),
           "longest_edge": numpy.array([FINE * separation])}
    mesh = _refined(item, how, cage)
    arrays = {**meshes.read_arrays(mesh, stretch, 1.0, creases=True), **how}
    bpy.data.meshes.remove(mesh)
    return arrays, True


def how_refined(path):
    """How the mesh in a file of read() was refined; None where it is the object's own."""
    try:
        with numpy.load(path) as arrays:
            return {name: arrays[name] for name in ("stretch", "longest_edge")}
    except (OSError, EOFError, KeyError, ValueError, zipfile.BadZipFile):
        return None


def is_mirrored(path):
    """Whether the mesh in a file of read() is of an object with a negative scale."""
    try:
        with numpy.load(path) as arrays:
            return MIRRORED in arrays
    except (OSError, EOFError, ValueError, zipfile.BadZipFile):
        return False


def refined_mesh(item, how):
    """The refined mesh of the object at the present frame."""
    cage = _Cage(item, shapes.bound_shape(item), how["stretch"]) if item.type == "MESH" else None
    return _refined(item, how, cage)


def _refined(item, how, cage):
    """`cage`: what is refined; None of what is no mesh."""
    shape, longest = shapes.refined_shape(item), float(how["longest_edge"][0])
    with (_levels(item, shape, cage, longest) if cage is not None else contextlib.nullcontext(),
          shapes.modifiers_limited(item, shape.stop, refined=True)):
        mesh = meshes.evaluated_copy(item)
    halving.halve(mesh, how["stretch"], longest, MOST_FACES)
    return mesh


class _Cage:
    """The mesh before what refines it, at the present frame: what modifiers make of the object by then."""

    def __init__(self, item, bound, stretch):
        self.stop = bound.stop
        with (shapes.modifiers_limited(item, bound.stop),
              meshes.evaluated_mesh(item, bpy.context.evaluated_depsgraph_get()) as mesh):
            self.arrays = meshes.read_arrays(mesh, stretch, 1.0, creases=True)
            smooth = numpy.zeros(len(mesh.polygons), dtype=bool)
            mesh.polygons.foreach_get("use_smooth", smooth)
        self.smooth = bool(len(smooth)) and bool(smooth.all())

    def level(self, item, longest):
        """How often one that is shaded smooth is subdivided until its faces are short enough: halved
        straight they would keep its corners, where the limit surface is what was simulated."""
        if not self.smooth or self.stop == len(item.modifiers) or not shapes.makes_limit_surface(
                item.modifiers[self.stop]):
            return 0
        return math.ceil(math.log2(max(float(halving.lengths(self.arrays).max()) / longest, 1.0)))


@contextlib.contextmanager
def _levels(item, shape, cage, longest):
    """Subdivision of the cage is as fine as a render has it inside, and at least until its faces are
    `longest` where that rounds it, up to MOST_FACES; Simplify is off. What makes the shape stays as it
    was sampled."""
    render, before = bpy.context.scene.render, {}
    corners, least = len(cage.arrays["face_vertices"]), cage.level(item, longest)
    for modifier in list(item.modifiers)[cage.stop:shape.stop]:
        if modifier.type == "SUBSURF" and shapes.is_used(modifier):
            most = max(1, int(math.log(max(4.0 * MOST_FACES / max(corners, 1), 1.0), 4)))
            before[modifier.name] = modifier.levels
            shown = modifier.levels if modifier.show_viewport else 0
            rendered = modifier.render_levels if modifier.show_render else 0
            modifier.levels = min(max(shown, rendered, least), most)
            least = 0
            corners *= 4 ** modifier.levels
    simplified = bool(before) and render.use_simplify
    if simplified:
        render.use_simplify = False
    try:
        yield
    finally:
        for name, level in before.items():
            item.modifiers[name].levels = level
        if simplified:
            render.use_simplify = True
