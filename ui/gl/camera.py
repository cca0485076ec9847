"""The one place where an OpenCV camera becomes a GL matrix.

Every picture of ui.gl is stored with its top row first: framebuffer row 0 is the picture's row 0. So y points down on
both sides, nothing is mirrored anywhere, and textures show upright in ImGui with its default uv (0, 0)-(1, 1).
Not here: orbiting and other user input (app.playback.views.orbit_view).
"""

from __future__ import annotations

import numpy as np

NEAR = 0.01
"""Nothing nearer to the camera than this is drawn unless the caller says otherwise, scene units."""


def clip_matrix(
    world_to_camera: np.ndarray, K: np.ndarray, width: int, height: int, *, near: float = NEAR, far: float = np.inf
) -> np.ndarray:
    """World to GL clip space: p_clip = clip_matrix @ p_world, with w = camera z.

    Args:
        world_to_camera: Rigid map, OpenCV axes. [4, 4]
        K: Intrinsics in pixels of a width x height image, pixel centres at +0.5. [3, 3]
        width: Image width K belongs to, px.
        height: Image height K belongs to, px.
        near: Camera z that maps to NDC depth -1, scene units.
        far: Camera z that maps to NDC depth +1, scene units. Infinite by default.
    Returns:
        float64. [4, 4]
    Raises:
        ValueError: A size is not positive, or not 0 < near < far.

    NDC x and y are -1 at the left and top borders of the image, +1 at the right and bottom ones.
    """
    return _projection(K, width, height, near=near, far=far) @ np.asarray(world_to_camera, dtype=np.float64)


def _projection(K: np.ndarray, width: int, height: int, *, near: float, far: float) -> np.ndarray:
    if width <= 0 or height <= 0:
        raise ValueError(f"image size must be positive, got {width} x {height}")
    if not 0.0 < near < far:
        raise ValueError(f"need 0 < near < far, got near {near} and far {far}")
    K = np.asarray(K, dtype=np.float64)
    to_clip = np.zeros((4, 4))
    to_clip[0, :3] = 2.0 * K[0] / width - (0.0, 0.0, 1.0)
    to_clip[1, :3] = 2.0 * K[1] / height - (0.0, 0.0, 1.0)
    # z_clip / w = -1 at near and +1 at far; written with 1/far, so that an infinite far plane needs no special case.
    near_over_far = near / far
    to_clip[2, 2] = (1.0 + near_over_far) / (1.0 - near_over_far)
    to_clip[2, 3] = -2.0 * near / (1.0 - near_over_far)
    to_clip[3, 2] = 1.0
    return to_clip


def resized_K(K: np.ndarray, size: tuple[int, int], new_size: tuple[int, int]) -> np.ndarray:
    """Intrinsics of the same camera for an image resampled to another size; each axis scales by its own ratio.

    Args:
        K: Intrinsics at `size`. [3, 3]
        size: Width and height K belongs to, px.
        new_size: Width and height wanted, px.
    Returns:
        float64. [3, 3]
    """
    ratios = np.array([new_size[0] / size[0], new_size[1] / size[1], 1.0])
    return np.asarray(K, dtype=np.float64) * ratios[:, None]


def uniform_matrix(matrix: np.ndarray) -> bytes:
    """A matrix as GLSL wants it: float32, columns one after another."""
    return np.ascontiguousarray(np.asarray(matrix, dtype=np.float32).T).tobytes()
