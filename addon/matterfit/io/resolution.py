# SPDX-License-Identifier: GPL-3.0-or-later
"""The quality presets: how many cells lie across the thinnest part that matters, and how many
particles that makes; a scene in which something pours has many particles at least, since what pours
is sheets and drops that its shape at rest tells nothing of. What is measured is the shape that is
simulated (shapes.py)."""

import contextlib
from dataclasses import dataclass

import bpy
import numpy
from mathutils import Vector
from mathutils.bvhtree import BVHTree

from .. import laws
from ..compat import translate
from ..jobs import JobError
from ..props import reactions
from . import halving, meshes, plain, presets, shapes, transforms

RAYS = 400
HITS = 8
PREVIEW_PARTICLES, PREVIEW_LAYERS = 4000, 2  # at most, and of these across the thinnest part at least
THIN = 0.25  # of a body's box, its longest side and its shortest left out: walls and plates
WIRES = 0.6  # twice the volume over thickness × area: 1 of a wall, 1/2 of a wire
BOTH_ENDS = 0.4  # layers: a particle is where .3 of one is inside (capture/particle_volumes.cpp)
FEWEST_CELLS = 1.5  # across a wall: three layers of particles, below which it is a hinge
_applying = []
_known = {}  # object's name: Size, for when the object is hidden


@dataclass(frozen=True)
class Size:
    """The size of a body in Blender units: `thickness` of its thin parts, `volume`, `sides` of its box;
    `wires`: its thin parts are thin across as well."""

    thickness: float
    volume: float
    sides: tuple
    wires: bool = False

    def most_particles(self, separation):
        """At most: part of a layer takes a whole one, and at both ends of a thin wall or wire one may."""
        thickness, (_least, middle, longest) = min(self.thickness, *self.sides), sorted(self.sides)
        across = thickness if self.wires else middle
        layers = [max(length / separation, 1e-6) for length in (thickness, across, longest)]
        whole = [numpy.ceil(count - 1e-3) for count in layers]
        if self.wires:  # where cells meet a wire is in both
            whole[:2] = numpy.maximum(numpy.ceil(numpy.add(layers[:2], BOTH_ENDS - 1e-3)), 2.0)
        elif thickness < THIN * middle:  # the count is a mean over where the wall lies
            whole[0] = max(whole[0], layers[0] + BOTH_ENDS)
        return self.volume * float(numpy.prod(numpy.divide(whole, layers))) / separation**3


@reactions.separation_typed.done_by
def separation_typed(solver):
    """Called when the particle separation changes; typing it makes the quality Custom."""
    if not _applying and solver.quality != "CUSTOM":
        _set(solver, "quality", "CUSTOM")


@reactions.quality_chosen.done_by
def apply_quality(solver, scene):
    """Sets the particle separation from the quality, but to no more particles than the solver's
    Most Particles; without bodies nothing changes."""
    if _applying or solver.quality == "CUSTOM":
        return
    items = bodies(scene)
    with meshes.shown(items):
        sizes = [size for size in (_measure(item) for item in items) if size is not None]
    if sizes:
        solver.for_flows = pours(scene)
        wanted = separation(min(size.thickness for size in sizes), solver.quality)
        if solver.for_flows:
            volume = sum(size.volume for size in sizes)
            wanted = min(wanted, (volume / presets.poured_particles(solver.quality)) ** (1.0 / 3.0))
        # Four digits: a thickness measured in floats must not leave 0.0024999 m.
        _set(solver, "particle_separation",
             float(f"{_limited(sizes, wanted, solver.most_particles):.4g}"))


@reactions.flow_changed.done_by
def flow_changed(scene):
    """A scene is measured anew where something pours and nothing did, or the reverse."""
    solver = scene.matterfit.solver
    if pours(scene) != solver.for_flows:
        # A run reports an object that is not there any more.
        with contextlib.suppress(JobError):
            apply_quality(solver, scene)


