# SPDX-License-Identifier: GPL-3.0-or-later
"""Node set-ups of attached caches. They use Blender's own nodes only, so they play without us."""

import math
import os

import bpy

from .. import compat

# Colours of bodies that have no material of their own, in turn.
COLORS = ((0.80, 0.36, 0.22), (0.24, 0.50, 0.72), (0.45, 0.62, 0.28), (0.74, 0.60, 0.25),
          (0.52, 0.36, 0.62), (0.35, 0.62, 0.60))
COLOR_OF_LAW = {"NEWTONIAN": 1, "DRUCKER_PRAGER": 3}  # liquids are blue, grains sandy
# Scalar attributes live in the red channel, vectors in red, green, blue.
VECTOR_ATTRIBUTES = frozenset({"velocity"})
GRAINS = "Grains"
VIEWPORT_GRAINS = 0.25  # of a render's grains
SCATTER = 0.75  # of a grain about its particle, in separations; twice
PACKING = 0.6  # volume of grains in that of sand
SIZES = 0.25  # of grains, about their mean
BLENDINGS = 4  # of a surface's velocity: over about a particle separation


class Builder:
    """Adds nodes from left to right."""

    def __init__(self, tree):
        self.tree = tree
        self.column = 0

    def add(self, kind, **values):
        node = self.tree.nodes.new(kind)
        node.location = (self.column * 180, 0)
        self.column += 1
        for name, value in values.items():
            setattr(node, name, value)
        return node

    def link(self, source, target):
        self.tree.links.new(source, target)

    def math(self, operation, first, second):
        node = self.add("ShaderNodeMath", operation=operation)
        for index, value in enumerate((first, second)):
            if isinstance(value, int | float):
                node.inputs[index].default_value = value
            elif value is not None:
                self.link(value, node.inputs[index])
        return node.outputs[0]


def particles_tree(name, separation, material, attributes, grains=0):
    """Vertices to points with a radius, a material and attributes from textures; of what is granular each
    to a mesh of `grains` octahedra (0: it is not).

    `attributes`: [(name, image, (width, height), first frame, last frame)].
    """
    tree = bpy.data.node_groups.get(name)
    if tree is None or tree.type != "GEOMETRY":
        tree = bpy.data.node_groups.new(name, "GeometryNodeTree")
        compat.add_group_socket(tree, "Geometry", "INPUT", "NodeSocketGeometry")
        compat.add_group_socket(tree, "Geometry", "OUTPUT", "NodeSocketGeometry")
    tree.nodes.clear()
    builder = Builder(tree)
    entry = builder.add("NodeGroupInput")
    points = builder.add("GeometryNodeMeshToPoints")
    compat.socket(points.inputs, "Radius").default_value = 0.5 * separation
    builder.link(entry.outputs[0], points.inputs[0])
    geometry = points.outputs[0]
    for attribute in attributes:
        geometry = _stored_attribute(builder, geometry, *attribute)
    if grains:
        geometry = _grains(builder, geometry, separation)
        set_grains(tree, grains)
    assign = builder.add("GeometryNodeSetMaterial")
    compat.socket(assign.inputs, "Material").default_value = material
    builder.link(geometry, assign.inputs[0])
    leave = builder.add("NodeGroupOutput")
    builder.link(assign.outputs[0], leave.inputs[0])
    return tree


