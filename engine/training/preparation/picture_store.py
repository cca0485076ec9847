"""PictureStore: the pictures of one clip, in memory as far as they fit, the others in a temporary file.

Pictures are drawn in any order, and videos can only be read forwards; 36 cameras of 60 frames of 1920 x 1080 are 13 GB.
The file has no name, so that nothing is left of it however the process ends.
"""

from __future__ import annotations

import os
import shutil
import tempfile
import weakref
from pathlib import Path

import numpy as np

from engine.errors import DiskError, ProjectError
from engine.machine import memory_bytes
from engine.parallel import n_cores
from engine.storage.files import disk_error

Shape = tuple[int, int, int, int]
"""Cameras, frames, height, width. Three bytes a pixel."""

MAX_BYTES = 1536 << 20
"""Memory for pictures; those of cameras that do not fit are in the file."""


def bytes_of(shape: Shape, *, max_bytes: int = MAX_BYTES) -> tuple[int, int]:
    """Most memory that pictures take, with those of a camera on every thread while they are read, and their file."""
    camera_bytes = _camera_bytes(shape)
    n_in_file = shape[0] - _n_in_memory(shape, max_bytes)
    n_at_once = shape[0] - n_in_file + min(n_in_file, n_cores())
    return n_at_once * camera_bytes, n_in_file * camera_bytes


def check_room(shape: Shape, folder: Path, *, max_bytes: int = MAX_BYTES) -> None:
    """Check that there is room for the pictures of a clip, before any is read.

    Args:
        shape, folder, max_bytes: As of PictureStore.
    Raises:
        ProjectError: Reading them takes more memory than the machine has.
        DiskError: The disk is too full for those that do not fit into memory.
    """
    n_cameras, n_frames, height, width = shape
    needed, file_bytes = bytes_of(shape, max_bytes=max_bytes)
    there, total = memory_bytes(), n_cameras * _camera_bytes(shape)
    said = f"{n_frames:,} frames of {n_cameras} cameras, {width} x {height}, are {total / 1e9:.1f} GB of pictures"
    remedy = "Choose shorter clips or a smaller scale."
    if there is not None and needed > there:
        needs = f"reading them takes {needed / 1e9:.1f} GB of memory, and this machine has {there / 1e9:.1f} GB"
        raise ProjectError(f"{said}; {needs}.", hint=remedy)
    place = next(parent for parent in (folder.absolute(), *folder.absolute().parents) if parent.is_dir())
    free = shutil.disk_usage(place).free
    if file_bytes > free:
        needs = f"{file_bytes / 1e9:.1f} GB of them have to be in a file, and the disk has {free / 1e9:.1f} GB free"
        raise DiskError(f"{said}; {needs}.", hint=remedy, path=folder)


def _camera_bytes(shape: Shape) -> int:
    return 3 * int(np.prod(shape[1:]))


def _n_in_memory(shape: Shape, max_bytes: int) -> int:
    return min(max_bytes // max(_camera_bytes(shape), 1), shape[0])


class PictureStore:
    """Pictures of one size, camera by camera. Cameras may be written and read on several threads.

    Args:
        shape: Of all pictures.
        folder: For the file, where one is needed; need not exist.
        max_bytes: Memory for pictures.
    Raises:
        ProjectError, DiskError: There is no room for them, see `check_room`.
    """

    def __init__(self, shape: Shape, folder: Path, *, max_bytes: int = MAX_BYTES) -> None:
        check_room(shape, folder, max_bytes=max_bytes)
        self.n_cameras, self._shape = shape[0], (*shape[1:], 3)
        self._camera_bytes, self._n_in_memory = _camera_bytes(shape), _n_in_memory(shape, max_bytes)
        self._in_memory: list[np.ndarray | None] = [None] * self._n_in_memory
        self._file: int | None = None
        n_bytes = (self.n_cameras - self._n_in_memory) * self._camera_bytes
        if n_bytes:
            try:
                folder.mkdir(parents=True, exist_ok=True)
                self._file, name = tempfile.mkstemp(dir=folder)
                weakref.finalize(self, os.close, self._file)
                os.unlink(name)
                os.posix_fallocate(self._file, 0, n_bytes)  # a full disk shows here
            except OSError as error:
                what = f"{n_bytes / 1e9:.1f} GB of pictures that do not fit into memory"
                raise disk_error(error, what=what, path=folder) from error

    def put(self, camera_row: int, pictures: np.ndarray) -> None:
        """All pictures of one camera. [M, H, W, 3] uint8"""
        if pictures.shape != self._shape or pictures.dtype != np.uint8:
            raise ValueError(f"pictures must be uint8 {list(self._shape)}, got {pictures.dtype} {list(pictures.shape)}")
        if self._file is None or camera_row < self._n_in_memory:
            self._in_memory[camera_row] = pictures
            return
        left, offset = memoryview(np.ascontiguousarray(pictures).reshape(-1).data), self._offset(camera_row, 0)
        while left:
            written = os.pwrite(self._file, left, offset)
            left, offset = left[written:], offset + written

    def picture(self, camera_row: int, frame_in_clip: int) -> np.ndarray:
        """One picture. [H, W, 3] uint8"""
        kept = self._kept(camera_row)
        return self._read(camera_row, frame_in_clip, 1)[0] if kept is None else kept[frame_in_clip]

    def of_camera(self, camera_row: int) -> np.ndarray:
        """All pictures of one camera. [M, H, W, 3] uint8"""
        kept = self._kept(camera_row)
        return self._read(camera_row, 0, self._shape[0]) if kept is None else kept

    def _kept(self, camera_row: int) -> np.ndarray | None:
        return self._in_memory[camera_row] if camera_row < self._n_in_memory else None

    def _read(self, camera_row: int, frame_in_clip: int, n_frames: int) -> np.ndarray:
        assert self._file is not None
        pictures = np.empty((n_frames, *self._shape[1:]), np.uint8)
        left, offset = memoryview(pictures.reshape(-1).data), self._offset(camera_row, frame_in_clip)
        while left:
            n_read = os.preadv(self._file, [left], offset)
            left, offset = left[n_read:], offset + n_read
        return pictures

    def _offset(self, camera_row: int, frame_in_clip: int) -> int:
        picture_bytes = self._camera_bytes // self._shape[0]
        return (camera_row - self._n_in_memory) * self._camera_bytes + frame_in_clip * picture_bytes
