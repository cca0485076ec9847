"""Renderer: the rasterizer's picture of Gaussians from a view, made on a thread of its own; the newest request wins."""

from __future__ import annotations

import time
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from app.background.kernels import prepare_drawing
from app.background.latest import LatestWorker
from app.playback.arrays import BACKGROUND, GaussianArrays, Picture
from app.playback.orbit_view import OrbitView
from app.playback.picture_source import PictureSource
from app.playback.view_modes import MODES, PLAIN, ShownAs, range_of
from engine.backends.table import backend_called

if TYPE_CHECKING:
    from engine.raster import Gaussians


@dataclass(frozen=True, slots=True)
class RenderRequest:
    """Gaussians from a view at a size. Equal requests give equal pictures.

    Attributes:
        source: What the picture will be of, and in which mode.
        value_range: Of the numbers that its colours stand for.
    """

    gaussians_key: object
    view_bytes: bytes
    width: int
    height: int
    source: PictureSource
    value_range: tuple[float, float]
    gaussians: GaussianArrays = field(compare=False)
    world_to_camera: np.ndarray = field(compare=False)
    K: np.ndarray = field(compare=False)


class Renderer:
    """Pictures on demand. Methods are for one thread, not the one it owns."""

    def __init__(self) -> None:
        self.worker: LatestWorker[RenderRequest, Picture] = LatestWorker("renderer", render, prepare=prepare_drawing)
        self._asked: RenderRequest | None = None

    def picture(
        self, gaussians: GaussianArrays, view: OrbitView, width: int, height: int, shown_as: ShownAs = PLAIN
    ) -> Picture | None:
        """The picture if it is ready; otherwise it is asked for, and the newest one is returned as stale.

        Its key is that of the Gaussians, so it differs between projects as theirs does.

        Args:
            shown_as: Of the Gaussians. The picture is one of numbers where its mode is.
        """
        world_to_camera, K = view.world_to_camera(), view.K(width, height)
        view_bytes = np.concatenate([world_to_camera.ravel(), K.ravel()]).astype(np.float64).tobytes()
        source = gaussians.source  # a mode that is a picture of numbers is a matter of drawing alone
        drawn_as = (
            ShownAs(shown_as.mode, source.shown_as.content) if MODES[shown_as.mode].is_picture else source.shown_as
        )
        request = RenderRequest(
            gaussians.key,
            view_bytes,
            width,
            height,
            replace(source, camera_index=view.look_through, look=view.look_key, shown_as=drawn_as),
            range_of(shown_as.mode, view.rig),
            gaussians,
            world_to_camera,
            K,
        )
        self._asked = request
        newest = self.worker.newest
        if newest is not None and newest[0] == request:
            return newest[1]
        self.worker.request(request)
        return None if newest is None else replace(newest[1], is_stale=True)

    @property
    def has_failed(self) -> bool:
        """Whether the picture asked for last could not be drawn, so that it is not on its way."""
        return self._asked is not None and self.worker.has_failed(self._asked)

    def clear(self) -> None:
        """Forget the last picture, and the one that is being drawn."""
        self.worker.forget()
        self._asked = None

    def close(self) -> None:
        """End the thread."""
        self.worker.close()


def render(request: RenderRequest) -> Picture:
    """Rasterize one request over BACKGROUND. Runs on the renderer's thread, or wherever no window waits."""
    import torch

    from engine.raster import Gaussians

    started_s = time.perf_counter()
    arrays, mode = request.gaussians, MODES[request.source.shown_as.mode]
    gaussians = Gaussians(
        *(torch.from_numpy(a) for a in (arrays.means, arrays.quats, arrays.scales, arrays.opacities, arrays.colors))
    )
    image, values = _numbers(request, gaussians) if mode.is_picture else (_colors(request, gaussians), None)
    key = (arrays.key, request.view_bytes, request.width, request.height, mode.name)
    duration_s = time.perf_counter() - started_s
    return Picture(image, key, duration_s=duration_s, source=request.source, values=values)


def _colors(request: RenderRequest, gaussians: Gaussians) -> np.ndarray:
    """[H, W, 3] uint8"""
    import torch

    from engine.raster import rasterize

    with torch.no_grad():
        rendering = rasterize(
            gaussians,
            torch.from_numpy(request.world_to_camera.astype(np.float32))[None],
            torch.from_numpy(request.K.astype(np.float32))[None],
            request.width,
            request.height,
            backend=backend_called(),
            background=torch.tensor(BACKGROUND),
            near_plane=request.gaussians.near_plane,
        )
        return (rendering.image[0].clamp(0.0, 1.0) * 255.0 + 0.5).to(torch.uint8).numpy()


def _numbers(request: RenderRequest, gaussians: Gaussians) -> tuple[np.ndarray, np.ndarray | None]:
    """Picture and values, see app.playback.mode_pictures."""
    import torch

    from app.playback.mode_pictures import mode_picture
    from engine.raster.pinhole_view import pinhole_views

    poses, Ks = (torch.from_numpy(m.astype(np.float32))[None] for m in (request.world_to_camera, request.K))
    (view,) = pinhole_views(poses, Ks, request.width, request.height, request.gaussians.near_plane)
    return mode_picture(request.source.shown_as.mode, gaussians, view, request.value_range)