def pours(scene):
    """Whether anything that is simulated does."""
    return laws.any_flows(scene.matterfit.bodies)


@contextlib.contextmanager
def kept(scene):
    """The separation stays as it is inside: a material that was fitted at it comes back."""
    _applying.append("kept")
    try:
        yield
    finally:
        _applying.pop()
        scene.matterfit.solver.for_flows = pours(scene)


def _limited(sizes, wanted, limit):
    """`wanted`, or the separation near the smallest one that makes no more particles than `limit`;
    four digits of it do so too."""
    least = (sum(size.volume for size in sizes) / limit) ** (1.0 / 3.0)
    if wanted < 1.0005 * least:
        wanted = 1.0005 * least
    for _step in range(200):
        count = sum(size.most_particles(float(f"{wanted:.4g}")) for size in sizes)
        if count <= limit:
            break
        wanted *= max((count / limit) ** (1.0 / 3.0), 1.0005)
    return wanted


def for_preview(scene, wanted):
    """The particle separation [Blender units] of a preview: `wanted`, or where a thin shape would have many
    particles, a larger one, as far as the thinnest part leaves."""
    known = seen(scene)
    sizes = list(known.values())
    if not any(size.thickness < THIN * sorted(size.sides)[1] for size in sizes):
        return wanted
    most = thinnest(scene, known) / PREVIEW_LAYERS
    return max(wanted, min(_limited(sizes, wanted, PREVIEW_PARTICLES), most))


def separation(thickness, quality):
    """Particle separation for a thickness: a cell is twice the separation."""
    return thickness / (2.0 * presets.cells_across(quality))


def bodies(scene):
    """The objects that are simulated."""
    return [body.object for body in scene.matterfit.bodies
            if body.enabled and body.role == "BODY" and body.source == "OBJECT"
            and body.object is not None and body.object.type != "EMPTY"
            and body.object.name in scene.objects]


def seen(scene):
    """{object's name: Size} of each body that can be measured, as a panel may: nothing is changed, and
    a hidden object is what it was when it was seen last. It casts rays: who draws hands it on to the
    functions below, which else look themselves."""
    found = {item.name: _seen(item) for item in bodies(scene)}
    return {name: size for name, size in found.items() if size is not None}


def thinnest(scene, known=None):
    """Thickness of the thinnest body in Blender units, or None where there is no body."""
    known = seen(scene) if known is None else known
    return min((size.thickness for size in known.values()), default=None)


def cells_across(scene, known=None):
    """Cells across the thinnest part with the present separation, or None."""
    thickness = thinnest(scene, known)
    return None if thickness is None else thickness / (
        2.0 * scene.matterfit.solver.particle_separation)


def limited_to(scene, known=None):
    """(particles, what the quality asks for: 6 cells) where the limit of particles allows less, else
    None."""
    solver = scene.matterfit.solver
    cells = None if solver.quality == "CUSTOM" else cells_across(scene, known)
    if cells is None:
        return None
    wanted = presets.cells_across(solver.quality)
    if cells < 0.98 * wanted:
        return solver.most_particles, plain.counted(wanted, "cell")
    wanted = presets.poured_particles(solver.quality)
    if pours(scene) and solver.most_particles < wanted:
        return solver.most_particles, plain.counted(wanted, "particle")
    return None