def _grains(builder, geometry, separation):
    """A mesh of several grains about each point: what an MPM grid tears into clumps with holes a few cells
    wide closes again, and a pile has no lattice. A grain keeps its place beside its particle and its number
    from frame to frame, so that motion blur knows it, and has all attributes of the particle."""
    entry = builder.add("FunctionNodeInputInt", name=GRAINS, label=GRAINS)
    screen = builder.add("GeometryNodeIsViewport")
    share = builder.math("SUBTRACT", 1.0, builder.math("MULTIPLY", screen.outputs[0],
                                                       1.0 - VIEWPORT_GRAINS))
    amount = builder.math("CEIL", builder.math("MULTIPLY", entry.outputs[0], share), None)
    several = builder.add("GeometryNodeDuplicateElements", domain="POINT")
    builder.link(geometry, several.inputs[0])
    builder.link(amount, compat.socket(several.inputs, "Amount"))
    # Two uniform steps a coordinate: dense about the particle, without an edge.
    steps = builder.add("ShaderNodeVectorMath", operation="ADD")
    for seed in (0, 1):
        step = builder.add("FunctionNodeRandomValue", data_type="FLOAT_VECTOR")
        compat.socket(step.inputs, "Min", "VECTOR").default_value = (-SCATTER * separation,) * 3
        compat.socket(step.inputs, "Max", "VECTOR").default_value = (SCATTER * separation,) * 3
        compat.socket(step.inputs, "Seed").default_value = seed
        builder.link(compat.socket(step.outputs, "Value", "VECTOR"), steps.inputs[seed])
    move = builder.add("GeometryNodeSetPosition")
    builder.link(several.outputs[0], move.inputs[0])
    builder.link(steps.outputs[0], compat.socket(move.inputs, "Offset"))
    # All grains of a particle fill PACKING of its volume.
    cube = 3.0 * PACKING / 4.0  # an octahedron of radius 1 has 4/3
    radius = builder.math("MULTIPLY", builder.math("POWER", amount, -1.0 / 3.0),
                          separation * cube ** (1.0 / 3.0))
    size = builder.add("FunctionNodeRandomValue", data_type="FLOAT")
    compat.socket(size.inputs, "Min", "VALUE").default_value = 1.0 - SIZES
    compat.socket(size.inputs, "Max", "VALUE").default_value = 1.0 + SIZES
    compat.socket(size.inputs, "Seed").default_value = 2
    radius = builder.math("MULTIPLY", radius, compat.socket(size.outputs, "Value", "VALUE"))
    turn = builder.add("FunctionNodeRandomValue", data_type="FLOAT_VECTOR")
    compat.socket(turn.inputs, "Max", "VECTOR").default_value = (2.0 * math.pi,) * 3
    compat.socket(turn.inputs, "Seed").default_value = 3
    # An octahedron: EEVEE of 3.4 draws no points.
    grain = builder.add("GeometryNodeMeshUVSphere")
    for name, value in (("Segments", 4), ("Rings", 2), ("Radius", 1.0)):
        compat.socket(grain.inputs, name).default_value = value
    place = builder.add("GeometryNodeInstanceOnPoints")
    builder.link(move.outputs[0], place.inputs[0])
    builder.link(grain.outputs[0], compat.socket(place.inputs, "Instance"))
    builder.link(compat.socket(turn.outputs, "Value", "VECTOR"), compat.socket(place.inputs, "Rotation"))
    builder.link(radius, compat.socket(place.inputs, "Scale"))
    real = builder.add("GeometryNodeRealizeInstances")
    builder.link(place.outputs[0], real.inputs[0])
    return real.outputs[0]


def set_grains(tree, count):
    """How many grains each particle of a tree with grains is shown as."""
    entry = tree.nodes.get(GRAINS)
    if entry is not None:
        entry.integer = count


def velocity_tree(name, points, unit):
    """A mesh with the attribute `velocity` of an object's points: what Cycles blurs by, since the mesh
    of a level set has other vertices at every frame. The points have it in metres a second, the mesh in
    Blender units, of which a metre has `unit`. A vertex takes that of the nearest point; where the nearest
    is another one the velocity jumps, and blur would tear the faces there into streaks, so it is averaged
    over neighbouring faces `BLENDINGS` times."""
    tree = bpy.data.node_groups.get(name)
    if tree is None or tree.type != "GEOMETRY":
        tree = bpy.data.node_groups.new(name, "GeometryNodeTree")
        compat.add_group_socket(tree, "Geometry", "INPUT", "NodeSocketGeometry")
        compat.add_group_socket(tree, "Geometry", "OUTPUT", "NodeSocketGeometry")
    tree.nodes.clear()
    builder = Builder(tree)
    entry = builder.add("NodeGroupInput")
    info = builder.add("GeometryNodeObjectInfo", transform_space="RELATIVE")
    compat.socket(info.inputs, "Object").default_value = points
    cloud = compat.socket(info.outputs, "Geometry")
    nearest = builder.add("GeometryNodeSampleNearest")
    builder.link(cloud, nearest.inputs[0])
    known = builder.add("GeometryNodeInputNamedAttribute", data_type="FLOAT_VECTOR")
    compat.socket(known.inputs, "Name").default_value = "velocity"
    sample = builder.add("GeometryNodeSampleIndex", data_type="FLOAT_VECTOR")
    builder.link(cloud, sample.inputs[0])
    builder.link(compat.socket(known.outputs, "Attribute", "VECTOR"),
                 compat.socket(sample.inputs, "Value", "VECTOR"))
    builder.link(nearest.outputs[0], compat.socket(sample.inputs, "Index"))
    velocity = compat.socket(sample.outputs, "Value", "VECTOR")
    for _time in range(BLENDINGS):
        for domain in ("FACE", "POINT"):  # a face has the mean of its corners, a vertex that of its faces
            mean = builder.add("GeometryNodeFieldOnDomain", data_type="FLOAT_VECTOR", domain=domain)
            builder.link(velocity, compat.socket(mean.inputs, "Value", "VECTOR"))
            velocity = compat.socket(mean.outputs, "Value", "VECTOR")
    scaled = builder.add("ShaderNodeVectorMath", operation="SCALE")
    scaled.inputs["Scale"].default_value = unit
    builder.link(velocity, scaled.inputs[0])
    store = builder.add("GeometryNodeStoreNamedAttribute", data_type="FLOAT_VECTOR")
    store.domain = "POINT"
    compat.socket(store.inputs, "Name").default_value = "velocity"
    builder.link(scaled.outputs[0], compat.socket(store.inputs, "Value", "VECTOR"))
    builder.link(entry.outputs[0], store.inputs[0])
    leave = builder.add("NodeGroupOutput")
    builder.link(store.outputs[0], leave.inputs[0])
    return tree


