# SPDX-License-Identifier: GPL-3.0-or-later
"""Which shape of an object is simulated and which mesh the result moves: both come after the
modifiers that make the shape (Mirror, Array, Solidify, Boolean, Geometry Nodes; a deformer too where
something was refined before it), the mesh before those that only refine it at the end (Subdivision,
Bevel), which then refine what was simulated."""

import contextlib
from dataclasses import dataclass

import bpy

from ..jobs import JobError

# Everything we put on an artist's object carries this prefix.
OWN_PREFIX = "Matterfit"

# Modifiers that move vertices and keep their number and order.
DEFORMERS = frozenset({
    "ARMATURE", "CAST", "CURVE", "DISPLACE", "HOOK", "LAPLACIANDEFORM", "LATTICE", "MESH_DEFORM",
    "SHRINKWRAP", "SIMPLE_DEFORM", "SMOOTH", "CORRECTIVE_SMOOTH", "LAPLACIANSMOOTH",
    "SURFACE_DEFORM", "WARP", "WAVE", "CLOTH", "SOFT_BODY", "MESH_CACHE",
})
# Modifiers that leave the vertices where they are, too. All others may change number and order.
STILL = frozenset({
    "COLLISION", "SURFACE", "PARTICLE_SYSTEM", "DATA_TRANSFER", "NORMAL_EDIT", "WEIGHTED_NORMAL",
    "UV_PROJECT", "UV_WARP", "VERTEX_WEIGHT_EDIT", "VERTEX_WEIGHT_MIX", "VERTEX_WEIGHT_PROXIMITY",
})
# Modifiers that add detail to a mesh that has the shape already. All others make the shape.
REFINERS = frozenset({"SUBSURF", "MULTIRES", "BEVEL", "TRIANGULATE", "EDGE_SPLIT"})
# Modifiers that make another mesh at every frame, or none.
RESTLESS = frozenset({"BUILD", "EXPLODE", "FLUID", "MESH_TO_VOLUME", "OCEAN", "PARTICLE_INSTANCE"})
# A node group of Blender's own that shades and moves nothing.
SHADING_NODES = "Smooth by Angle"


@dataclass(frozen=True)
class Shape:
    """Which shape of an object is used, and why. `stop` is the first modifier left out; `made` says
    that modifiers before it make other vertices than the object's own mesh has."""

    kind: str  # "mesh" or "cage"
    stop: int
    level: int
    text: str
    made: bool = False


def is_own(modifier):
    return modifier.name.startswith(OWN_PREFIX)


def is_used(modifier):
    """Counts in the viewport or in a render: a result must be right in both."""
    return modifier.show_viewport or modifier.show_render


def makes_limit_surface(modifier):
    """Whether the modifier subdivides a cage towards a smooth limit surface."""
    return modifier.type == "SUBSURF" and modifier.subdivision_type == "CATMULL_CLARK"


def subdivision_level(modifier):
    """The level of a Subdivision modifier where it is seen, at least 1."""
    return max(modifier.levels if modifier.show_viewport else modifier.render_levels, 1)


def _keeps_vertices(modifier):
    if modifier.type == "NODES":
        tree = modifier.node_group
        return tree is None or tree.name.startswith(SHADING_NODES)
    return modifier.type in DEFORMERS or modifier.type in STILL


def _deforms(modifier):
    return modifier.type in DEFORMERS


def _artists(item, wanted):
    """[(index, modifier)] of the artist's modifiers in use of which `wanted(modifier)`."""
    return [(index, modifier) for index, modifier in enumerate(item.modifiers)
            if not is_own(modifier) and is_used(modifier) and wanted(modifier)]


def _stack(item):
    """Those that change the vertices' number or order."""
    return _artists(item, lambda modifier: not _keeps_vertices(modifier))


def _split(item):
    """(makers, refiners): what makes the shape, and what comes after and only refines it; lists of
    (index, modifier). What is refined and then deformed is made: the cache of a coarser mesh would be
    deformed once more as it moves."""
    stack = _artists(item, lambda modifier: not _keeps_vertices(modifier) or _deforms(modifier))
    end, refined, made = 0, False, False
    for place, (_index, modifier) in enumerate(stack):
        if modifier.type in REFINERS:
            refined = True
            # The details of Multiresolution lie in the object's own mesh.
            if modifier.type == "MULTIRES" and made:
                end = place + 1
        elif not _deforms(modifier):
            made, end = True, place + 1
        elif refined:
            end = place + 1
    return stack[:end], [entry for entry in stack[end:] if not _deforms(entry[1])]


def _deformed(item):
    """How a mesh is called that no modifier has made."""
    deformers = _artists(item, _deforms)
    return f"the mesh after '{deformers[-1][1].name}'" if deformers else "the object's own mesh"


