"""Outlier removal does the same with Open3D and without it, and removes what it should."""

import sys

import numpy as np
import pytest

from engine.cloud.fusion import keep_inliers


def sheet_with_strays(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Points of a thin sheet and a few far off it: points [P, 3], is_stray [P]."""
    sheet = rng.normal(size=(2000, 3)) * [1.0, 1.0, 0.01]
    strays = rng.uniform(8.0, 12.0, size=(20, 3))
    return np.concatenate([sheet, strays]), np.arange(2020) >= 2000


def test_far_points_go_and_the_sheet_stays(rng: np.random.Generator) -> None:
    pytest.importorskip("open3d", exc_type=ImportError)
    points, is_stray = sheet_with_strays(rng)
    is_kept = keep_inliers(points)
    assert not is_kept[is_stray].any()
    assert is_kept[~is_stray].mean() > 0.97  # a Gaussian sheet has a thin rim of its own


def test_without_open3d_the_same_rows_are_kept(rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("open3d", exc_type=ImportError)
    points, _ = sheet_with_strays(rng)
    expected = keep_inliers(points)
    monkeypatch.setitem(sys.modules, "open3d", None)  # makes `import open3d` fail
    np.testing.assert_array_equal(keep_inliers(points), expected)


def test_too_few_points_are_all_kept() -> None:
    assert keep_inliers(np.zeros((3, 3))).all()
