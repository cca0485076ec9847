"""CapturedPictures: decoded and downsized pictures of the capture, as the cameras took them or in the scene's colours,
made on threads, kept up to a number of bytes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from PIL import Image

from app.background.latest import LatestWorker
from app.playback.modes.arrays import Picture
from app.playback.modes.hatching import hatched
from app.playback.picture_source import PictureSource
from engine.byte_cache import ByteCache
from engine.capture.capture import Capture
from engine.images.rendition import Rendition

CACHE_BYTES = 96 << 20
THUMBNAIL_WIDTH_PX = 200
"""Requests up to this width are thumbnails: answered exactly or not at all, on a separate thread."""


@dataclass(frozen=True, slots=True)
class PictureRequest:
    """One camera at one frame, at most this wide.

    Attributes:
        generation: Of the open project. Two takes with the same cameras have the same fingerprint.
        rendition: The camera's, to be undone for a picture in the scene's colours; None for the picture as it was
            taken. The picture depends on a clip's state through this alone.
    """

    generation: int
    fingerprint: str
    camera_index: int
    frame_index: int
    max_width: int
    capture: Capture = field(compare=False)
    rendition: Rendition | None = None

    @property
    def is_thumbnail(self) -> bool:
        """Whether it goes to the thread of the thumbnails."""
        return self.max_width <= THUMBNAIL_WIDTH_PX


class CapturedPictures:
    """The captured pictures. Methods are for one thread, not those it owns."""

    def __init__(self, *, cache_bytes: int = CACHE_BYTES) -> None:
        self._cache: ByteCache[PictureRequest, Picture] = ByteCache(cache_bytes)
        self._last: dict[int, Picture] = {}
        self.viewing: LatestWorker[PictureRequest, Picture] = LatestWorker("captured picture", self._compute)
        self.thumbnails: LatestWorker[PictureRequest, Picture] = LatestWorker("thumbnails", self._compute)

    def picture(
        self,
        capture: Capture,
        generation: int,
        camera_index: int,
        frame_index: int,
        max_width: int,
        rendition: Rendition | None = None,
    ) -> Picture | None:
        """The picture if it was decoded; otherwise it is asked for.

        Meanwhile the last picture of the same camera is returned as stale, except for thumbnails: None.
        """
        request = PictureRequest(
            generation, capture.fingerprint, camera_index, frame_index, max_width, capture, rendition
        )
        if request.is_thumbnail and not capture.has_pictures:
            return None
        known = self._cache.get(request)
        if known is None:
            self._worker(request).request(request)
            last = None if request.is_thumbnail else self._last.get(camera_index)
            return None if last is None else replace(last, is_stale=True)
        if not request.is_thumbnail:
            self._last[camera_index] = known
        return known

    def plan(self, requests: Sequence[PictureRequest]) -> None:
        """Decode these, in this order, while no picture is asked for: as many as can be kept."""
        missing = [request for request in requests if request not in self._cache]
        held = max((picture.image.nbytes for picture in self._last.values()), default=0)
        n_that_fit = self._cache.max_bytes // (2 * held) if held else 1  # half is for pictures shown before
        self.viewing.plan(missing[:n_that_fit])

    def _worker(self, request: PictureRequest) -> LatestWorker[PictureRequest, Picture]:
        return self.thumbnails if request.is_thumbnail else self.viewing

    def clear(self) -> None:
        """Forget everything, as when another capture was opened; pictures being decoded are dropped."""
        self.viewing.forget()
        self.thumbnails.forget()
        self._cache.clear()
        self._last.clear()

    def close(self) -> None:
        """End the threads."""
        self.viewing.close()
        self.thumbnails.close()

    def _compute(self, request: PictureRequest) -> Picture:
        known = self._cache.get(request)
        if known is not None:  # it was asked for and planned
            return known
        image = downsized(request.capture.frame(request.camera_index, request.frame_index), request.max_width)
        if request.rendition is not None:
            image = request.rendition.to_scene(image)
        valid = request.capture.valid(request.camera_index)
        if valid is not None and not request.is_thumbnail:
            image = hatched(image, valid)
        source = PictureSource(
            frame_index=request.frame_index,
            camera_index=request.camera_index,
            has_scene_colors=request.rendition is not None,
        )
        picture = Picture(image, request_key(request), source=source)
        if self._worker(request).is_still_wanted:
            self._cache.put(request, picture, picture.image.nbytes)
        return picture


def request_key(request: PictureRequest) -> tuple[int, str, int, int, int, Rendition | None]:
    """Identity of a picture."""
    return (
        request.generation,
        request.fingerprint,
        request.camera_index,
        request.frame_index,
        request.max_width,
        request.rendition,
    )


def downsized(image: np.ndarray, max_width: int) -> np.ndarray:
    """The picture at most this wide, area-filtered; never enlarged. [H, W, 3] uint8"""
    height, width = image.shape[:2]
    if width <= max_width:
        return np.ascontiguousarray(image)
    size = (max(max_width, 1), max(round(height * max_width / width), 1))
    return np.asarray(Image.fromarray(image).resize(size, Image.Resampling.BOX))
