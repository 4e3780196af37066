# SPDX-License-Identifier: GPL-3.0-or-later
"""The particles of a body as a point cloud, with what textures say of each."""

import bpy
import numpy

from .. import laws
from ..props import reactions
from . import attached, cache, nodes, point_cache

NODES = "Matterfit Particles"


def _cloud(work, name, points, sample):
    """The vertex-only mesh of a body's particles, at one sample of the cache."""
    item = work.object(
        f"points:{name}", f"{name} particles",
        lambda label: bpy.data.objects.new(label, bpy.data.meshes.new(label)))
    item.scale = (work.unit,) * 3
    mesh = item.data
    if len(mesh.vertices) != points.points:
        # A cloud of another size would show undeformed without a word.
        mesh.clear_geometry()
        mesh.vertices.add(points.points)
    if points.samples:
        places = cache.read_pc2_frame(points, sample)
        mesh.vertices.foreach_set("co", numpy.ascontiguousarray(places).ravel())
        mesh.update()
    return item


def live_particles(work, name, points):
    """Shows the newest baked frame: a PC2 plays only once it is finished."""
    item = _cloud(work, name, points, points.samples - 1)
    modifier = item.modifiers.get("Matterfit Cache")
    if modifier is not None:
        item.modifiers.remove(modifier)
    if NODES not in item.modifiers:
        _points_nodes(work, item, name, [])


def particles(work, name, points, attributes):
    """Shows a finished PC2; `attributes` are the texture sequences of the cache by their names."""
    item = _cloud(work, name, points, 0)
    point_cache.play(item, points, work.first)
    textures = []
    for attribute in work.document.get("output", {}).get("attributes", []):
        sequence = attributes.get(f"{name}_{attribute}")
        if sequence is not None:
            path = sequence.path(sequence.first)
            textures.append((attribute, nodes.sequence_image(path), cache.exr_size(path),
                             sequence.first, sequence.last))
    _points_nodes(work, item, name, textures)


def _points_nodes(work, item, name, textures):
    grains = work.scene.matterfit.output.grains if laws.granular(work.law(name)) else 0
    tree = nodes.particles_tree(f"{NODES} {item.name}", work.separation, work.material(name), textures,
                                grains)
    modifier = item.modifiers.get(NODES)
    if modifier is None:
        modifier = item.modifiers.new(NODES, "NODES")
    modifier.node_group = tree


@reactions.grains_restyled.done_by
def restyle(settings):
    """As many grains a particle as Output has now, in all takes of the scene."""
    for item in settings.id_data.objects:
        modifier = item.modifiers.get(NODES)
        if item.get(attached.TAG, "").startswith("points:") and modifier and modifier.node_group:
            nodes.set_grains(modifier.node_group, settings.output.grains)
