"""A camera that trades place for focal length and principal point is found out, and nobody else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from engine.calibration.solving.agreement import agreement
from engine.calibration.solving.strain import is_strained
from tests.engine.calibration.made_rigs import SIZE
from tests.engine.calibration.test_agreement import N_CAMERAS, matched

ROWS = np.arange(N_CAMERAS)
SIZES = np.tile(SIZE, (N_CAMERAS, 1))


def strained(cameras, key_points, matches) -> list[int]:
    firm = agreement(ROWS, cameras, key_points, matches, float(SIZE[0])).is_firm
    return np.flatnonzero(is_strained(ROWS, cameras, key_points, matches, SIZES, firm)).tolist()


def test_right_cameras_are_not() -> None:
    assert strained(*matched()) == []


def test_one_whose_lens_was_bent_is_though_all_its_matches_are_explained() -> None:
    cameras, key_points, matches = matched()
    principal, translations = cameras.principal.copy(), cameras.translations.copy()
    principal[5] += (20.0, 0.0)
    translations[5] += 20.0 / 500.0 * np.array([-4.0, 0.0, 0.0])  # so that what is 4 units away lands where it was seen
    bent = replace(cameras, principal=principal, translations=translations)
    found = agreement(ROWS, bent, key_points, matches, float(SIZE[0]))
    assert found.is_placed[5]
    assert strained(bent, key_points, matches) == [5]


def test_a_principal_point_far_off_alone_is_not() -> None:
    cameras, key_points, matches = matched()
    principal = cameras.principal.copy()
    principal[5] += (20.0, 0.0)
    moved = [
        replace(points, pixels=points.pixels + np.array([20.0, 0.0])) if row == 5 else points
        for row, points in enumerate(key_points)
    ]
    assert strained(replace(cameras, principal=principal), moved, matches) == []
