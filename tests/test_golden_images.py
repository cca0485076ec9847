"""The comparison of golden pictures can fail, says why, and explains it with pictures."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tests.golden_images import assert_matches_golden, compare_images


@pytest.fixture
def picture(rng: np.random.Generator) -> np.ndarray:
    return rng.integers(0, 250, (40, 50, 3), dtype=np.uint8)


def check(picture: np.ndarray, folder: Path, *, update: bool = False, share: float = 0.0) -> None:
    assert_matches_golden(
        picture,
        "sample",
        update=update,
        max_failing_share=share,
        golden_folder=folder / "golden",
        failure_folder=folder / "failures",
    )


def test_missing_golden_fails_and_names_the_option(picture: np.ndarray, tmp_path: Path) -> None:
    with pytest.raises(AssertionError, match="--update-golden"):
        check(picture, tmp_path)


def test_update_writes_what_then_matches(picture: np.ndarray, tmp_path: Path) -> None:
    check(picture, tmp_path, update=True)
    check(picture, tmp_path)
    assert not (tmp_path / "failures").exists()


def test_differences_within_tolerance_pass(picture: np.ndarray, tmp_path: Path) -> None:
    check(picture, tmp_path, update=True)
    check(picture + np.uint8(3), tmp_path)


def test_one_pixel_beyond_tolerance_fails_and_is_shown(picture: np.ndarray, tmp_path: Path) -> None:
    check(picture, tmp_path, update=True)
    changed = picture.copy()
    changed[7, 9, 1] += 5
    with pytest.raises(AssertionError, match=r"^1 pixels differ by more than 3/255 \(worst 5\)"):
        check(changed, tmp_path)
    with Image.open(tmp_path / "failures" / "sample-difference.png") as stored:
        difference = np.asarray(stored)
    assert np.argwhere(difference).tolist() == [[7, 9]]
    assert {path.name for path in (tmp_path / "failures").iterdir()} == {
        "sample-actual.png",
        "sample-golden.png",
        "sample-difference.png",
    }


def test_allowed_share_of_failing_pixels_is_exact(picture: np.ndarray, tmp_path: Path) -> None:
    check(picture, tmp_path, update=True)
    changed = picture.copy()
    changed[0, :4] ^= 0x80  # 4 of 2000 pixels
    check(changed, tmp_path, share=4 / 2000)
    with pytest.raises(AssertionError, match=r"^4 pixels"):
        check(changed, tmp_path, share=3.9 / 2000)


def test_other_sizes_are_refused(picture: np.ndarray) -> None:
    with pytest.raises(AssertionError, match=r"\(39, 50, 3\).*\(40, 50, 3\)"):
        compare_images(picture[1:], picture)
