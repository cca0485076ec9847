"""The sound of a take: that of the capture, as fast, as often and in the order in which its frames are played."""

from __future__ import annotations

from collections import OrderedDict
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np

from engine.capture.files.sound import SoundReader
from engine.timing.timing import TakeTiming

BLOCK_S, MAX_BLOCKS = 4.0, 6
"""Sound is decoded in blocks, of which so many are kept."""


class TimedSound:
    """Sound of a take, in stereo, with the pitch of its speed; nothing is heard while a frame is frozen. A context
    manager, for one thread.

    Args:
        path, start_s: From `sound_source`, of the capture's first frame.
        timing: Of the take.
        fps: Frames per second of the capture.
        first: Output frame at which the sound begins.
        rate: Samples per second that are wanted.
    """

    def __init__(self, path: Path, start_s: float, timing: TakeTiming, fps: float, first: float, *, rate: int) -> None:
        self._path, self._start_s, self._timing = path, start_s, timing
        self._fps, self._first, self._rate = fps, first, rate
        self._n_read = 0
        self._blocks: OrderedDict[int, np.ndarray] = OrderedDict()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._blocks.clear()

    def read(self, n_samples: int) -> np.ndarray:
        """The next samples; silence after the end. [n_samples, 2] float32

        Raises:
            CaptureError: The track is damaged.
        """
        samples = np.arange(self._n_read, self._n_read + n_samples + 1)
        self._n_read += n_samples
        outputs = self._first + samples * (self._fps / self._rate)
        frames, weights = self._timing.moments(outputs, is_sound=True)
        found = np.zeros((n_samples, 2), np.float32)
        for row in range(2):
            is_heard = (frames[row, 1:] != frames[row, :-1]) & (weights[row, :-1] > 0)
            if is_heard.any():
                at = frames[row, :-1][is_heard] * (self._rate / self._fps)
                found[is_heard] += weights[row, :-1][is_heard, None].astype(np.float32) * self._samples(at)
        return found

    def _samples(self, at: np.ndarray) -> np.ndarray:
        """The sound of the capture at some samples, between them too. [N] to [N, 2] float32"""
        size = round(BLOCK_S * self._rate)
        places = np.floor(at / size).astype(np.int64)
        found = np.zeros((len(at), 2), np.float32)
        for place in np.unique(places).tolist():
            here = places == place
            block = self._block(place, size)
            inside = at[here] - place * size
            whole = np.floor(inside).astype(np.int64)
            share = (inside - whole).astype(np.float32)[:, None]
            found[here] = block[whole] * (1 - share) + block[whole + 1] * share
        return found

    def _block(self, place: int, size: int) -> np.ndarray:
        if place in self._blocks:
            self._blocks.move_to_end(place)
        else:
            with SoundReader(self._path, self._start_s + place * BLOCK_S, rate=self._rate) as reader:
                self._blocks[place] = reader.read(size + 1)
            while len(self._blocks) > MAX_BLOCKS:
                self._blocks.popitem(last=False)
        return self._blocks[place]
