"""Renderer: the rasterizer's pictures of Gaussians from views, made on a thread of its own. The newest request of each
view wins, pictures are kept up to a number of bytes, and some are made ahead.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from app.background.kernels import prepare_drawing
from app.background.latest import LatestWorker
from app.playback.arrays import BACKGROUND, GaussianArrays, Picture
from app.playback.frame_decoder import FrameKey
from app.playback.orbit_view import OrbitView
from app.playback.picture_source import PictureSource
from engine.backends.table import backend_called
from engine.byte_cache import ByteCache

CACHE_BYTES = 256 << 20
"""Finished pictures kept in memory."""
COLOR = "color"


@dataclass(frozen=True, slots=True)
class Look:
    """From where, through which lens, how large and how something is drawn, whatever it is of.

    Attributes:
        key: Of the view, whatever the size; see OrbitView.look_key.
        mode: How it is drawn.
    """

    key: Hashable
    width: int
    height: int
    mode: Hashable = COLOR
    camera_index: int | None = field(default=None, compare=False)
    world_to_camera: np.ndarray = field(default_factory=lambda: np.eye(4), compare=False)
    K: np.ndarray = field(default_factory=lambda: np.eye(3), compare=False)

    @classmethod
    def of(cls, view: OrbitView, width: int, height: int, *, mode: Hashable = COLOR) -> Look:
        """As a view is now."""
        return cls(view.look_key, width, height, mode, view.look_through, view.world_to_camera(), view.K(width, height))


PictureKey = tuple[FrameKey, Look]


@dataclass(frozen=True, slots=True)
class RenderRequest:
    """Gaussians, looked at. Equal requests give equal pictures."""

    gaussians_key: FrameKey
    look: Look
    gaussians: GaussianArrays = field(compare=False)

    @property
    def key(self) -> PictureKey:
        """Identity of the picture."""
        return self.gaussians_key, self.look

    @property
    def source(self) -> PictureSource:
        """What the picture is of."""
        return replace(self.gaussians.source, camera_index=self.look.camera_index, look=self.look.key)


class Renderer:
    """Pictures on demand. Methods are for one thread, not the one it owns."""

    def __init__(self, *, cache_bytes: int = CACHE_BYTES) -> None:
        self._cache: ByteCache[PictureKey, Picture] = ByteCache(cache_bytes)
        self.worker: LatestWorker[RenderRequest, Picture] = LatestWorker(
            "renderer", self._compute, prepare=prepare_drawing
        )
        self._asked: dict[Hashable, RenderRequest] = {}
        self._taken_up: dict[Hashable, object] = {}
        self._last_pictures: dict[Hashable, Picture] = {}

    def known(self, gaussians_key: FrameKey, look: Look, *, view_id: Hashable = 0) -> Picture | None:
        """A finished picture; nothing is asked for."""
        picture = self._cache.get((gaussians_key, look))
        if picture is not None:
            self._last_pictures[view_id] = picture
            self._asked.pop(view_id, None)
        return picture

    def picture(self, key: FrameKey, gaussians: GaussianArrays, look: Look, *, view_id: Hashable = 0) -> Picture | None:
        """The picture if it is ready; otherwise it is asked for, and the view's newest one is returned as stale.

        Args:
            key: Of the Gaussians.
            view_id: Of the place where it is shown: each has one newest request.
        """
        known = self.known(key, look, view_id=view_id)
        if known is not None:
            return known
        request = RenderRequest(key, look, gaussians)
        self._asked[view_id] = request
        self.worker.request(request, lane=view_id)
        return self.newest(view_id)

    def newest(self, view_id: Hashable = 0) -> Picture | None:
        """The picture of a view that was finished last, as stale; None before the first."""
        finished = self.worker.newest_in(view_id)
        if finished is not None and finished is not self._taken_up.get(view_id):  # a kept one may have been newer
            self._taken_up[view_id] = finished
            self._last_pictures[view_id] = finished[1]
        last = self._last_pictures.get(view_id)
        return None if last is None else replace(last, is_stale=True)

    def is_ready(self, gaussians_key: FrameKey, look: Look) -> bool:
        """Whether a picture can be shown at once."""
        return (gaussians_key, look) in self._cache

    def ready_keys(self) -> list[FrameKey]:
        """Frames of which there is a picture, whatever it looks like."""
        keys = self._cache.keys()
        return list({gaussians_key for gaussians_key, _ in keys})

    @property
    def revision(self) -> int:
        """Another number whenever other pictures are ready."""
        return self._cache.revision

    def n_that_fit(self, look: Look) -> int:
        """How many pictures of a size can be kept."""
        return max(self._cache.max_bytes // (3 * look.width * look.height), 1)

    def plan(self, requests: Sequence[RenderRequest], distance: Callable[[PictureKey], float]) -> None:
        """Draw these, in this order, while nothing is asked for.

        Args:
            distance: How far off it is that a picture is shown; the farthest go when memory is needed.
        """
        self._cache.distance = distance
        self.worker.plan([request for request in requests if request.key not in self._cache])

    def has_failed(self, view_id: Hashable = 0) -> bool:
        """Whether the picture a view asked for last could not be drawn, so that it is not on its way."""
        asked = self._asked.get(view_id)
        return asked is not None and self.worker.has_failed(asked)

    def clear(self) -> None:
        """Forget all pictures, and the one that is being drawn."""
        self.worker.forget()
        self._cache.clear()
        self._asked, self._taken_up, self._last_pictures = {}, {}, {}

    def close(self) -> None:
        """End the thread."""
        self.worker.close()

    def _compute(self, request: RenderRequest) -> Picture:
        known = self._cache.get(request.key)
        if known is not None:  # it was asked for and planned, or by two views
            return known
        picture = render(request)
        if self.worker.is_still_wanted:
            self._cache.put(request.key, picture, picture.image.nbytes)
        return picture


def render(request: RenderRequest) -> Picture:
    """Rasterize one request over BACKGROUND. Runs on the renderer's thread, or wherever no window waits."""
    import torch

    from engine.raster import Gaussians, rasterize

    started_s = time.perf_counter()
    arrays, look = request.gaussians, request.look
    gaussians = Gaussians(
        *(torch.from_numpy(a) for a in (arrays.means, arrays.quats, arrays.scales, arrays.opacities, arrays.colors))
    )
    with torch.no_grad():
        rendering = rasterize(
            gaussians,
            torch.from_numpy(look.world_to_camera.astype(np.float32))[None],
            torch.from_numpy(look.K.astype(np.float32))[None],
            look.width,
            look.height,
            backend=backend_called(),
            background=torch.tensor(BACKGROUND),
            near_plane=arrays.near_plane,
        )
        image = (rendering.image[0].clamp(0.0, 1.0) * 255.0 + 0.5).to(torch.uint8).numpy()
    return Picture(image, request.key, duration_s=time.perf_counter() - started_s, source=request.source)
