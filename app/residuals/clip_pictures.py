"""ClipPictures: renders and captured pictures of cameras as an evaluation compares them. Kept up to a number of bytes.

Shared by threads: clips loaded for playback are used, others are loaded here, a few at a time.
"""

from __future__ import annotations

import threading
import time
from collections import OrderedDict
from typing import TYPE_CHECKING

import numpy as np

from app.playback.frame_decoder import ClipFiles, FrameDecoder, FrameRequest, ModelKey
from engine.backends.table import process_backend
from engine.byte_cache import ByteCache
from engine.capture.capture import Capture
from engine.errors import ProjectError

if TYPE_CHECKING:
    from engine.metrics.clips.trained_clip import TrainedClip  # brings torch, which only the threads need

MAX_CLIPS = 3
"""Loaded here: two neighbours and one more. Clips that playback has loaded come on top, and cost nothing."""
CACHE_BYTES = 64 << 20
"""Renders as floats: the frame before, and the same frame for another kind of map, are mostly there."""
DECODER_WAIT_S = 1.0
"""Playback may be loading the very clip: to load it twice at the same time takes longer than to wait for it."""

_PictureKey = tuple[ModelKey, int, float]


class ClipPictures:
    """Pictures of the open project.

    Args:
        decoder: Of the playback; its loaded clips are used.
    """

    def __init__(self, decoder: FrameDecoder) -> None:
        self._decoder = decoder
        self._lock = threading.Lock()
        self._files = ClipFiles()
        self._clips: OrderedDict[ModelKey, TrainedClip] = OrderedDict()
        self._renders: ByteCache[_PictureKey, np.ndarray] = ByteCache(CACHE_BYTES)

    def clear(self) -> None:
        """Forget everything, as when another project is opened."""
        with self._lock:
            self._clips.clear()
            self._files = ClipFiles()
        self._renders.clear()

    def trained(self, request: FrameRequest) -> TrainedClip:
        """The clip of a request as cameras see it.

        Raises:
            ProjectError: Its file is missing or damaged, or lacks the colours of the cameras.
        """
        known = self._of_playback(request)
        if known is not None:
            return known
        with self._lock:
            known = self._clips.get(request.model_key)
            if known is None:
                known = self._files.read(request, process_backend()).trained
                if known is None:
                    raise ProjectError(
                        f"Clip {request.clip_index} does not hold the cameras' colours.",
                        hint="Train this clip again.",
                        path=request.path,
                    )
                self._keep(request, known)
            return known

    def _of_playback(self, request: FrameRequest) -> TrainedClip | None:
        """The clip as playback has it, after waiting for it where that is reading it right now."""
        until_s = time.monotonic() + DECODER_WAIT_S
        while self._decoder.is_loading(request) and time.monotonic() < until_s:
            time.sleep(0.005)
        loaded = self._decoder.loaded(request)
        return None if loaded is None else loaded.trained

    def _keep(self, request: FrameRequest, trained: TrainedClip) -> None:
        for key in [key for key in self._clips if key[2] == request.clip_index]:  # an earlier state of it
            del self._clips[key]
        while len(self._clips) >= MAX_CLIPS:
            self._clips.popitem(last=False)
        self._clips[request.model_key] = trained

    def render(self, capture: Capture, request: FrameRequest, camera_index: int, clip_time: float) -> np.ndarray:
        """A camera's picture of a clip in its own colours, as it is compared: black where the camera sees nothing.

        Returns:
            [H, W, 3] float32 in 0..1
        Raises:
            ProjectError: See `trained`.
        """
        from engine.metrics.pictures.colors import as_shown

        key = (request.model_key, camera_index, clip_time)
        known = self._renders.get(key)
        if known is None:
            trained = self.trained(request)
            known = as_shown(trained.picture(capture.rig, camera_index, clip_time), "float")
            valid = capture.valid(camera_index)
            known = known if valid is None else np.where(valid[..., None], known, np.float32(0.0))
            self._renders.put(key, known, known.nbytes)
        return known

    def frame(self, capture: Capture, request: FrameRequest, camera_index: int) -> np.ndarray:
        """`render` of the frame that a request names."""
        return self.render(capture, request, camera_index, request.clip.clip_time(request.frame_index))


def captured(capture: Capture, camera_index: int, frame_index: int) -> np.ndarray:
    """The captured picture. [H, W, 3] float32 in 0..1

    Raises:
        CaptureError: The file is missing or damaged.
    """
    return capture.frame(camera_index, frame_index).astype(np.float32) / np.float32(255.0)
