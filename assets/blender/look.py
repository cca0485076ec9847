# SPDX-License-Identifier: MIT
"""How points look as Gaussians: an ellipsoid at each point, and a material that fades as a Gaussian does.

An ellipsoid ends where its Gaussian has no more than 1/255 of opacity left, at the distance r = sqrt(2 ln(255 o)) in
standard deviations. In its own coordinates, in which it is the unit sphere, a ray that passes the centre at the
distance d sees its highest opacity there: o exp(-(d r)^2 / 2) = o (255 o)^(-d^2). The mesh around it is only a hull.
"""

import math

import bpy

from .node_trees import NodeBuilder

NAME = "ClipGStream Gaussians"
_HULL = 1.2585
"""Radius of the smallest icosahedron around the unit sphere."""


def geometry() -> bpy.types.NodeTree:
    """The node group that puts an ellipsoid at each point of a mesh."""
    found = bpy.data.node_groups.get(NAME)
    if found is not None:
        return found
    tree = bpy.data.node_groups.new(NAME, "GeometryNodeTree")
    tree.is_modifier = True
    for in_out in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=in_out, socket_type="NodeSocketGeometry")
    nodes = NodeBuilder(tree)
    opacity, scale, rotation = (
        nodes.add("GeometryNodeInputNamedAttribute", {"Name": name}, data_type=kind)
        for name, kind in (("opacity", "FLOAT"), ("scale", "FLOAT_VECTOR"), ("rotation", "QUATERNION"))
    )
    seen = nodes.math("MAXIMUM", nodes.math("MULTIPLY", opacity, 255.0), 1.0)
    reach = nodes.math("SQRT", nodes.math("MULTIPLY", nodes.math("LOGARITHM", seen, math.e), 2.0))
    sides = nodes.add("ShaderNodeVectorMath", {"Vector": scale, "Scale": reach}, operation="SCALE")
    hull = nodes.add("GeometryNodeMeshIcoSphere", {"Radius": _HULL, "Subdivisions": 1})
    ellipsoids = nodes.add(
        "GeometryNodeInstanceOnPoints",
        {
            "Points": nodes.add("NodeGroupInput"),
            "Selection": nodes.add("FunctionNodeCompare", {"A": seen, "B": 1.0}, operation="GREATER_THAN"),
            "Instance": nodes.add("GeometryNodeSetMaterial", {"Geometry": hull, "Material": material()}),
            "Rotation": rotation,
            "Scale": sides,
        },
    )
    nodes.add("NodeGroupOutput", {"Geometry": ellipsoids})
    return tree


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