def advice(scene, known=None):
    """What is to be said of a thin part of a solid that too few particles share; "" where all have
    enough."""
    solver = scene.matterfit.solver
    known = seen(scene) if known is None else known
    solid = [known[body.object.name].thickness for body in scene.matterfit.bodies
             if body.role == "BODY" and body.object is not None and body.object.name in known
             and not laws.material_flows(body.material)]
    cells = min(solid, default=numpy.inf) / (2.0 * solver.particle_separation)
    if cells >= 0.95 * FEWEST_CELLS:  # nearer than that it would be advised to be as thick as it is
        return ""
    metres = transforms.metres(scene)
    more = (translate("raise Most Particles") if limited_to(scene, known) is not None
            else translate("lower Particle Separation"))
    return translate(
        "The thinnest part is {thickness}, as thick as {layers}: it bends and breaks too easily. Make it "
        "{least} thick, or {more}.").format(
            thickness=plain.length_text(metres * 2.0 * cells * solver.particle_separation),
            layers=plain.counted(max(int(2.0 * cells + 0.05), 1), "layer"),
            least=plain.length_text(metres * 2.0 * FEWEST_CELLS * solver.particle_separation), more=more)


def _measure(item):
    """Size of the shape that is simulated, or will be once Build and its like are off; the object can be
    evaluated."""
    everything = shapes.Shape("mesh", len(item.modifiers), 0, "")
    with shapes.restless_off(item):
        _known[item.name] = size_of(
            meshes.read_shape(item, everything, item.matrix_world.to_3x3(), 1.0))
    return _known[item.name]


def forget():
    """Another file is open: its objects may have the same names."""
    _known.clear()


def _seen(item):
    if item.visible_get() and item.mode != "EDIT":
        evaluated = item.evaluated_get(bpy.context.evaluated_depsgraph_get())
        mesh = evaluated.to_mesh()
        if mesh is not None:
            arrays = meshes.read_arrays(mesh, item.matrix_world.to_3x3(), 1.0)
            evaluated.to_mesh_clear()
            _known[item.name] = size_of(arrays)
    elif item.name not in _known and item.type == "MESH":
        return size_of(meshes.read_arrays(item.data, item.matrix_world.to_3x3(), 1.0))
    return _known.get(item.name)


def size_of(arrays):
    """Size of a mesh (meshes.read_arrays); None where it has no extent.

    The thickness is the 5th percentile of the distances from face centres straight through. Rays
    that find no other side (open meshes) do not count; without any the smallest side of the
    bounding box is taken, and an open mesh has that box's volume.
    """
    vertices = arrays["vertices"].astype(numpy.float64)
    if not len(vertices):
        return None
    extent = numpy.ptp(vertices, axis=0)
    sides = [float(side) for side in extent if side > 1e-9]
    if not sides:
        return None
    box = float(numpy.prod(numpy.maximum(extent, 1e-9)))
    distances = _distances(vertices.tolist(), _polygons(arrays), float(max(extent)))
    volume = abs(meshes.volume(arrays))
    lengths = tuple(max(float(side), 1e-9) for side in extent)
    thickness = float(numpy.percentile(distances, 5.0)) if distances else min(sides)
    if not distances or volume <= 1e-6 * box:
        return Size(thickness, box, lengths)
    wires = (thickness < THIN * sorted(lengths)[1]
             and 2.0 * volume < WIRES * thickness * halving.area(arrays))
    return Size(thickness, volume, lengths, wires)


def _polygons(arrays):
    """The faces as lists of corners; of millions of them in a second."""
    corners = arrays["face_vertices"].tolist()
    ends = numpy.cumsum(arrays["face_sizes"]).tolist()
    return [corners[first:end] for first, end in zip([0, *ends], ends, strict=False)]


def _distances(vertices, polygons, extent):
    if not polygons:
        return []
    tree = BVHTree.FromPolygons(vertices, polygons)
    step = max(1, len(polygons) // RAYS)
    distances = []
    for index in range(0, len(polygons), step):
        corners = [Vector(vertices[vertex]) for vertex in polygons[index]]
        center = sum(corners, Vector()) / len(corners)
        normal = (corners[1] - corners[0]).cross(corners[-1] - corners[0])
        if normal.length < 1e-12:
            continue
        normal.normalize()
        near = 1e-5 * extent
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
    return distances


def _set(solver, name, value):
    _applying.append(name)
    try:
        setattr(solver, name, value)
    finally:
        _applying.pop()
