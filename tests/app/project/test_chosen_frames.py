"""A capture of which only some frames are worked on, and another working size of the same capture."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from engine.capture.capture import open_capture
from engine.errors import CaptureError
from tests.app.fakes import write_capture


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Four cameras, six frames."""
    return write_capture(tmp_path_factory.mktemp("chosen") / "ring")


def test_chosen_frames_are_counted_from_zero_and_no_others_can_be_had(folder: Path) -> None:
    whole, part = open_capture(folder), open_capture(folder, frames=(2, 5))
    assert (part.n_frames, part.first_frame, part.frames) == (3, 2, (2, 5))
    for frame in range(3):
        assert np.array_equal(part.frame(1, frame), whole.frame(1, 2 + frame))
    assert np.array_equal(part.frames_of(0, [2, 0]), whole.frames_of(0, [4, 2]))
    with pytest.raises(IndexError, match=r"outside 0\.\.2"):
        part.frame(0, 3)


def test_a_part_is_known_as_of_the_same_capture_but_what_is_prepared_for_it_is_its_own(folder: Path) -> None:
    whole, part = open_capture(folder), open_capture(folder, frames=(2, 5))
    assert whole.frames is None
    assert part.fingerprint == whole.fingerprint == whole.part_key
    assert part.part_key not in (whole.part_key, open_capture(folder, frames=(2, 4)).part_key)
    assert open_capture(folder, frames=(0, 6)).part_key == whole.part_key


@pytest.mark.parametrize("frames", [(0, 7), (3, 3), (4, 2), (-1, 3)])
def test_frames_that_are_not_there_are_refused_and_those_that_are_told(folder: Path, frames: tuple[int, int]) -> None:
    with pytest.raises(CaptureError, match=f"{frames[0]}:{frames[1]}.*0 to 5"):
        open_capture(folder, frames=frames)


def test_another_size_needs_no_file_to_be_read_again(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = open_capture(folder)
    monkeypatch.setattr("engine.capture.capture.read_layout", None)
    small = whole.resized(0.5, (1, 3))
    assert small.frame(0, 0).shape == (12, 16, 3)
    assert (small.n_frames, small.scale, small.path) == (2, 0.5, whole.path)
    assert np.allclose(small.rig.Ks[0, :2], whole.rig.Ks[0, :2] / 2)
    with pytest.raises(CaptureError, match="scale"):
        whole.resized(1.5)
