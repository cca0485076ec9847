"""One moment of the scene from one view, in colours, opacity and depth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from app.export.scene_frames import SceneFrames
from app.export.video.views import ViewPoint
from app.playback.mode_pictures import MIN_OPACITY
from engine.backends.table import backend_called


@dataclass(frozen=True, slots=True, eq=False)
class Drawn:
    """What is seen.

    Attributes:
        color: Display-encoded, over black, so that it is multiplied with `alpha`. [H, W, 3] float32 in 0..1
        alpha: How much of what lies behind is covered. [H, W] float32 in 0..1
        depth: Along the viewing axis, scene units; NaN where next to nothing is. [H, W] float32
    """

    color: np.ndarray
    alpha: np.ndarray
    depth: np.ndarray


def draw(scene: SceneFrames, moment: float, view: ViewPoint, *, supersampling: int = 1) -> Drawn:
    """Draw a moment. Looked through a camera of the capture, colours are those of the camera, otherwise the scene's.

    Args:
        moment: In frames of the capture, between frames too.
        supersampling: Drawn so many times as large along both sides and reduced by means over squares.
    Raises:
        ProjectError: What `SceneFrames.gaussians` raises.
    """
    import torch

    from engine.raster import rasterize

    trained = scene.trained(moment)
    K = view.K.copy()
    K[:2] *= supersampling  # pixel centres lie at +0.5, so everything scales alike
    with torch.no_grad():
        rendering = rasterize(
            scene.gaussians(moment),
            torch.from_numpy(view.world_to_camera.astype(np.float32))[None],
            torch.from_numpy(K.astype(np.float32))[None],
            view.width * supersampling,
            view.height * supersampling,
            backend=backend_called(),
            near_plane=trained.base.header.near_plane,
            want_depth=True,
        )
    assert rendering.depth is not None
    color, alpha, weighted_depth = (
        _reduced(values[0].numpy(), supersampling) for values in (rendering.image, rendering.alpha, rendering.depth)
    )
    alpha, weighted_depth = np.clip(alpha[..., 0], 0.0, 1.0), weighted_depth[..., 0]
    is_seen = alpha >= MIN_OPACITY
    depth = np.full_like(alpha, np.nan)
    np.divide(weighted_depth, alpha, out=depth, where=is_seen)
    if view.camera_index is not None:
        rig = scene.opened.capture.rig
        color = trained.colors.in_camera(color, rig, view.camera_index, scene.clip_time(moment))
    return Drawn(np.clip(color, 0.0, 1.0), alpha, depth)


def _reduced(values: np.ndarray, n: int) -> np.ndarray:
    """Means over squares of n x n pixels. [n H, n W, C] to [H, W, C]"""
    if n == 1:
        return values
    height, width, channels = values.shape
    return values.reshape(height // n, n, width // n, n, channels).mean(axis=(1, 3), dtype=np.float32)
