"""One offset per camera from pairs of which some are wrong, and from sources of which some contradict each other."""

from __future__ import annotations

import numpy as np
import pytest

from engine.synchronisation.combining import combine
from engine.synchronisation.correlating import PairCurve, correlate
from engine.synchronisation.solving import common_zero, solve_curves, solve_pairs
from engine.synchronisation.synchronisation import Estimate, PairOffset

TRUTH = np.array([0.0, 3.0, -4.0, 0.5, 7.0, 0.0])


def all_pairs(generator: np.random.Generator, sigma: float, wrong: int) -> list[PairOffset]:
    pairs = [
        PairOffset(i, j, TRUTH[j] - TRUTH[i] + generator.normal(0, sigma), sigma) for i in range(6) for j in range(i)
    ]
    for row in generator.permutation(len(pairs))[:wrong]:
        pair = pairs[row]
        pairs[row] = PairOffset(pair.first, pair.second, float(generator.uniform(-15, 15)), sigma)
    return pairs


@pytest.mark.parametrize("seed", range(5))
def test_loops_show_which_pairs_are_wrong(seed):
    solution = solve_pairs(6, all_pairs(np.random.default_rng(seed), 0.05, wrong=3))
    error = solution.offsets_frames - TRUTH
    assert np.abs(error - np.median(error)).max() < 0.2
    assert 0.5 < np.nanmean(solution.agreements) < 0.95


def test_uncertainty_follows_the_scatter():
    calm = solve_pairs(6, all_pairs(np.random.default_rng(0), 0.05, wrong=0))
    restless = solve_pairs(6, all_pairs(np.random.default_rng(0), 0.5, wrong=0))
    assert restless.sigmas_frames.mean() > 4 * calm.sigmas_frames.mean()


def test_cameras_without_pairs_are_unknown_and_parts_stay_apart():
    solution = solve_pairs(5, [PairOffset(0, 1, 2.0, 0.1), PairOffset(2, 3, -1.0, 0.1)])
    assert solution.groups.tolist() == [0, 0, 1, 1, -1]
    assert np.isnan(solution.offsets_frames[4])
    assert solution.offsets_frames[1] - solution.offsets_frames[0] == pytest.approx(2.0, abs=1e-6)


def test_curves_with_a_higher_wrong_top_are_overruled():
    lags = np.arange(-20.0, 21)

    def bump(center: float, height: float) -> np.ndarray:
        return height * np.exp(-0.5 * ((lags - center) / 1.5) ** 2)

    curves = []
    for i in range(4):
        for j in range(i + 1, 4):
            true = TRUTH[j] - TRUTH[i]
            scores = bump(true, 0.7) + (bump(true + 9, 0.85) if (i, j) == (0, 1) else 0)
            curves.append(PairCurve(i, j, lags, scores, np.ones(len(lags))))
    solution = solve_curves(4, curves)
    error = solution.offsets_frames - TRUTH[:4]
    assert np.abs(error - np.median(error)).max() < 0.1


def test_the_shift_of_a_signal_is_its_best_lag():
    signal = np.random.default_rng(1).normal(size=(80, 3))
    lags, scores = correlate(signal[10:70], signal[4:64], 20)
    assert lags[np.argmax(scores)] == 6
    assert scores.max() == pytest.approx(1.0, abs=1e-2)
    lags, _ = correlate(signal[:5], signal[:5], 20)
    assert len(lags) == 0


def test_the_zero_is_what_most_cameras_share():
    assert common_zero(np.array([5.0, 5.1, 4.9, 12.0, -3.0, np.nan])) == pytest.approx(5.0)
    assert common_zero(np.array([np.nan])) == 0.0


def says(source, offsets, sigma, agreement=1.0):
    """An estimate of all cameras with a number; None: says nothing of it."""
    values = np.array([np.nan if offset is None else offset for offset in offsets], dtype=float)
    known = np.isfinite(values)
    return Estimate(
        source,
        values,
        np.where(known, sigma, np.nan),
        np.where(known, 0, -1),
        (),
        np.where(known, agreement, np.nan),
        "",
    )


def test_the_most_certain_source_wins_and_others_fill_in():
    found = combine(
        "abcd",
        [says("timecode", [10, 13, 10, 10], 0.4), says("epipolar", [0, 2.8, None, 0.1], 0.07)],
        30.0,
    )
    assert [camera.source for camera in found.cameras] == ["epipolar", "epipolar", "timecode", "epipolar"]
    np.testing.assert_allclose(found.offsets_frames, [-0.05, 2.75, 0.0, 0.05], atol=0.25)
    assert not found.disagreements


def test_contradictions_are_shown_and_cost_confidence():
    sure = says("epipolar", [0, 0, 0, 4], 0.07)
    alone = combine("abcd", [sure], 30.0)
    found = combine("abcd", [sure, says("timecode", [0, 0, 0, 0], 0.4)], 30.0)
    assert [disagreement.camera_index for disagreement in found.disagreements] == [3]
    assert "epipolar says +4.00 frames, timecode says +0.00" in found.disagreements[0].text
    assert found.cameras[3].confidence < alone.cameras[3].confidence
    assert found.cameras[3].offset_frames == pytest.approx(4.0)


def test_the_time_of_creation_decides_nothing():
    found = combine("ab", [says("creation time", [0, -60], 18)], 30.0)
    assert not found.is_known
    assert found.estimates[0].n_known == 2


def test_cameras_that_no_source_joins_stay_unknown():
    apart = says("motion", [0, 1, None, None], 0.3)
    other = says("audio", [None, None, 0, 2], 0.1)
    found = combine("abcd", [apart, other], 30.0)
    assert sum(camera.source is None for camera in found.cameras) == 2