def _stored_attribute(builder, geometry, name, image, size, first, last):
    """`geometry` with the attribute read from the frame's texture, points packed row-major.

    The frame is clamped to [first, last]: past the end the texture would give zeros.
    """
    width, height = size
    index = builder.add("GeometryNodeInputIndex").outputs[0]
    column = builder.math("MODULO", index, float(width))
    row = builder.math("FLOOR", builder.math("DIVIDE", index, float(width)), None)
    u = builder.math("DIVIDE", builder.math("ADD", column, 0.5), float(width))
    # Blender's textures begin at the bottom, the file at the top.
    v = builder.math("SUBTRACT", 1.0,
                     builder.math("DIVIDE", builder.math("ADD", row, 0.5), float(height)))
    place = builder.add("ShaderNodeCombineXYZ")
    builder.link(u, place.inputs[0])
    builder.link(v, place.inputs[1])
    time = builder.add("GeometryNodeInputSceneTime")
    frame = builder.math("FLOOR", compat.socket(time.outputs, "Frame"), None)
    frame = builder.math("MAXIMUM", frame, float(first))
    frame = builder.math("MINIMUM", frame, float(last))
    texture = builder.add("GeometryNodeImageTexture", interpolation="Closest")
    texture.extension = "EXTEND"
    compat.socket(texture.inputs, "Image").default_value = image
    builder.link(place.outputs[0], compat.socket(texture.inputs, "Vector"))
    builder.link(frame, compat.socket(texture.inputs, "Frame"))
    store = builder.add("GeometryNodeStoreNamedAttribute")
    store.domain = "POINT"
    color = compat.socket(texture.outputs, "Color")
    if name in VECTOR_ATTRIBUTES:
        store.data_type = "FLOAT_VECTOR"
        value = color
    else:
        store.data_type = "FLOAT"
        split = builder.add("ShaderNodeSeparateXYZ")
        builder.link(color, split.inputs[0])
        value = split.outputs[0]
    compat.socket(store.inputs, "Name").default_value = name
    builder.link(value, compat.socket(store.inputs, "Value"))
    builder.link(geometry, store.inputs[0])
    return store.outputs[0]


def sequence_image(path):
    """The image sequence that begins with `path`, colours left alone."""
    relative = relative_path(path)
    for image in bpy.data.images:
        if image.source == "SEQUENCE" and image.filepath == relative:
            return image
    image = bpy.data.images.load(path)
    image.filepath = relative
    image.source = "SEQUENCE"
    image.colorspace_settings.name = "Non-Color"
    return image


def relative_path(path):
    """// path where the .blend is on the same drive."""
    if not bpy.data.filepath:
        return path
    try:
        return bpy.path.relpath(path).replace(os.sep, "/")
    except ValueError:
        return path


def empty_material():
    """One that shows nothing."""
    name = "Matterfit Nothing"
    material = bpy.data.materials.get(name)
    if material is None:
        material = bpy.data.materials.new(name)
        material.use_nodes = True
        material.node_tree.nodes.clear()
    return material


def surface_material(name, color):
    """A plain material in a colour, made once."""
    material = bpy.data.materials.get(name)
    if material is None:
        material = bpy.data.materials.new(name)
        material.use_nodes = True
        material.diffuse_color = (*color, 1.0)
        for node in material.node_tree.nodes:
            if node.type == "BSDF_PRINCIPLED":
                node.inputs["Base Color"].default_value = (*color, 1.0)
                node.inputs["Roughness"].default_value = 0.5
    return material


def volume_material(name, color):
    """Principled Volume that reads the grid 'density'; made once."""
    material = bpy.data.materials.get(name)
    if material is None:
        material = bpy.data.materials.new(name)
        material.use_nodes = True
        nodes = material.node_tree.nodes
        nodes.clear()
        volume = nodes.new("ShaderNodeVolumePrincipled")
        volume.inputs["Color"].default_value = (*color, 1.0)
        volume.inputs["Density"].default_value = 20.0
        output = nodes.new("ShaderNodeOutputMaterial")
        output.location = (300, 0)
        material.node_tree.links.new(volume.outputs["Volume"], output.inputs["Volume"])
    return material
