"""The sound that a camera recorded, from one of the capture's frames on, piece by piece."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from av.audio.resampler import AudioResampler

from engine.capture.capture import Capture
from engine.capture.files.media import VIDEO_FAULTS, open_video, opened_video, read_frame_times
from engine.capture.frames import IndexedFrames, VideoFrames
from engine.errors import CaptureError

LEAD_S = 0.5
"""Decoding begins so much earlier: compressed sound needs some of what comes before."""
GAP_S = 0.02
"""Sound that comes later than expected by more than this is a gap, and not the rounding of times."""


def sound_source(capture: Capture, camera_index: int, frame_index: int) -> tuple[Path, float]:
    """The file with a camera's sound, and when a frame of the capture is shown in it, seconds.

    Raises:
        CaptureError: The camera has no sound, or its file cannot be read.
    """
    name = capture.rig.names[camera_index]
    source, own_index = capture.store.sources[camera_index], capture.first_frame + frame_index
    if isinstance(source, IndexedFrames):
        source, own_index = source.source, int(source.frame_indices[own_index])
    if not isinstance(source, VideoFrames):
        raise CaptureError(
            f'Camera "{name}" has no sound: its frames are image files.',
            hint="Choose another camera, or none.",
            path=source.path,
        )
    try:
        with opened_video(source.path) as container:
            has_sound = len(container.streams.audio) > 0
    except (*VIDEO_FAULTS, OSError) as error:
        raise _damaged(source.path, error) from error
    if not has_sound:
        raise CaptureError(
            f'Camera "{name}" has no sound: its file holds no sound track.',
            hint="Choose another camera, or none.",
            path=source.path,
        )
    return source.path, float(read_frame_times(source.path)[own_index])


class SoundReader:
    """Sound from a moment of a file on, in stereo. A context manager, for one thread.

    Args:
        path, start_s: From `sound_source`.
        rate: Samples per second that are wanted.
    """

    def __init__(self, path: Path, start_s: float, *, rate: int) -> None:
        self._path, self._start_s, self._rate = path, start_s, rate
        self._container: Any = None
        self._chunks: Iterator[np.ndarray] = iter(())
        self._rest = np.zeros((0, 2), np.float32)

    def __enter__(self) -> Self:
        self._container = open_video(self._path)
        self._chunks = self._decoded()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._container.close()

    def read(self, n_samples: int) -> np.ndarray:
        """The next samples; silence where there are none. [n_samples, 2] float32

        Raises:
            CaptureError: The track is damaged.
        """
        try:
            while len(self._rest) < n_samples:
                chunk = next(self._chunks, None)
                if chunk is None:
                    self._rest = np.concatenate([self._rest, np.zeros((n_samples - len(self._rest), 2), np.float32)])
                    break
                self._rest = np.concatenate([self._rest, chunk])
        except (*VIDEO_FAULTS, ValueError) as error:
            raise _damaged(self._path, error) from error
        taken, self._rest = self._rest[:n_samples], self._rest[n_samples:]
        return taken

    def _decoded(self) -> Iterator[np.ndarray]:
        """Pieces of the track without overlaps and with silence in gaps, from the start on. [S, 2] float32"""
        stream = self._container.streams.audio[0]
        self._container.seek(max(int((self._start_s - LEAD_S) / stream.time_base), 0), stream=stream)
        is_mono = stream.codec_context.layout.nb_channels == 1  # as loud on both sides: FFmpeg would halve its power
        resampler = AudioResampler(format="flt", layout="mono" if is_mono else "stereo", rate=self._rate)
        due: int | None = None  # sample that comes next, counted from the start
        for frame in self._container.decode(stream):
            at = round((float(frame.time or 0.0) - self._start_s) * self._rate)
            due = min(at, 0) if due is None else due
            if at - due > GAP_S * self._rate:
                yield from _from_start(np.zeros((at - due, 2), np.float32), due)
                due = at
            for piece in resampler.resample(frame):
                samples = _stereo(piece.to_ndarray(), is_mono=is_mono)
                yield from _from_start(samples, due)
                due += len(samples)
        if due is not None:
            for piece in resampler.resample(None):
                yield from _from_start(_stereo(piece.to_ndarray(), is_mono=is_mono), due)


def _stereo(samples: np.ndarray, *, is_mono: bool) -> np.ndarray:
    """Samples as they are packed, [1, S] or [1, 2 S], as two channels. [S, 2] float32"""
    return np.repeat(samples.reshape(-1, 1), 2, axis=1) if is_mono else samples.reshape(-1, 2)


def _from_start(samples: np.ndarray, at: int) -> Iterator[np.ndarray]:
    """The samples at or after 0, where the first of them lies at `at`."""
    kept = samples[max(-at, 0) :]
    if len(kept):
        yield kept


def _damaged(path: Path, error: Exception) -> CaptureError:
    return CaptureError(
        f"The sound track cannot be decoded ({error}).", hint="Choose another camera, or none.", path=path
    )
