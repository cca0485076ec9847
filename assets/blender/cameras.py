# SPDX-License-Identifier: MIT
"""Cameras of the capture as Blender's cameras: lens, shift, and the size of the picture that belongs to them."""

import bpy
from mathutils import Matrix

from .sidecar import SequenceCamera

_SENSOR_MM = 36.0
_FROM_OPENCV = Matrix.Diagonal((1.0, -1.0, -1.0, 1.0))
"""From x right, y down, z forward to x right, y up, z back."""
SIZE, PIXEL_ASPECT = "clipgstream_size", "clipgstream_pixel_aspect"
"""Properties of a camera: width and height of its picture; height of a pixel in widths."""


def set_camera(camera: bpy.types.Object, row: SequenceCamera, *, near_m: float) -> None:
    """Give a camera lens, place and picture of a captured one. A skew of its pixels is left out.

    Args:
        near_m: Nearest depth that is drawn, metres of the scene.
    """
    (width, height), K = row.size, row.K
    aspect = K[0][0] / K[1][1]
    lens = camera.data
    lens.type, lens.sensor_fit, lens.sensor_width = "PERSP", "HORIZONTAL", _SENSOR_MM
    lens.lens = K[0][0] / width * _SENSOR_MM
    lens.shift_x = (width / 2 - K[0][2]) / width
    lens.shift_y = (K[1][2] - height / 2) * aspect / width
    lens[SIZE], lens[PIXEL_ASPECT] = row.size, aspect
    lens.clip_start = near_m
    camera.matrix_parent_inverse.identity()
    camera.matrix_basis = Matrix((*row.camera_to_world, (0.0, 0.0, 0.0, 1.0))) @ _FROM_OPENCV


def look_through(scene: bpy.types.Scene, camera: bpy.types.Object) -> None:
    """Render through a camera, in the size of its captured picture."""
    scene.camera = camera
    if SIZE not in camera.data:
        return
    render, aspect = scene.render, camera.data[PIXEL_ASPECT]
    render.resolution_x, render.resolution_y = camera.data[SIZE]
    render.pixel_aspect_x, render.pixel_aspect_y = max(1.0, 1.0 / aspect), max(1.0, aspect)


def pixel_width(scene: bpy.types.Scene) -> float:
    """Width of a pixel of the render at the distance 1; 0 without a camera with perspective."""
    camera, render = scene.camera, scene.render
    if camera is None or camera.type != "CAMERA" or camera.data.type != "PERSP":
        return 0.0
    width_px = render.resolution_x * render.resolution_percentage / 100
    height_px = render.resolution_y * render.resolution_percentage / 100
    aspect = render.pixel_aspect_y / render.pixel_aspect_x
    lens = camera.data
    if lens.sensor_fit == "VERTICAL":
        return lens.sensor_height / lens.lens / (height_px * aspect)
    is_wide = lens.sensor_fit == "HORIZONTAL" or width_px >= height_px * aspect
    return lens.sensor_width / lens.lens / (width_px if is_wide else height_px * aspect)
