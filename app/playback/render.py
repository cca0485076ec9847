"""Renderer: the rasterizer's picture of Gaussians from a view, made on a thread of its own; the newest request wins."""

from __future__ import annotations

import time
from dataclasses import dataclass, field, replace

import numpy as np

from app.background.kernels import prepare_drawing
from app.background.latest import LatestWorker
from app.playback.arrays import BACKGROUND, GaussianArrays, Picture
from app.playback.orbit_view import OrbitView
from app.playback.picture_source import PictureSource
from engine.backends.table import backend_called


@dataclass(frozen=True, slots=True)
class RenderRequest:
    """Gaussians from a view at a size. Equal requests give equal pictures.

    Attributes:
        source: What the picture will be of.
        near: Nothing nearer than this is drawn, scene units.
    """

    gaussians_key: object
    view_bytes: bytes
    width: int
    height: int
    source: PictureSource
    gaussians: GaussianArrays = field(compare=False)
    world_to_camera: np.ndarray = field(compare=False)
    K: np.ndarray = field(compare=False)
    near: float = 0.0


class Renderer:
    """Pictures on demand. Methods are for one thread, not the one it owns."""

    def __init__(self) -> None:
        self.worker: LatestWorker[RenderRequest, Picture] = LatestWorker("renderer", render, prepare=prepare_drawing)
        self._asked: RenderRequest | None = None

    def picture(self, gaussians: GaussianArrays, view: OrbitView, width: int, height: int) -> Picture | None:
        """The picture if it is ready; otherwise it is asked for, and the newest one is returned as stale.

        Its key is that of the Gaussians, so it differs between projects as theirs does.
        """
        world_to_camera, K = view.world_to_camera(), view.K(width, height)
        view_bytes = np.concatenate([world_to_camera.ravel(), K.ravel()]).astype(np.float64).tobytes()
        request = RenderRequest(
            gaussians.key,
            view_bytes,
            width,
            height,
            replace(gaussians.source, camera_index=view.look_through, look=view.look_key),
            gaussians,
            world_to_camera,
            K,
            view.near,
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

    from engine.raster import Gaussians, rasterize

    started_s = time.perf_counter()
    arrays = request.gaussians
    order = slice(None)
    if request.near > 0.0:  # seen from far away: float32 depths are too coarse to sort by, ties keep the order
        order = np.argsort(arrays.means @ request.world_to_camera[2, :3].astype(np.float32), kind="stable")
    columns = (arrays.means, arrays.quats, arrays.scales, arrays.opacities, arrays.colors)
    gaussians = Gaussians(*(torch.from_numpy(column[order]) for column in columns))
    with torch.no_grad():
        rendering = rasterize(
            gaussians,
            torch.from_numpy(request.world_to_camera.astype(np.float32))[None],
            torch.from_numpy(request.K.astype(np.float32))[None],
            request.width,
            request.height,
            backend=backend_called(),
            background=torch.tensor(BACKGROUND),
            near_plane=max(arrays.near_plane, request.near),
        )
        image = (rendering.image[0].clamp(0.0, 1.0) * 255.0 + 0.5).to(torch.uint8).numpy()
    key = (arrays.key, request.view_bytes, request.width, request.height)
    return Picture(image, key, duration_s=time.perf_counter() - started_s, source=request.source)
