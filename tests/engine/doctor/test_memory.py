"""What the doctor says it takes: bounded, whatever the capture."""

from __future__ import annotations

import numpy as np

from engine.assets import asset_path
from engine.capture.capture import open_capture
from engine.doctor import memory
from engine.features import matching, sift_memory
from engine.features.matching import MAX_SIFT_BYTES


class Rig:
    """The sizes of pictures alone."""

    def __init__(self, n: int, size: tuple[int, int]) -> None:
        self.image_sizes = np.tile(np.array(size, dtype=np.int64), (n, 1))


class Made:
    """As much of a capture as a forecast asks for."""

    def __init__(self, n_cameras: int, size: tuple[int, int], n_frames: int) -> None:
        self.rig, self.n_frames = Rig(n_cameras, size), n_frames


def test_four_portrait_cameras_stay_below_a_gigabyte() -> None:
    assert 0.4 < memory.memory_bytes(Made(4, (1088, 1920), 100)) / 2**30 < 1.0  # type: ignore[arg-type]


def test_a_longer_capture_takes_no_more() -> None:
    short, long = (memory.memory_bytes(Made(20, (1920, 1080), n)) for n in (2_000, 200_000))  # type: ignore[arg-type]
    assert short == long


def test_matching_counts_and_is_bounded_on_machines_of_many_cores(monkeypatch) -> None:
    wide = Made(31, (1920, 1080), 100)
    few = memory.memory_bytes(wide)  # type: ignore[arg-type]
    monkeypatch.setattr(sift_memory, "n_cores", lambda: 64)
    assert sift_memory.n_at_once(1280, 720, MAX_SIFT_BYTES) == 1
    assert sift_memory.n_at_once(640, 360, MAX_SIFT_BYTES) == 4
    assert sift_memory.n_at_once(3000, 2000, 1) == 1
    assert memory.memory_bytes(wide) == few  # type: ignore[arg-type]
    monkeypatch.setattr(memory, "matching_bytes", lambda n, width, height: 10**10)
    assert memory.memory_bytes(wide) > 10**10  # type: ignore[arg-type]


def test_a_child_looks_at_so_many_pictures_at_once(monkeypatch) -> None:
    asked = []

    def answered(module, arrays, **others):
        asked.append(int(arrays["max_bytes"]))
        return {"pixels": np.zeros((0, 4)), "rows": np.zeros((0, 2)), "counts": np.zeros(1, int), "n_features": [0, 0]}

    monkeypatch.setattr(matching, "work_on_arrays", answered)
    matching.match_pairs(np.zeros((2, 8, 8, 3), np.uint8), [(0, 1)])
    assert asked == [MAX_SIFT_BYTES]


def test_the_sample_takes_little() -> None:
    capture = open_capture(asset_path("sample"))
    assert memory.memory_bytes(capture) < 800 << 20
    capture.close()