def body_shape(item):
    """The shape that is filled with particles: the limit surface of a cage that is subdivided at
    last, else what is evaluated."""
    everything = len(item.modifiers)
    if item.type != "MESH":
        return Shape("mesh", everything, 0, "the evaluated surface")
    makers, refiners = _split(item)
    if refiners:
        index, last = refiners[-1]
        if makes_limit_surface(last):
            return Shape("cage", index, subdivision_level(last),
                         f"the limit surface of the cage before '{last.name}'", bool(makers))
        return Shape("mesh", everything, 0, f"the mesh after '{last.name}'", True)
    if makers:
        return Shape("mesh", everything, 0, f"the mesh after '{makers[-1][1].name}'", True)
    return Shape("mesh", everything, 0, _deformed(item))


def bound_shape(item):
    """The mesh that a mesh cache moves: after what makes the shape, before what refines it."""
    makers, refiners = _split(item)
    if refiners:
        index, first = refiners[0]
        return Shape("mesh", index, 0, f"the mesh before '{first.name}'", bool(makers))
    return Shape("mesh", len(item.modifiers), 0, _deformed(item), bool(makers))


def refined_shape(item):
    """The mesh after what only refines it, too: what is bound where the mesh before that has faces too
    long to bend. What is no mesh (text, curves) is one once it is evaluated."""
    if item.type != "MESH":
        return Shape("mesh", len(item.modifiers), 0, "the evaluated surface", True)
    refiners = _split(item)[1]
    stop = refiners[-1][0] + 1 if refiners else len(item.modifiers)
    return Shape("mesh", stop, 0, body_shape(item).text, True)


def cache_place(item):
    """Where in the stack of an object of ours its cache stands: after its deformers, before what
    refines the mesh and before hair, which grows on what moves."""
    end = next((index for index, modifier in enumerate(item.modifiers)
                if is_used(modifier) and not is_own(modifier) and not _keeps_vertices(modifier)
                or modifier.type == "NODES" and is_own(modifier)), len(item.modifiers))
    deformers = [index for index, _modifier in _artists(item, _deforms) if index < end]
    first = deformers[-1] + 1 if deformers else 0
    return next((index for index in range(first, end) if is_hair(item.modifiers[index])), end)


def is_hair(modifier):
    return (modifier.type == "PARTICLE_SYSTEM"
            and modifier.particle_system.settings.type == "HAIR")


def loses_hair(item):
    """Whether hair of the object cannot stay on the result: it grows on faces of another mesh."""
    return any(is_hair(modifier) for modifier in item.modifiers) and bound_shape(item).made


def check(item, depsgraph):
    """JobError, by the modifier's name, where no simulated body could have the object's shape."""
    for _index, modifier in _stack(item):
        if modifier.type in RESTLESS:
            raise JobError(
                f"object '{item.name}': its modifier '{modifier.name}' makes another mesh at every "
                "frame, which a simulated body cannot follow. Apply the modifier, or switch it off.")
    nodes = [modifier for _index, modifier in _stack(item) if modifier.type == "NODES"]
    if nodes and any(instance.is_instance and instance.parent is not None
                     and instance.parent.original == item
                     for instance in depsgraph.object_instances):
        raise JobError(
            f"object '{item.name}': its modifier '{nodes[-1].name}' leaves instances, which are no "
            "surface. Add the node Realize Instances at its end.")


@contextlib.contextmanager
def _switched(item, wanted):
    """Modifiers are shown as `wanted` says, {(name, property): bool}, inside."""
    before = {}
    try:
        for (name, attribute), shown in wanted.items():
            now = getattr(item.modifiers[name], attribute)
            if now != shown:
                before[name, attribute] = now
                setattr(item.modifiers[name], attribute, shown)
        if before:
            bpy.context.view_layer.update()
        yield
    finally:
        for (name, attribute), shown in before.items():
            setattr(item.modifiers[name], attribute, shown)
        if before:
            bpy.context.view_layer.update()


def restless_off(item):
    """Modifiers that a simulated body cannot follow are switched off inside, as a person is told to."""
    return _switched(item, {(modifier.name, attribute): False
                            for modifier in item.modifiers if modifier.type in RESTLESS
                            for attribute in ("show_viewport", "show_render")})


def emptied_by(item):
    """The name of the modifier after which nothing is left of a mesh that has faces; "" where the mesh
    itself has none, or something is left."""
    if item.type != "MESH" or not item.data.polygons:
        return ""
    for index, modifier in _stack(item):
        with modifiers_limited(item, index + 1):
            if not item.evaluated_get(bpy.context.evaluated_depsgraph_get()).data.polygons:
                return modifier.name
    return ""


def modifiers_limited(item, stop, refined=False):
    """Our own modifiers and those from index `stop` on are off inside; what makes the shape in
    renders only is on, and with `refined` what refines it too."""
    makers, refiners = _split(item)
    makers = {modifier.name for _index, modifier in makers + (refiners if refined else [])}
    return _switched(item, {
        (modifier.name, "show_viewport"):
            (modifier.show_viewport or modifier.name in makers) and index < stop and not is_own(modifier)
        for index, modifier in enumerate(item.modifiers)})
