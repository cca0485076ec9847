"""Renderer: the rasterizer's pictures of Gaussians from views, made on a separate thread. The newest request of each
view wins, pictures are kept up to a number of bytes, and some are made ahead.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from app.background.kernels import prepare_drawing
from app.background.latest import LatestWorker, nothing
from app.playback.frame_decoder import FrameKey, ShownFrame
from app.playback.modes.arrays import BACKGROUND, GaussianArrays, Picture
from app.playback.modes.mode_arrays import drawn_arrays
from app.playback.modes.view_modes import MODES, PLAIN, ShownAs, range_of
from app.playback.picture_source import PictureSource
from app.playback.views.orbit_view import OrbitView
from engine.backends.table import process_backend
from engine.byte_cache import ByteCache

if TYPE_CHECKING:
    from engine.backends.backend import Backend
    from engine.raster import Gaussians

CACHE_BYTES = 256 << 20
"""Finished pictures kept in memory."""


@dataclass(frozen=True, slots=True)
class RenderView:
    """Viewpoint, lens, size and mode of a picture, regardless of its contents.

    Attributes:
        key: Of the view, regardless of size; see OrbitView.look_key.
        shown_as: The meaning of its colours, and the part of the clip.
        value_range: Of the numbers that its colours stand for.
        near: Nothing nearer than this is drawn, regardless of the scene; see OrbitView.near.
        set_back: How much farther away the camera stands than it seems to; see OrbitView.set_back.
    """

    key: Hashable
    width: int
    height: int
    shown_as: ShownAs = PLAIN
    value_range: tuple[float, float] = field(default=(0.0, 1.0), compare=False)
    camera_index: int | None = field(default=None, compare=False)
    world_to_camera: np.ndarray = field(default_factory=lambda: np.eye(4), compare=False)
    K: np.ndarray = field(default_factory=lambda: np.eye(3), compare=False)
    near: float = field(default=0.0, compare=False)
    set_back: float = field(default=0.0, compare=False)

    @classmethod
    def of(cls, view: OrbitView, width: int, height: int, *, shown_as: ShownAs = PLAIN) -> RenderView:
        """As a view is now."""
        value_range = range_of(shown_as.mode, view.rig)
        matrices = view.world_to_camera(), view.K(width, height)
        return cls(
            view.look_key, width, height, shown_as, value_range, view.look_through, *matrices, view.near, view.set_back
        )

    def in_size(self, view: OrbitView, width: int, height: int) -> RenderView:
        """The same in another size; view is the one it was made of."""
        if (width, height) == (self.width, self.height):
            return self
        return replace(self, width=width, height=height, K=view.K(width, height))


PictureKey = tuple[FrameKey, RenderView]


@dataclass(frozen=True, slots=True)
class RenderRequest:
    """A frame, looked at. Equal requests give equal pictures."""

    frame_key: FrameKey
    look: RenderView
    shown: ShownFrame = field(compare=False)

    @property
    def key(self) -> PictureKey:
        """Identity of the picture."""
        return self.frame_key, self.look

    @property
    def source(self) -> PictureSource:
        """The source of the picture."""
        look, source = self.look, self.shown.gaussians.source
        return replace(source, camera_index=look.camera_index, look=look.key, shown_as=look.shown_as)


class Renderer:
    """Pictures on demand. Methods are for one thread, not the one it owns."""

    def __init__(self, *, cache_bytes: int = CACHE_BYTES) -> None:
        self.on_picture: Callable[[], None] = nothing
        self._cache: ByteCache[PictureKey, Picture] = ByteCache(cache_bytes)
        self.worker: LatestWorker[RenderRequest, Picture] = LatestWorker(
            "renderer", self._compute, prepare=prepare_drawing, on_done=lambda: self.on_picture()
        )
        self._asked: dict[Hashable, RenderRequest] = {}
        self._taken_up: dict[Hashable, object] = {}
        self._last_pictures: dict[Hashable, Picture] = {}

    def known(self, frame_key: FrameKey, look: RenderView, *, view_id: Hashable = 0) -> Picture | None:
        """A finished picture; nothing is asked for."""
        picture = self._cache.get((frame_key, look))
        if picture is not None:
            self._last_pictures[view_id] = picture
            self._asked.pop(view_id, None)
        return picture

    def picture(self, key: FrameKey, shown: ShownFrame, look: RenderView, *, view_id: Hashable = 0) -> Picture | None:
        """The picture if it is ready; otherwise it is asked for, and the view's newest one is returned as stale.

        Args:
            key: Of the frame.
            view_id: Of the place where it is shown: each has one newest request.
        """
        known = self.known(key, look, view_id=view_id)
        if known is not None:
            return known
        request = RenderRequest(key, look, shown)
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

    def is_ready(self, frame_key: FrameKey, look: RenderView) -> bool:
        """Whether a picture can be shown at once."""
        return (frame_key, look) in self._cache

    def ready_keys(self) -> list[FrameKey]:
        """Frames with a picture in any look."""
        return list({frame_key for frame_key, _ in self._cache.keys()})  # noqa: SIM118 - a cache, not a dict

    @property
    def revision(self) -> int:
        """Another number whenever other pictures are ready."""
        return self._cache.revision

    def n_that_fit(self, look: RenderView) -> int:
        """Number of pictures of a size that can be kept."""
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
        picture = render(request, process_backend())
        if self.worker.is_still_wanted:
            n_bytes = picture.image.nbytes + (0 if picture.values is None else picture.values.nbytes)
            self._cache.put(request.key, picture, n_bytes)
        return picture


def render(request: RenderRequest, backend: Backend) -> Picture:
    """Rasterize one request over BACKGROUND. Runs on the renderer's thread, or wherever no window waits."""
    started_s = time.perf_counter()
    mode = MODES[request.look.shown_as.mode]
    arrays, values = drawn_arrays(request.shown, mode.name), None
    if mode.is_picture:
        image, values = _numbers(arrays, request.look, backend)
    else:
        image = _colors(arrays, request.look, backend)
    duration_s = time.perf_counter() - started_s
    return Picture(image, request.key, duration_s=duration_s, source=request.source, values=values)


