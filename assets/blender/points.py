# SPDX-License-Identifier: MIT
"""Gaussians as the points of a mesh, with attributes scale, rotation, opacity and color."""

import bpy
import numpy as np

from .ply import Cloud

_THINNEST = np.float32(1e-4)
"""Of a Gaussian's longest side: what is thinner has no inverse in single precision."""


def fill(mesh: bpy.types.Mesh, cloud: Cloud, *, size: float, is_linear: bool) -> None:
    """Replace the points of a mesh.

    Args:
        size: Factor of all scales.
        is_linear: Whether colours are written in linear light instead of display-encoded.
    """
    n = len(cloud)
    scales = np.maximum(cloud.scales, _THINNEST * cloud.scales.max(axis=1, initial=0.0, keepdims=True))
    if len(mesh.vertices) != n:
        mesh.clear_geometry()
        mesh.vertices.add(n)
    mesh.vertices.foreach_set("co", cloud.means.ravel())
    colors = np.ones((n, 4), np.float32)
    colors[:, :3] = _linear(cloud.colors) if is_linear else cloud.colors
    for name, kind, field, values in (
        ("scale", "FLOAT_VECTOR", "vector", scales * np.float32(size)),
        ("rotation", "QUATERNION", "value", cloud.quats),
        ("opacity", "FLOAT", "value", cloud.opacities),
        ("color", "FLOAT_COLOR", "color", colors),
    ):
        attribute = mesh.attributes.get(name) or mesh.attributes.new(name, kind, "POINT")
        attribute.data.foreach_set(field, np.ascontiguousarray(values, np.float32).ravel())
    mesh.update()


def _linear(colors: np.ndarray) -> np.ndarray:
    """sRGB, decoded."""
    return np.where(colors <= 0.04045, colors / 12.92, ((colors + 0.055) / 1.055) ** 2.4)
