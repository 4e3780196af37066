# SPDX-License-Identifier: GPL-3.0-or-later
"""The node set-up that shows points with a size and a turn as ellipsoids, inside of a crop box."""

import bpy

from .. import compat
from .nodes import Builder

# Attributes of the points: Euler angles XYZ, standard deviations, linear colour, opacity from 0 to 1.
TURN, SIZE, COLOUR, OPACITY = "splat_turn", "splat_size", "splat_colour", "splat_opacity"
MATERIAL = "Matterfit Splats"


def ellipsoids_tree(tree, name, crop, threshold):
    """A mesh's vertices as ellipsoids by their attributes, by `tree` or, where that is None, a new one of that
    name: those of at least the opacity `threshold`, and in the box of the object `crop` (None: all) along the
    axes of the object that is shown. The box follows the object; an empty is a box of its size."""
    if tree is None:
        tree = bpy.data.node_groups.new(name, "GeometryNodeTree")
        compat.add_group_socket(tree, "Geometry", "INPUT", "NodeSocketGeometry")
        compat.add_group_socket(tree, "Geometry", "OUTPUT", "NodeSocketGeometry")
    if tree.animation_data is not None:
        tree.animation_data_clear()
    tree.nodes.clear()
    builder = Builder(tree)
    points = builder.add("NodeGroupInput").outputs[0]
    faint = builder.math("LESS_THAN", _named(builder, OPACITY, "FLOAT"), threshold)
    points = _deleted(builder, points, faint)
    if crop is not None:
        points = _deleted(builder, points, _outside(builder, tree, crop))
    ball = builder.add("GeometryNodeMeshIcoSphere")
    for socket, value in (("Radius", 1.0), ("Subdivisions", 1)):
        compat.socket(ball.inputs, socket).default_value = value
    place = builder.add("GeometryNodeInstanceOnPoints")
    builder.link(points, place.inputs[0])
    builder.link(ball.outputs[0], compat.socket(place.inputs, "Instance"))
    builder.link(_named(builder, TURN, "FLOAT_VECTOR"), compat.socket(place.inputs, "Rotation"))
    builder.link(_named(builder, SIZE, "FLOAT_VECTOR"), compat.socket(place.inputs, "Scale"))
    real = builder.add("GeometryNodeRealizeInstances")
    builder.link(place.outputs[0], real.inputs[0])
    smooth = builder.add("GeometryNodeSetShadeSmooth")
    builder.link(real.outputs[0], smooth.inputs[0])
    assign = builder.add("GeometryNodeSetMaterial")
    compat.socket(assign.inputs, "Material").default_value = material()
    builder.link(smooth.outputs[0], assign.inputs[0])
    builder.link(assign.outputs[0], builder.add("NodeGroupOutput").inputs[0])
    return tree


def _named(builder, name, kind):
    node = builder.add("GeometryNodeInputNamedAttribute", data_type=kind)
    compat.socket(node.inputs, "Name").default_value = name
    return compat.socket(node.outputs, "Attribute", "VECTOR" if kind == "FLOAT_VECTOR" else "VALUE")


def _deleted(builder, geometry, selection):
    node = builder.add("GeometryNodeDeleteGeometry", domain="POINT")
    builder.link(geometry, node.inputs[0])
    builder.link(selection, compat.socket(node.inputs, "Selection"))
    return node.outputs[0]


def _outside(builder, tree, crop):
    """Whether a point lies outside of the object's box."""
    stands = builder.add("GeometryNodeObjectInfo", transform_space="RELATIVE")
    compat.socket(stands.inputs, "Object").default_value = crop
    if crop.type == "EMPTY":
        cube = builder.add("GeometryNodeMeshCube")
        size = compat.socket(cube.inputs, "Size")
        size.default_value = (2.0 * crop.empty_display_size,) * 3
        for curve in size.driver_add("default_value"):
            _follow_size(curve.driver, crop)
        shape = cube.outputs[0]
    else:
        own = builder.add("GeometryNodeObjectInfo", transform_space="ORIGINAL")
        compat.socket(own.inputs, "Object").default_value = crop
        bounds = builder.add("GeometryNodeBoundBox")
        builder.link(compat.socket(own.outputs, "Geometry"), bounds.inputs[0])
        shape = bounds.outputs[0]
    moved = builder.add("GeometryNodeTransform")
    builder.link(shape, moved.inputs[0])
    for source, target in (("Location", "Translation"), ("Rotation", "Rotation"), ("Scale", "Scale")):
        builder.link(compat.socket(stands.outputs, source), compat.socket(moved.inputs, target))
    box = builder.add("GeometryNodeBoundBox")
    builder.link(moved.outputs[0], box.inputs[0])
    low, high = compat.socket(box.outputs, "Min"), compat.socket(box.outputs, "Max")
    places = builder.add("GeometryNodeInputPosition").outputs[0]
    below = _vector(builder, "SUBTRACT", low, places)
    above = _vector(builder, "SUBTRACT", places, high)
    split = builder.add("ShaderNodeSeparateXYZ")
    builder.link(_vector(builder, "MAXIMUM", below, above), split.inputs[0])
    farthest = builder.math("MAXIMUM", split.outputs[0], split.outputs[1])
    return builder.math("GREATER_THAN", builder.math("MAXIMUM", farthest, split.outputs[2]), 0.0)


def _vector(builder, operation, first, second):
    node = builder.add("ShaderNodeVectorMath", operation=operation)
    builder.link(first, node.inputs[0])
    builder.link(second, node.inputs[1])
    return node.outputs[0]


def _follow_size(driver, empty):
    """An expression of one variable and numbers runs without leave for scripts."""
    driver.type = "SCRIPTED"
    variable = driver.variables.new()
    variable.name = "size"
    variable.targets[0].id_type = "OBJECT"
    variable.targets[0].id = empty
    variable.targets[0].data_path = "empty_display_size"
    driver.expression = "2 * size"


def material():
    """Shows the colour as it is, without light; made once."""
    found = bpy.data.materials.get(MATERIAL)
    if found is None:
        found = bpy.data.materials.new(MATERIAL)
        found.use_nodes = True
        nodes, links = found.node_tree.nodes, found.node_tree.links
        nodes.clear()
        colour = nodes.new("ShaderNodeAttribute")
        colour.attribute_name = COLOUR
        emission = nodes.new("ShaderNodeEmission")
        emission.location = (180, 0)
        links.new(colour.outputs["Color"], emission.inputs["Color"])
        output = nodes.new("ShaderNodeOutputMaterial")
        output.location = (360, 0)
        links.new(emission.outputs["Emission"], output.inputs["Surface"])
    return found
