"""Rings whose cameras see little in common: right pairs are chosen and joined, and believed where the chain closes."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
import pytest

from app.lab.synthetic.rigs import looking_at
from engine.calibration.matching.matching import KeyPoints, Pair, all_pairs
from engine.calibration.matching.motions import AgreedMotion, agreed_motions
from engine.calibration.solving.agreement import MatchAgreement, agreement
from engine.calibration.solving.bundle import Observations
from engine.calibration.solving.cameras import Cameras
from engine.calibration.solving.links import is_held, linked_estimate, linked_pairs, surrounds
from engine.calibration.solving.mapping import FirstEstimate
from engine.calibration.solving.solving import ROUGH, solve
from engine.calibration.solving.tracks import Tracks
from tests.engine.calibration.made_rigs import off_truth

N_CAMERAS, N_MOMENTS, FOCAL = 10, 6, 512.0
SIZES = np.tile([640, 480], (N_CAMERAS, 1))
SEEN = 0.55
"""Cosine between a surface and a ray from which on it still looks alike."""


@cache
def scene() -> tuple[Cameras, list[KeyPoints], dict[Pair, np.ndarray]]:
    """A ring 36 degrees apart around people, who are seen from a side, and a floor of which neighbours match a part;
    opposite cameras match what is not the same, in the way of a thing that looks alike from both sides."""
    generator = np.random.default_rng(0)
    angles = 2 * np.pi * np.arange(N_CAMERAS) / N_CAMERAS
    centers = np.stack([2.7 * np.cos(angles), 2.7 * np.sin(angles), 1.2 + 0.4 * (np.arange(N_CAMERAS) % 2)], axis=-1)
    poses = np.array([looking_at(center, np.array([0, 0, 0.7])) for center in centers])
    ones = np.ones(N_CAMERAS)
    truth = Cameras(
        "simple", poses[:, :3, :3], poses[:, :3, 3], FOCAL * ones, ones, SIZES / 2.0, np.zeros((N_CAMERAS, 1))
    )
    points, normals, moments = [], [], []
    for moment in range(1, N_MOMENTS + 1):
        turns = generator.uniform(0, 2 * np.pi, 120)
        normals.append(np.stack([np.cos(turns), np.sin(turns), 0 * turns], axis=-1))
        heights = generator.uniform(0, 1.7, len(turns))
        walks = np.array([*generator.uniform(-0.6, 0.6, 2), 0])
        points.append(0.3 * normals[-1] + walks + heights[:, None] * [0, 0, 1])
        moments.append(np.full(len(turns), moment))
    floor = generator.uniform([-1.5, -1.5, 0], [1.5, 1.5, 0.3], (300, 3))
    leaning = np.concatenate([generator.normal(0, 1, (300, 2)), np.zeros((300, 1))], axis=1)
    points, moments = np.concatenate([floor, *points]), np.concatenate([np.zeros(300, int), *moments])
    normals = np.concatenate([leaning / np.linalg.norm(leaning, axis=-1, keepdims=True), *normals])
    rows_of, key_points = [], []
    for row in range(N_CAMERAS):
        pixels, _ = truth.pixels(np.full(len(points), row), points)
        rays = centers[row] - points
        cosines = (normals * rays).sum(-1) / np.linalg.norm(rays, axis=-1)
        kept = np.flatnonzero((cosines > SEEN) & (pixels > 0).all(1) & (pixels < SIZES[row]).all(1))
        rows_of.append({int(point): i for i, point in enumerate(kept)})
        noisy = pixels[kept] + generator.normal(0, 0.3, (len(kept), 2))
        key_points.append(KeyPoints(noisy, moments[kept], np.zeros((len(kept), 128), np.float32)))
    matches = {}
    for a, b in all_pairs(N_CAMERAS):
        common = [(rows_of[a][p], rows_of[b][p]) for p in rows_of[a] if p in rows_of[b]]
        both = np.array(common, dtype=np.int64).reshape(-1, 2)
        if b - a == N_CAMERAS // 2:  # many that fit one motion, of moving parts only, and background that fits none
            moving = [np.flatnonzero(key_points[row].moments > 0)[:80] for row in (a, b)]
            still = [generator.permutation(np.flatnonzero(key_points[row].moments == 0))[:30] for row in (a, b)]
            both = np.concatenate([np.stack(part, axis=-1) for part in (moving, still)])
        matches[a, b] = both
    return truth, key_points, matches


@cache
def motions() -> dict[Pair, AgreedMotion]:
    _, key_points, matches = scene()
    return agreed_motions(key_points, matches, SIZES)


def is_neighbour(pair: Pair) -> bool:
    return pair[1] - pair[0] in (1, N_CAMERAS - 1)


def placed(chosen: dict[Pair, AgreedMotion]):
    """Cameras of these pairs, and which of them are held."""
    _, key_points, matches = scene()
    geometries, tree = linked_pairs(chosen, key_points, SIZES, 0.8)
    estimate = linked_estimate(geometries, tree, key_points, SIZES, 0.8)
    assert isinstance(estimate, FirstEstimate)
    trusted = {pair: chosen[pair].rows if pair in geometries else rows[:0] for pair, rows in matches.items()}
    found = solve(estimate, key_points, trusted, SIZES, lens="simple", is_shared=False, stages=ROUGH)
    agreed = agreement(found.rows, found.cameras, key_points, trusted, 640.0)
    return found, is_held(agreed, found.tracks)


def test_pairs_count_that_background_and_moving_parts_agree_on() -> None:
    found = motions()
    assert {pair for pair in all_pairs(N_CAMERAS) if is_neighbour(pair)} <= set(found)
    assert not [pair for pair in found if pair[1] - pair[0] == N_CAMERAS // 2]


@pytest.mark.slow
def test_a_ring_that_closes_is_found_and_held() -> None:
    found, held = placed(motions())
    assert found.rows.tolist() == list(range(N_CAMERAS))
    angle_deg, distance = off_truth(found.cameras, scene()[0])
    assert angle_deg < 1.0
    assert distance < 0.02
    assert held.all()


@pytest.mark.slow
def test_a_chain_that_does_not_close_is_not_held() -> None:
    chain = {pair: motion for pair, motion in motions().items() if pair[1] - pair[0] == 1}
    found, held = placed(chain)
    assert len(found.rows) == N_CAMERAS
    assert not held.any()


def made_agreement(pairs: Sequence[Pair]) -> MatchAgreement:
    """Of six cameras; these pairs explain all of their matches."""
    n = np.zeros((6, 6), dtype=np.int64)
    for a, b in pairs:
        n[a, b] = n[b, a] = 100
    return MatchAgreement(n, n)


def seen_by(threes: Sequence[tuple[int, int, int]]) -> Tracks:
    """Ten points for every three cameras."""
    cameras = np.repeat(np.array(threes, dtype=np.int64).reshape(-1, 3), 10, axis=0)
    points = np.repeat(np.arange(len(cameras)), 3)
    return Tracks(np.zeros((len(cameras), 3)), Observations(cameras.reshape(-1), points, np.zeros((cameras.size, 2))))


RING = [(0, 1), (1, 2), (2, 3), (3, 4), (4, 5), (0, 5)]


@pytest.mark.parametrize(
    ("pairs", "threes", "held"),
    [
        (RING, [(0, 1, 2), (1, 2, 3), (3, 4, 5), (0, 4, 5)], [0, 1, 2, 3, 4, 5]),  # two halves meet in two cameras
        (RING, [(0, 1, 2), (2, 3, 4)], []),  # four parts of a ring can have many sizes
        (RING, [(0, 1, 2), (1, 2, 3), (2, 3, 4), (3, 4, 5)], []),  # a single pair closes it
        (RING[:5], [(0, 1, 2), (1, 2, 3), (2, 3, 4), (3, 4, 5)], []),  # of one size, but open
        (
            [(0, 1), (1, 2), (0, 2), (2, 3), (3, 4), (4, 5), (3, 5)],
            [(0, 1, 2), (1, 2, 3), (2, 3, 4), (3, 4, 5)],
            [0, 1, 2],
        ),
        ([(0, 1), (1, 2), (0, 2), (2, 3)], [(0, 1, 2), (1, 2, 3)], [0, 1, 2]),  # the last one hangs loose
    ],
)
def test_what_is_held_closes_and_is_of_one_size(pairs, threes, held) -> None:
    assert np.flatnonzero(is_held(made_agreement(pairs), seen_by(threes))).tolist() == held


def test_only_cameras_all_around_surround() -> None:
    rotations = scene()[0].rotations
    assert surrounds(rotations)
    assert surrounds(rotations[::2])
    assert not surrounds(rotations[:7])
