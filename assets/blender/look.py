# SPDX-License-Identifier: MIT
"""How points look as Gaussians: a shape at each point, and a material that fades as a Gaussian does.

A Gaussian ends where no more than 1/255 of opacity o is left, at the distance r = sqrt(2 ln(255 o)) in standard
deviations. In coordinates in which it ends at the unit sphere, a ray that passes the centre at the distance d sees its
highest opacity there: o exp(-(d r)^2 / 2) = o (255 o)^(-d^2). The shape is only where the material is asked for that.

In the viewport, where anybody may look from anywhere, the shape is a hull around the sphere. In renders it is a plane
through the centre that faces the camera: one hit for each ray, which happens at the depth of the centre, so that
Gaussians cover each other in the order in which they were trained. Like in ClipGStream Studio, none is then thinner
than a part of a pixel.
"""

import math

import bpy

from .node_trees import NodeBuilder

NAME = "ClipGStream Gaussians"
_HULL = 1.2585
"""Radius of the smallest icosahedron around the unit sphere."""
_DISC_CORNERS = 6
_LOW_PASS_PX = 0.3**0.5
"""Added to all Gaussians in renders, as a standard deviation."""
_PIXEL = "Pixel"
"""Input of the node group: width of a pixel at the distance 1."""
_OUTSIDE = 1.001
"""A camera that is not so far from the centre is in the Gaussian, and does not see it."""


def geometry() -> bpy.types.NodeTree:
    """The node group that puts a shape at each point of a mesh."""
    found = bpy.data.node_groups.get(NAME)
    if found is not None:
        return found
    tree = bpy.data.node_groups.new(NAME, "GeometryNodeTree")
    tree.is_modifier = True
    for in_out in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=in_out, socket_type="NodeSocketGeometry")
    tree.interface.new_socket(_PIXEL, in_out="INPUT", socket_type="NodeSocketFloat")
    nodes = NodeBuilder(tree)
    opacity, scale, rotation = (
        nodes.add("GeometryNodeInputNamedAttribute", {"Name": name}, data_type=kind)
        for name, kind in (("opacity", "FLOAT"), ("scale", "FLOAT_VECTOR"), ("rotation", "QUATERNION"))
    )
    seen = nodes.math("MAXIMUM", nodes.math("MULTIPLY", opacity, 255.0), 1.0)
    reach = nodes.math("SQRT", nodes.math("MULTIPLY", nodes.math("LOGARITHM", seen, math.e), 2.0))
    is_viewport = nodes.add("GeometryNodeIsViewport")
    away = _to_camera(nodes)
    pixel = nodes.add("NodeGroupInput", output=_pixel_identifier(tree))
    blur = nodes.math(
        "MULTIPLY", pixel, nodes.math("SUBTRACT", _LOW_PASS_PX, nodes.math("MULTIPLY", is_viewport, _LOW_PASS_PX))
    )
    blurred = nodes.math(
        "MULTIPLY", blur, nodes.add("ShaderNodeVectorMath", {"Vector": away}, "Value", operation="LENGTH")
    )
    wide = _root_of_squares(nodes, scale, blurred)
    sides = nodes.add("ShaderNodeVectorMath", {"Vector": wide, "Scale": reach}, operation="SCALE")
    hull = nodes.add("GeometryNodeMeshIcoSphere", {"Radius": _HULL, "Subdivisions": 1})
    disc = nodes.add(
        "GeometryNodeMeshCircle",
        {"Vertices": _DISC_CORNERS, "Radius": 1.0 / math.cos(math.pi / _DISC_CORNERS)},
        fill_type="NGON",
    )
    shape = nodes.add("GeometryNodeSwitch", {"Switch": is_viewport, "False": disc, "True": hull}, input_type="GEOMETRY")
    placed = nodes.add(
        "GeometryNodeInstanceOnPoints",
        {
            "Points": nodes.add("NodeGroupInput"),
            "Selection": nodes.add("FunctionNodeCompare", {"A": seen, "B": 1.0}, operation="GREATER_THAN"),
            "Instance": nodes.add("GeometryNodeSetMaterial", {"Geometry": shape, "Material": material()}),
            "Rotation": rotation,
            "Scale": sides,
        },
    )
    turned = nodes.add(
        "GeometryNodeSetInstanceTransform", {"Instances": placed, "Transform": _facing(nodes, away, rotation, sides)}
    )
    shown = nodes.add(
        "GeometryNodeSwitch", {"Switch": is_viewport, "False": turned, "True": placed}, input_type="GEOMETRY"
    )
    nodes.add("NodeGroupOutput", {"Geometry": shown})
    return tree


def set_pixel(mesh_object: bpy.types.Object, width: float) -> None:
    """Tell our modifier of a mesh how wide a pixel of the render is at the distance 1. Users may have taken it away, or
    given it nodes of their own."""
    modifier = mesh_object.modifiers.get(NAME)
    tree = None if modifier is None else getattr(modifier, "node_group", None)
    name = None if tree is None else _pixel_identifier(tree)
    if name is not None and modifier.get(name) != width:
        modifier[name] = width
        modifier.id_data.update_tag()


def _pixel_identifier(tree: bpy.types.NodeTree) -> str | None:
    return next((item.identifier for item in tree.interface.items_tree if item.name == _PIXEL), None)