def _colors(arrays: GaussianArrays, look: RenderView, backend: Backend) -> np.ndarray:
    """[H, W, 3] uint8"""
    import torch

    from engine.raster import rasterize

    with torch.no_grad():
        rendering = rasterize(
            _gaussians(arrays, look).to(backend.device, backend.dtype),
            torch.from_numpy(look.world_to_camera.astype(np.float32))[None],
            torch.from_numpy(look.K.astype(np.float32))[None],
            look.width,
            look.height,
            backend=backend,
            background=torch.tensor(BACKGROUND),
            near_plane=max(arrays.near_plane, look.near),
        )
        return (rendering.image[0].clamp(0.0, 1.0) * 255.0 + 0.5).to(torch.uint8).cpu().numpy()


def _numbers(arrays: GaussianArrays, look: RenderView, backend: Backend) -> tuple[np.ndarray, np.ndarray | None]:
    """Picture and values, see app.playback.modes.mode_pictures."""
    import torch

    from app.playback.modes.mode_pictures import mode_picture
    from engine.raster.pinhole_view import pinhole_views

    poses, Ks = (torch.from_numpy(m.astype(np.float32))[None] for m in (look.world_to_camera, look.K))
    (view,) = pinhole_views(poses, Ks, look.width, look.height, max(arrays.near_plane, look.near))
    return mode_picture(
        look.shown_as.mode, _gaussians(arrays, look), view, look.value_range, look.set_back, backend=backend
    )


def _gaussians(arrays: GaussianArrays, look: RenderView) -> Gaussians:
    """Sorted by depth where it is seen from so far away that its depths in float32 are too coarse to sort by: the
    rasterizer keeps the order of equal ones."""
    import torch

    from engine.raster import Gaussians

    columns = (arrays.means, arrays.quats, arrays.scales, arrays.opacities, arrays.colors)
    order = slice(None)
    if look.set_back > 0.0:
        order = np.argsort(arrays.means @ look.world_to_camera[2, :3].astype(np.float32), kind="stable")
    return Gaussians(*(torch.from_numpy(column[order]) for column in columns))
