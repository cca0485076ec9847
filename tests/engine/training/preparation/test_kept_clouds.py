"""Clouds of frames as files: found again by their key, made again when damaged, and never in the way."""

from __future__ import annotations

import numpy as np
import pytest

from engine.cloud.stereo.frames_cloud import FramesCloud
from engine.errors import DiskError
from engine.training.preparation import kept_clouds
from engine.training.preparation.kept_clouds import CLOUD_FILES, kept_cloud


class Made:
    """Builds one cloud, and counts how often."""

    def __init__(self) -> None:
        self.n_calls = 0
        self._points, self._colors = np.random.default_rng(0).random((2, 7, 3), np.float32)

    def __call__(self) -> FramesCloud:
        self.n_calls += 1
        return FramesCloud(self._points, self._colors, np.ones((2, 3), np.float32), 0.25, np.array([4, 3]))


@pytest.fixture
def made() -> Made:
    return Made()


def same(one: FramesCloud, other: FramesCloud) -> bool:
    arrays = ("points", "colors", "gains", "n_of_frames")
    return one.spacing == other.spacing and all(np.array_equal(getattr(one, n), getattr(other, n)) for n in arrays)


def test_a_cloud_is_built_once_for_a_key(tmp_path, made):
    first = kept_cloud(tmp_path, 10, {"size": [4, 3]}, made)
    assert same(kept_cloud(tmp_path, 10, {"size": [4, 3]}, made), first)
    assert made.n_calls == 1
    kept_cloud(tmp_path, 10, {"size": [8, 6]}, made)
    kept_cloud(tmp_path, 20, {"size": [4, 3]}, made)
    assert made.n_calls == 3
    assert len(list(tmp_path.glob(CLOUD_FILES))) == 3


@pytest.mark.parametrize("share", [0.0, 0.5, 0.99])
def test_a_damaged_file_is_made_again(tmp_path, made, share, caplog):
    first = kept_cloud(tmp_path, 0, {}, made)
    (path,) = tmp_path.glob(CLOUD_FILES)
    path.write_bytes(path.read_bytes()[: int(share * path.stat().st_size)])
    assert same(kept_cloud(tmp_path, 0, {}, made), first)
    assert made.n_calls == 2
    assert "is rebuilt" in caplog.text
    kept_cloud(tmp_path, 0, {}, made)
    assert made.n_calls == 2


def test_a_full_disk_costs_the_file_and_not_the_cloud(tmp_path, made, monkeypatch, caplog):
    def refuse(*_: object, **__: object) -> None:
        raise DiskError("The cloud could not be written: the disk is full.")

    monkeypatch.setattr(kept_clouds, "write_arrays", refuse)
    assert len(kept_cloud(tmp_path, 0, {}, made).points) == 7
    assert "was not stored" in caplog.text
