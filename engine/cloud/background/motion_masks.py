"""MotionMasks: which pixels of a clip's pictures move, a bit each.

36 cameras of 1920 x 1080 and 60 frames are 560 MB like this, and 4.5 GB as bytes. Letters: M frames, C cameras.
"""

from __future__ import annotations

import numpy as np


class MotionMasks:
    """Flags of all pictures of a clip, written camera by camera, read frame by frame.

    Args:
        n_frames, n_cameras, height, width: Of the pictures. Nothing moves at first.
    """

    def __init__(self, n_frames: int, n_cameras: int, height: int, width: int) -> None:
        self.shape = n_frames, n_cameras, height, width
        self._packed = np.zeros((n_frames, n_cameras, height, -(-width // 8)), np.uint8)

    @classmethod
    def of(cls, flags: np.ndarray) -> MotionMasks:
        """Those of an array. [M, C, H, W] bool"""
        masks = cls(*flags.shape)
        masks._packed[:] = np.packbits(flags, axis=-1)
        return masks

    def put_camera(self, camera_row: int, packed: np.ndarray) -> None:
        """Those of one camera, packed by numpy.packbits along the last axis. [M, H, ceil(W / 8)] uint8"""
        self._packed[:, camera_row] = packed

    def of_frame(self, frame_in_clip: int) -> np.ndarray:
        """[C, H, W] bool"""
        return self._flags(self._packed[frame_in_clip])

    def of_camera(self, camera_row: int) -> np.ndarray:
        """[M, H, W] bool"""
        return self._flags(self._packed[:, camera_row])

    @property
    def share(self) -> float:
        """Share of all pixels that move."""
        n_set = sum(int(np.bitwise_count(frame).sum()) for frame in self._packed)
        return n_set / max(int(np.prod(self.shape)), 1)

    def _flags(self, packed: np.ndarray) -> np.ndarray:
        return np.unpackbits(packed, axis=-1, count=self.shape[-1]).astype(bool)
