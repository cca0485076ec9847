"""PictureStore: what was put comes back, from memory and from the file, which leaves nothing behind."""

import errno
import os
from pathlib import Path

import numpy as np
import pytest

from engine.errors import DiskError
from engine.training.preparation.picture_store import PictureStore

SHAPE = (4, 3, 5, 7)
CAMERA_BYTES = 3 * 5 * 7 * 3


def pictures(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 256, (3, 5, 7, 3), dtype=np.uint8)


@pytest.mark.parametrize("n_in_memory", [0, 1, 3, 4, 9])
def test_pictures_come_back_wherever_they_are(tmp_path: Path, n_in_memory: int):
    store = PictureStore(SHAPE, tmp_path / "new", max_bytes=n_in_memory * CAMERA_BYTES)
    for row in (2, 0, 3, 1):
        store.put(row, pictures(row))
    store.put(1, pictures(9))
    for row, seed in enumerate((0, 9, 2, 3)):
        assert np.array_equal(store.of_camera(row), pictures(seed))
        for frame in range(3):
            assert np.array_equal(store.picture(row, frame), pictures(seed)[frame])
    assert not (tmp_path / "new").exists() or not os.listdir(tmp_path / "new")


def test_a_picture_from_the_file_is_a_copy(tmp_path: Path):
    store = PictureStore(SHAPE, tmp_path, max_bytes=0)
    store.put(0, pictures(0))
    store.picture(0, 1)[:] = 0
    assert np.array_equal(store.picture(0, 1), pictures(0)[1])


def test_other_pictures_are_refused(tmp_path: Path):
    store = PictureStore(SHAPE, tmp_path)
    with pytest.raises(ValueError, match="must be uint8"):
        store.put(0, pictures(0)[:2])
    with pytest.raises(ValueError, match="must be uint8"):
        store.put(0, pictures(0).astype(np.float32))


def test_a_full_disk_is_said_before_the_work(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def full(*arguments: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "posix_fallocate", full)
    with pytest.raises(DiskError, match="that do not fit into memory could not be written") as caught:
        PictureStore(SHAPE, tmp_path, max_bytes=0)
    assert "Free some space" in caught.value.hint
    assert not os.listdir(tmp_path)
