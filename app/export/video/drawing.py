"""One moment of the scene from one view, in colours, opacity and depth."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from app.export.scene_frames import SceneFrames
from app.export.video.views import ViewPoint
from app.playback.modes.mode_pictures import MIN_OPACITY
from engine.timing.timing import SourceMoment


@dataclass(frozen=True, slots=True, eq=False)
class Drawn:
    """A drawn picture.

    Attributes:
        color: Display-encoded, over black, so that it is multiplied with `alpha`. [H, W, 3] float32 in 0..1
        alpha: Covered share of the background. [H, W] float32 in 0..1
        depth: Along the viewing axis, scene units; NaN where next to nothing is. [H, W] float32
    """

    color: np.ndarray
    alpha: np.ndarray
    depth: np.ndarray


def draw(
    scene: SceneFrames, moment: float | Sequence[SourceMoment], view: ViewPoint, *, supersampling: int = 1
) -> Drawn:
    """Draw a moment. Looked through a camera of the capture, colours are those of the camera, otherwise the scene's.

    Args:
        moment: In frames of the capture; between frames see `SceneFrames.shares`. Of several, pictures are mixed.
        supersampling: Drawn so many times as large along both sides and reduced by means over squares.
    Raises:
        ProjectError: As `SceneFrames.gaussians`.
    """
    moments = [SourceMoment(moment)] if isinstance(moment, int | float) else moment
    shares = [
        tuple(np.float32(one.weight) * values for values in parts)
        for one in moments
        for parts in _drawn_shares(scene, one.frame, view, supersampling)
    ]
    color, alpha, weighted_depth = (np.stack(parts).sum(axis=0) for parts in zip(*shares, strict=True))
    alpha, weighted_depth = np.clip(alpha[..., 0], 0.0, 1.0), weighted_depth[..., 0]
    depth = np.full_like(alpha, np.nan)
    np.divide(weighted_depth, alpha, out=depth, where=alpha >= MIN_OPACITY)
    return Drawn(np.clip(color, 0.0, 1.0), alpha, depth)


def _drawn_shares(
    scene: SceneFrames, moment: float, view: ViewPoint, supersampling: int
) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Colours [H, W, 3], opacity [H, W, 1] and depth multiplied with it [H, W, 1] of every share, times its weight."""
    import torch

    from engine.model.host_array import host_array
    from engine.raster import rasterize

    K = view.K.copy()
    K[:2] *= supersampling  # pixel centres lie at +0.5, so everything scales alike
    for share in scene.shares(moment):
        with torch.no_grad():
            rendering = rasterize(
                share.gaussians,
                torch.from_numpy(view.world_to_camera.astype(np.float32))[None],
                torch.from_numpy(K.astype(np.float32))[None],
                view.width * supersampling,
                view.height * supersampling,
                backend=scene.opened.backend,
                near_plane=share.trained.base.header.near_plane,
                want_depth=True,
            )
        assert rendering.depth is not None
        color, alpha, weighted_depth = (
            _reduced(host_array(values[0]), supersampling)
            for values in (rendering.image, rendering.alpha, rendering.depth)
        )
        if view.camera_index is not None:
            rig = scene.opened.capture.rig
            color = share.trained.colors.in_camera(color, rig, view.camera_index, share.clip_time)
        weight = np.float32(share.weight)
        yield weight * color, weight * alpha, weight * weighted_depth


def _reduced(values: np.ndarray, n: int) -> np.ndarray:
    """Means over squares of n x n pixels. [n H, n W, C] to [H, W, C]"""
    if n == 1:
        return values
    height, width, channels = values.shape
    return values.reshape(height // n, n, width // n, n, channels).mean(axis=(1, 3), dtype=np.float32)
