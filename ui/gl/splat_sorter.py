"""Depth order of splats, exact, at once or on a thread where the newest request wins. Knows no GL.

Exact because 16-bit depth keys cost 47 dB instead of 130 in a scene with a far background; a stale exact order of a
view some degrees away costs less than that, and only for a frame or two.
"""

from __future__ import annotations

import threading
from collections.abc import Hashable
from dataclasses import dataclass

import numpy as np

_LOW_32_BITS = np.uint64(0xFFFFFFFF)
CLOSE_TIMEOUT_S = 5.0


def depth_order(means: np.ndarray, view_row: np.ndarray, near: float) -> np.ndarray:
    """Rows in front of the near plane, farthest first; equal depths are the reverse of the row order.

    Reverse, so that drawing back to front composites exactly what a stable front-to-back rasterizer does.

    Args:
        means: Centres, world space, finite. [N, 3] float32
        view_row: Third row of world_to_camera: camera z = view_row[:3] . p + view_row[3]. [4]
        near: Rows with camera z not above this are left out, scene units, >= 0.
    Returns:
        Row numbers. [M] uint32, M <= N
    """
    row = np.asarray(view_row, dtype=np.float32)
    depths = means @ row[:3] + row[3]  # [N]
    visible = np.flatnonzero(depths > np.float32(max(near, 0.0)))
    # Positive floats sort like their bit patterns, so depth and row number pack into one integer that an in-place
    # sort without an index array handles: several times faster than argsort.
    keys = depths[visible].view(np.uint32).astype(np.uint64)
    keys <<= np.uint64(32)
    keys |= visible.astype(np.uint64)
    keys.sort()
    return (keys & _LOW_32_BITS).astype(np.uint32)[::-1].copy()


@dataclass(frozen=True, slots=True)
class DepthOrder:
    """A finished order.

    Attributes:
        key: What was asked for.
        ids: Row numbers, farthest first. [M] uint32
    """

    key: Hashable
    ids: np.ndarray


@dataclass(frozen=True, slots=True)
class _Request:
    key: Hashable
    means: np.ndarray
    view_row: np.ndarray
    near: float

    def answer(self) -> DepthOrder:
        return DepthOrder(self.key, depth_order(self.means, self.view_row, self.near))


class SplatSorter:
    """Answers order requests on one thread of its own; a newer request replaces one that has not begun.

    Owns the thread, which starts with the first request. The sort itself runs without the interpreter lock.
    """

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._waiting: _Request | None = None
        self._is_sorting = False
        self._is_closing = False
        self._latest: DepthOrder | None = None
        self._failure: BaseException | None = None
        self._thread: threading.Thread | None = None

    @property
    def is_busy(self) -> bool:
        """Is an order still to come?"""
        with self._changed:
            return self._waiting is not None or self._is_sorting

    def request(self, key: Hashable, means: np.ndarray, view_row: np.ndarray, near: float) -> None:
        """Ask for an order; returns at once. Arguments as for depth_order; `means` must not change afterwards.

        Raises:
            RuntimeError: The sorter was released.
        """
        with self._changed:
            if self._is_closing:
                raise RuntimeError("SplatSorter.request after release()")
            self._waiting = _Request(key, means, np.array(view_row, dtype=np.float32), near)
            if self._thread is None:
                self._thread = threading.Thread(target=self._run, name="splat-sorter", daemon=True)
                self._thread.start()
            self._changed.notify_all()

    def latest(self) -> DepthOrder | None:
        """The newest finished order, or None before the first one. Raises what a sort raised, once."""
        with self._changed:
            failure, self._failure = self._failure, None
            if failure is not None:
                raise failure
            return self._latest

    def wait(self, timeout_s: float) -> DepthOrder | None:
        """The newest order once nothing is left to sort.

        Raises:
            TimeoutError: Still busy after timeout_s.
        """
        with self._changed:
            if not self._changed.wait_for(lambda: self._waiting is None and not self._is_sorting, timeout_s):
                raise TimeoutError(f"the depth sort was not done after {timeout_s:g} s")
        return self.latest()

    def release(self) -> None:
        """End the thread; a sort that runs is finished first, one that waits is dropped."""
        with self._changed:
            self._is_closing = True
            self._waiting = None
            thread, self._thread = self._thread, None
            self._changed.notify_all()
        if thread is not None:
            thread.join(CLOSE_TIMEOUT_S)

    def _run(self) -> None:
        while True:
            with self._changed:
                self._is_sorting = False
                self._changed.notify_all()
                self._changed.wait_for(lambda: self._waiting is not None or self._is_closing)
                if self._is_closing:
                    return
                request, self._waiting, self._is_sorting = self._waiting, None, True
            assert request is not None
            try:
                order, failure = request.answer(), None
            except Exception as error:  # noqa: BLE001 - edge of a thread: handed to whoever asks next
                order, failure = None, error
            with self._changed:
                self._failure = failure
                if order is not None:
                    self._latest = order
