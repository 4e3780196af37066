# SPDX-License-Identifier: GPL-3.0-or-later
"""Which mesh a result shows: the artist's own, what modifiers have made of it, or a refined one.

The artist works on while a bake runs, so what is made of his object at its end may be another mesh, or
none. The mesh that was sampled lies in the take's folder: its shape is right whatever became of the
object, and only UVs, colours and the like are missing.
"""

import bpy
import numpy

from ..compat import translate
from ..jobs import JobError
from . import frames, materials_kept, meshes, refinement, shapes
from .attached import TAG


def kind(bound, how):
    """Which mesh is shown: 0 the object's own, 1 what modifiers have made of it, 2 a refined one."""
    return 2 if how is not None else int(bound.made)


def give(work, item, source, bound, how, path, points):
    """Gives the result the mesh of as many vertices as were simulated; its materials stay. `path`: the
    file of the mesh that was sampled."""
    before = item.data
    if not bound.made:
        if before is not source.data:
            item.data = source.data
            materials_kept.on_object(item, before, source)
    else:
        mesh = _made(work, source, bound, how, points)
        if mesh is None and before.get(TAG) == kind(bound, how) and len(before.vertices) == points:
            mesh = before
        elif mesh is None:
            mesh = _sampled(source, path)
        if mesh is not before:
            materials_kept.on_mesh(mesh, before, source)
            mesh.name = f"{source.name} {work.take.name}"
            mesh[TAG] = kind(bound, how)
            item.data = mesh
    if before is not item.data and before.get(TAG) is not None and before.users == 0:
        bpy.data.meshes.remove(before)


def _made(work, source, bound, how, points):
    """What the modifiers before `bound` make of the object at the first frame; None, and said, where that
    is not the mesh that was simulated."""
    mesh, why = None, ""
    try:
        with (bpy.context.temp_override(scene=work.scene, view_layer=_view_layer(work.scene, source)),
              meshes.shown([source]), frames.frame_kept(work.scene)):
            work.scene.frame_set(work.first)
            mesh = _evaluated(source, bound) if how is None else refinement.refined_mesh(source, how)
    except (JobError, RuntimeError) as error:
        why = str(error)
    if mesh is not None and len(mesh.vertices) == points:
        return mesh
    if mesh is not None:
        bpy.data.meshes.remove(mesh)
    work.notes.append(translate(
        "'{name}' was changed while it was simulated: the result has the shape that was, but may "
        "lack UVs and colours. Bake again to have all of it.").format(name=source.name) + (f" ({why})" if why else ""))
    return None


def _view_layer(scene, item):
    """One of the scene that has the object, the present one if it does."""
    layers = [bpy.context.view_layer, *scene.view_layers]
    return next((layer for layer in layers if layer.id_data == scene and item.name in layer.objects), layers[1])


def _evaluated(item, shape):
    with shapes.modifiers_limited(item, shape.stop):
        return meshes.evaluated_copy(item)


def _sampled(source, path):
    """The mesh in the file that the take was simulated with, without its layers."""
    try:
        with numpy.load(path) as arrays:
            vertices, sizes, corners = (arrays[name] for name in ("vertices", "face_sizes", "face_vertices"))
            turn = -1 if refinement.MIRRORED in arrays else 1  # as the object's own mesh has its faces
    except (OSError, EOFError, KeyError, ValueError) as error:
        raise JobError(f"{path}: could not be read: {error}. Bake again.") from error
    ends = numpy.cumsum(sizes).tolist()
    corners = corners.tolist()
    mesh = bpy.data.meshes.new(source.name)
    mesh.from_pydata(vertices.tolist(), [],
                     [corners[first:end][::turn] for first, end in zip([0, *ends], ends, strict=False)])
    for material in getattr(source.data, "materials", ()):
        mesh.materials.append(material)
    return mesh
