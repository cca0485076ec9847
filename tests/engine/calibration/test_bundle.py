"""Bundle adjustment finds cameras of generated rigs, whatever their lens, and does not mind wrong sightings."""

from __future__ import annotations

import numpy as np
import pytest

from engine.calibration.solving.bundle import Expectations, FreePoints, Observations, _jacobians, adjust, errors_px
from engine.calibration.solving.cameras import Cameras, rotation_of
from tests.engine.calibration.made_rigs import SIZE, Seen, make_seen, off_truth, rough


def adjusted(seen: Seen, lens: str, **expect) -> tuple[Cameras, np.ndarray]:
    start = rough(seen.truth, lens)
    points = seen.points + np.random.default_rng(3).normal(0, 0.05, seen.points.shape)
    n = len(start)
    cameras, shape = adjust(
        start,
        FreePoints(points),
        seen.sightings,
        middles=np.tile(np.array(SIZE) / 2.0, (n, 1)),
        widths=np.full(n, float(SIZE[0])),
        expect=Expectations(**expect),
        n_iterations=20,
    )
    return cameras, shape.points


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "lens", "most_deg"),
    [
        ("forward", "simple", 0.2),
        pytest.param("ring", "simple", 0.2, marks=pytest.mark.slow),
        # its tangential numbers stand in for the principal point, and that for the direction: short of the goal of 0.2
        pytest.param("ring", "opencv", 0.3, marks=pytest.mark.slow),
        pytest.param("ring", "fisheye", 0.2, marks=pytest.mark.slow),
    ],
)
def test_rigs_are_found_within_tenths_of_a_degree_and_half_a_percent(kind: str, lens: str, most_deg: float) -> None:
    seen = make_seen(kind, lens)
    angle, distance = off_truth(adjusted(seen, lens)[0], seen.truth)
    assert angle < most_deg
    assert distance < 0.005


@pytest.mark.slow
def test_wrong_sightings_do_not_pull() -> None:
    seen = make_seen("ring", "simple")
    pixels = seen.sightings.pixels.copy()
    wrong = np.random.default_rng(4).choice(len(pixels), len(pixels) // 20, replace=False)
    pixels[wrong] += np.random.default_rng(5).uniform(-60, 60, (len(wrong), 2))
    spoilt = Observations(seen.sightings.cameras, seen.sightings.points, pixels)
    cameras, points = adjusted(Seen(seen.truth, seen.points, spoilt), "simple")
    angle, distance = off_truth(cameras, seen.truth)
    assert angle < 0.25
    assert distance < 0.006
    errors = errors_px(cameras, points, spoilt)
    assert np.median(errors[wrong]) > 5
    assert np.median(errors) < 0.5


@pytest.mark.slow
def test_the_numbers_of_a_shared_lens_are_the_same_for_all() -> None:
    cameras, _ = adjusted(make_seen("forward", "simple"), "simple", groups=(0,) * 12)
    assert np.ptp(cameras.lens_params) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.slow
def test_cameras_of_one_group_share_a_lens_and_groups_do_not() -> None:
    cameras, _ = adjusted(make_seen("forward", "simple"), "simple", groups=(0, 1) * 6)
    assert np.ptp(cameras.lens_params[::2]) == pytest.approx(0.0, abs=1e-12)
    assert np.ptp(cameras.lens_params[1::2]) == pytest.approx(0.0, abs=1e-12)
    assert abs(cameras.lens_params[0] - cameras.lens_params[1]) > 1e-9


@pytest.mark.parametrize("lens", ["pinhole", "simple", "opencv", "fisheye"])
def test_derivatives_are_those_of_finite_differences(lens: str) -> None:
    seen = make_seen("forward", lens, n_points=60)
    truth, points, sightings = seen.truth, seen.points, seen.sightings
    J_cameras, J_points = _jacobians(truth, points, sightings)
    rows, step = sightings.cameras, 1e-6

    def pixels(cameras: Cameras, moved: np.ndarray) -> np.ndarray:
        return cameras.pixels(rows, moved[sightings.points])[0]

    for axis in range(3):
        offset = np.zeros(3)
        offset[axis] = step
        by_points = (pixels(truth, points + offset) - pixels(truth, points - offset)) / (2 * step)
        np.testing.assert_allclose(J_points[:, :, axis], by_points, rtol=1e-4, atol=1e-3)
        turned = [
            pixels(
                Cameras(lens, rotation_of(sign * np.tile(offset, (len(truth), 1))) @ truth.rotations, *rest(truth)),
                points,
            )
            for sign in (1, -1)
        ]
        np.testing.assert_allclose(J_cameras[:, :, axis], (turned[0] - turned[1]) / (2 * step), rtol=1e-4, atol=1e-3)


def rest(cameras: Cameras):
    return cameras.translations, cameras.focals, cameras.aspects, cameras.principal, cameras.lens_params