def _to_camera(nodes: NodeBuilder) -> bpy.types.NodeSocket:
    """From each point to the camera, in the coordinates of the object."""
    camera = nodes.add(
        "GeometryNodeObjectInfo",
        {"Object": nodes.add("GeometryNodeInputActiveCamera")},
        "Location",
        transform_space="RELATIVE",
    )
    here = nodes.add("GeometryNodeInputPosition")
    return nodes.add("ShaderNodeVectorMath", {"Vector": camera, "Vector_001": here}, operation="SUBTRACT")


def _root_of_squares(
    nodes: NodeBuilder, vector: bpy.types.NodeSocket, number: bpy.types.NodeSocket
) -> bpy.types.NodeSocket:
    """The square root of the sum of squares of each component and a number."""
    squares = nodes.add("ShaderNodeVectorMath", {"Vector": vector, "Vector_001": vector}, operation="MULTIPLY")
    square = nodes.math("MULTIPLY", number, number)
    sums = nodes.add("ShaderNodeVectorMath", {"Vector": squares, "Vector_001": square}, operation="ADD")
    halves = (0.5, 0.5, 0.5)
    return nodes.add("ShaderNodeVectorMath", {"Vector": sums, "Vector_001": halves}, operation="POWER")


def _facing(
    nodes: NodeBuilder, away: bpy.types.NodeSocket, rotation: bpy.types.NodeSocket, sides: bpy.types.NodeSocket
) -> bpy.types.NodeSocket:
    """The transform of an instance whose z axis points at the camera, in the coordinates of its Gaussian."""
    unrotated = nodes.add(
        "FunctionNodeRotateVector",
        {"Vector": away, "Rotation": nodes.add("FunctionNodeInvertRotation", {"Rotation": rotation})},
    )
    view = nodes.add("ShaderNodeVectorMath", {"Vector": unrotated, "Vector_001": sides}, operation="DIVIDE")
    turn = nodes.add("FunctionNodeAlignRotationToVector", {"Vector": view}, axis="Z")
    # seen from nearby, the outline of a sphere is wider than its equator
    square = nodes.add("ShaderNodeVectorMath", {"Vector": view, "Vector_001": view}, "Value", operation="DOT_PRODUCT")
    beyond = nodes.math("SUBTRACT", nodes.math("MAXIMUM", square, _OUTSIDE), 1.0)
    width = nodes.math("SQRT", nodes.math("ADD", nodes.math("DIVIDE", 1.0, beyond), 1.0))
    is_outside = nodes.math("GREATER_THAN", square, _OUTSIDE)
    turned = nodes.add(
        "FunctionNodeCombineTransform", {"Rotation": turn, "Scale": nodes.math("MULTIPLY", width, is_outside)}
    )
    return nodes.add(
        "FunctionNodeMatrixMultiply", {"Matrix": nodes.add("GeometryNodeInstanceTransform"), "Matrix_001": turned}
    )


def material() -> bpy.types.Material:
    """The material of all Gaussians, for Cycles and EEVEE."""
    found = bpy.data.materials.get(NAME)
    if found is not None:
        return found
    made = bpy.data.materials.new(NAME)
    if made.node_tree is None:  # before Blender 5
        made.use_nodes = True
    made.surface_render_method = "DITHERED"
    made.use_backface_culling = True
    if hasattr(made, "cycles"):
        made.cycles.emission_sampling = "NONE"  # not a lamp each: that would cost much and light little
    made.node_tree.nodes.clear()
    nodes = NodeBuilder(made.node_tree)
    here = nodes.add("ShaderNodeTexCoord", output="Object")
    incoming = nodes.add("ShaderNodeNewGeometry", output="Incoming")
    backfacing = nodes.add("ShaderNodeNewGeometry", output="Backfacing")
    ray = nodes.add(
        "ShaderNodeVectorTransform",
        {"Vector": incoming},
        vector_type="VECTOR",
        convert_from="WORLD",
        convert_to="OBJECT",
    )
    along, square, length = (
        nodes.add("ShaderNodeVectorMath", {"Vector": a, "Vector_001": b}, "Value", operation="DOT_PRODUCT")
        for a, b in ((here, ray), (here, here), (ray, ray))
    )
    nearest = nodes.math("SUBTRACT", square, nodes.math("DIVIDE", nodes.math("MULTIPLY", along, along), length))
    opacity = nodes.add("ShaderNodeAttribute", output="Fac", attribute_type="INSTANCER", attribute_name="opacity")
    color = nodes.add("ShaderNodeAttribute", output="Color", attribute_type="INSTANCER", attribute_name="color")
    fade = nodes.math("POWER", nodes.math("MULTIPLY", opacity, 255.0), nodes.math("MULTIPLY", nearest, -1.0))
    is_inside = nodes.math("LESS_THAN", nearest, 1.0)
    is_shown = nodes.math("MULTIPLY", is_inside, nodes.math("SUBTRACT", 1.0, backfacing))
    alpha = nodes.math("MULTIPLY", nodes.math("MULTIPLY", opacity, fade), is_shown)
    light = nodes.add("ShaderNodeEmission", {"Color": color, "Strength": 1.0})
    clear = nodes.add("ShaderNodeBsdfTransparent")
    mixed = nodes.add("ShaderNodeMixShader", {"Fac": alpha, "Shader": clear, "Shader_001": light})
    nodes.add("ShaderNodeOutputMaterial", {"Surface": mixed})
    return made
