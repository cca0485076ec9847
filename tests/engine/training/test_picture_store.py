"""PictureStore: what was put comes back, from memory and from the file, which leaves nothing behind."""

import errno
import os
import shutil
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from engine.errors import DiskError, ProjectError
from engine.training.preparation import picture_store
from engine.training.preparation.picture_store import PictureStore, bytes_of, check_room

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


LONG = (32, 1400, 1080, 1920)
"""One clip of all frames of a capture."""


@pytest.fixture
def machine(monkeypatch: pytest.MonkeyPatch) -> dict[str, int | None]:
    """Memory and free disk of a made machine of four cores; may be changed."""
    has: dict[str, int | None] = {"memory": 64 * 10**9, "free": 10**12}
    monkeypatch.setattr(picture_store, "memory_bytes", lambda: has["memory"])
    monkeypatch.setattr(picture_store, "n_cores", lambda: 4)
    monkeypatch.setattr(shutil, "disk_usage", lambda place: SimpleNamespace(free=has["free"]))
    return has


def test_memory_for_long_clips_is_that_of_a_camera_on_every_core(machine: dict[str, int | None], tmp_path: Path):
    camera_bytes = 1400 * 1080 * 1920 * 3
    assert bytes_of(LONG) == (4 * camera_bytes, 32 * camera_bytes)
    assert bytes_of(SHAPE) == (4 * CAMERA_BYTES, 0)
    assert bytes_of(SHAPE, max_bytes=3 * CAMERA_BYTES) == (4 * CAMERA_BYTES, CAMERA_BYTES)
    check_room(LONG, tmp_path / "new")
    machine["memory"] = None  # not known
    check_room(LONG, tmp_path / "new")


def test_pictures_without_room_are_refused_before_any_is_read(machine: dict[str, int | None], tmp_path: Path):
    said = "1,400 frames of 32 cameras, 1920 x 1080, are 278.7 GB of pictures; "
    machine["free"] = 77 * 10**9
    with pytest.raises(DiskError, match=f"{said}278.7 GB of them have to be in a file, and the disk has 77.0 GB free"):
        PictureStore(LONG, tmp_path / "new")
    machine["memory"] = 16 * 10**9
    expected = f"{said}reading them takes 34.8 GB of memory, and this machine has 16.0 GB. Choose shorter clips"
    with pytest.raises(ProjectError, match=expected) as caught:
        PictureStore(LONG, tmp_path / "new")
    assert not isinstance(caught.value, DiskError), "bad input"
    assert not (tmp_path / "new").exists()


def test_a_full_disk_is_said_before_the_work(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def full(*arguments: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "posix_fallocate", full)
    with pytest.raises(DiskError, match="that do not fit into memory could not be written") as caught:
        PictureStore(SHAPE, tmp_path, max_bytes=0)
    assert "Free some space" in caught.value.hint
    assert not os.listdir(tmp_path)
