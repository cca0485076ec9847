"""Matching at equal times; wrong matches cost a sighting, not the track."""

from __future__ import annotations

import numpy as np
import pytest

from engine.calibration.matching.matching import KeyPoints, match_all
from engine.calibration.solving.tracks import build_tracks, fitting_matches
from tests.engine.calibration.made_rigs import make_seen


def made_key_points(*, n_looks: int, n_points: int = 300):
    """Key points of a ring without noise; every n_looks-th point looks alike. Returns truth, lists, point numbers."""
    seen = make_seen("ring", noise_px=0.0, n_points=n_points)
    generator = np.random.default_rng(0)
    looks = generator.normal(size=(n_looks, 128))
    looks /= np.linalg.norm(looks, axis=1, keepdims=True)
    lists, numbers = [], []
    for camera in range(len(seen.truth)):
        rows = np.flatnonzero(seen.sightings.cameras == camera)
        which = seen.sightings.points[rows]
        descriptors = looks[which % n_looks] + generator.normal(0, 0.005, (len(rows), 128))
        descriptors /= np.linalg.norm(descriptors, axis=1, keepdims=True)
        lists.append(KeyPoints(seen.sightings.pixels[rows], which % 3, descriptors.astype(np.float32)))
        numbers.append(which)
    return seen, lists, numbers


def shares_right(matches, numbers) -> tuple[int, float]:
    right = [numbers[a][rows[:, 0]] == numbers[b][rows[:, 1]] for (a, b), rows in matches.items() if len(rows)]
    joined = np.concatenate(right) if right else np.zeros(0, bool)
    return int(joined.sum()), float(joined.mean()) if len(joined) else 0.0


def test_only_points_of_equal_times_are_matched() -> None:
    _, lists, numbers = made_key_points(n_looks=1000)
    matches = match_all(lists)
    n_right, share = shares_right(matches, numbers)
    assert n_right > 1000
    assert share == 1.0
    for (a, b), rows in matches.items():
        np.testing.assert_array_equal(lists[a].moments[rows[:, 0]], lists[b].moments[rows[:, 1]])


@pytest.mark.slow
def test_a_wrong_match_costs_a_sighting_and_not_the_track() -> None:
    seen, lists, _ = made_key_points(n_looks=1000)
    matches = match_all(lists)
    generator = np.random.default_rng(1)
    spoilt = {pair: rows.copy() for pair, rows in matches.items()}
    for pair, rows in spoilt.items():
        wrong = generator.uniform(size=len(rows)) < 0.1
        rows[wrong, 1] = generator.integers(len(lists[pair[1]]), size=int(wrong.sum()))
    fitting = fitting_matches(spoilt, lists, seen.truth, 1.0)
    tracks = build_tracks(fitting, lists, seen.truth, 1.0)
    nearest = np.linalg.norm(tracks.points[:, None] - seen.points[None], axis=-1).min(1)
    assert len(tracks.points) > 0.7 * len(seen.points)
    assert np.quantile(nearest, 0.95) < 0.01
    assert not np.any([np.bincount(tracks.seen.points[tracks.seen.cameras == c]).max(initial=0) > 1 for c in range(20)])
