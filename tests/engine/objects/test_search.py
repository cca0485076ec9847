"""Objects are found from clip to clip: who touches and parts, leaves and comes back, is thrown."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from scipy.sparse import csr_matrix

from engine.objects.belonging import BOND, NOWHERE, belonging
from engine.objects.carrying import carried
from engine.objects.neighbours import bonds
from engine.objects.search import ObjectSearch, SearchGround
from tests.engine.objects.made_parts import Thing, made_parts

GREY, RED = (0.5, 0.5, 0.5), (0.8, 0.2, 0.1)


def grounds_of(things: Sequence[Thing], n_clips: int) -> tuple[list[SearchGround], list[np.ndarray]]:
    made = [made_parts(things, 10 * number) for number in range(n_clips)]
    return [SearchGround(parts) for parts, _ in made], [of for _, of in made]


def found(ground: SearchGround, of: np.ndarray, number: int = 0) -> tuple[float, float]:
    """Shares of the thing that was found, and of the others that were found too."""
    is_in = ground.values > 0.5
    others = is_in[of != number]
    return float(is_in[of == number].mean()), float(others.mean()) if len(others) else 0.0


def said(ground: SearchGround, of: np.ndarray, number: int = 0, side: float | None = None) -> np.ndarray:
    """The thing, or only what of it lies on one side, as of one that is seen from there."""
    chosen = of == number
    if side is not None:
        x = ground.parts.means[0, :, 0]
        chosen &= x > np.quantile(x[of == number], side)
    return chosen


def nobody(ground: SearchGround) -> np.ndarray:
    return np.zeros(len(ground.parts), bool)


def test_belonging_solves_its_equations() -> None:
    random = np.random.default_rng(0)
    matrix = np.triu(random.uniform(0, 1, (12, 12)) * (random.uniform(0, 1, (12, 12)) < 0.4), 1)
    matrix += matrix.T
    known, weight = random.uniform(0, 1, 12), random.uniform(0, 1, 12) * (random.uniform(0, 1, 12) < 0.5)
    pull = np.diag(weight + NOWHERE)
    slow = np.linalg.solve(BOND * (np.diag(matrix.sum(1)) - matrix) + pull, weight * known)
    np.testing.assert_allclose(belonging(csr_matrix(matrix), known, weight), slow, atol=1e-3)  # cg stops at 1e-4


def test_nothing_is_known_of_nothing() -> None:
    parts, _ = made_parts([Thing(lambda frame: None)], 0)
    matrix = bonds(parts)
    assert matrix.nnz == 0
    assert not belonging(matrix, np.zeros(len(parts)), np.zeros(len(parts))).any()


def test_bonds_are_symmetric_and_within_things() -> None:
    things = [Thing(lambda frame: (0, 0, 0)), Thing(lambda frame: (2, 0, 0))]
    parts, of = made_parts(things, 0)
    matrix = bonds(parts)
    assert abs(matrix - matrix.T).max() == 0
    assert matrix.max() <= 1.0
    assert matrix[of == 0][:, of == 1].sum() == 0


def test_two_that_touch_and_part_are_not_bound() -> None:
    near = lambda frame: (0.39 + 0.08 * abs(frame - 5), 0.0, 0.0)  # noqa: E731
    parts, of = made_parts([Thing(lambda frame: (0, 0, 0)), Thing(near)], 0)
    matrix = bonds(parts)
    assert matrix[of == 0][:, of == 1].sum() < 0.01 * matrix[of == 0][:, of == 0].sum()


def test_values_are_carried_over_the_border_as_things_have_moved_on() -> None:
    things = [Thing(lambda frame: (0.1 * frame, 0, 0)), Thing(lambda frame: (0.1 * frame, 0.5, 0))]
    before, of_before = made_parts(things, 0)
    after, of_after = made_parts(things, 10)
    for known, of_known, asked, of_asked in (
        (before, of_before, after, of_after),
        (after, of_after, before, of_before),
    ):
        value, surety = carried(known, (of_known == 0).astype(float), asked)
        assert surety.mean() > 0.5
        assert (value[of_asked == 0] > 0.9).all()
        assert (value[of_asked == 1] < 0.1).all()


def test_one_who_touches_another_is_followed() -> None:
    walks = lambda frame: (1.0 - 0.04 * min(frame, 30 - frame), 0.0, 0.0)  # noqa: E731  # as near as 0.4: they touch
    grounds, of = grounds_of([Thing(lambda frame: (0, 0, 0)), Thing(walks)], 3)
    ObjectSearch(grounds).take(0, 2, said(grounds[0], of[0], side=0.5), nobody(grounds[0]))
    for ground, numbers in zip(grounds, of, strict=True):
        mine, others = found(ground, numbers)
        assert mine > 0.95
        assert others < 0.03


def test_the_half_of_a_thing_that_is_seen_selects_all_of_it() -> None:
    grounds, of = grounds_of([Thing(lambda frame: (0, 0, 0)), Thing(lambda frame: (1, 0, 0))], 1)
    ObjectSearch(grounds).take(0, 0, said(grounds[0], of[0], side=0.5), nobody(grounds[0]))
    assert found(grounds[0], of[0]) == (1.0, 0.0)


def test_one_who_leaves_and_comes_back_is_known_again() -> None:
    leaves = lambda frame: (0, 0, 0.02 * frame) if frame < 18 else (2, 2, 0) if frame >= 34 else None  # noqa: E731
    things = [Thing(leaves, RED), Thing(lambda frame: (1, 0, 0), GREY)]
    grounds, of = grounds_of(things, 5)
    ObjectSearch(grounds).take(0, 2, said(grounds[0], of[0]), nobody(grounds[0]))
    assert grounds[2].doubt == "gone"
    assert grounds[3].doubt == "returning"
    assert not (grounds[2].values > 0.5).any()
    assert found(grounds[3], of[3]) == (1.0, 0.0)
    assert found(grounds[4], of[4]) == (1.0, 0.0)


def test_another_who_comes_is_not_taken_for_the_one_who_left() -> None:
    leaves = lambda frame: (0, 0, 0) if frame < 8 else None  # noqa: E731
    comes = lambda frame: (2, 2, 0) if frame >= 22 else None  # noqa: E731
    grounds, _ = grounds_of([Thing(leaves, RED), Thing(comes, (0.1, 0.2, 0.8)), Thing(lambda frame: (1, 0, 0))], 4)
    ObjectSearch(grounds).take(0, 2, grounds[0].parts.colors[:, 0] > 0.7, nobody(grounds[0]))
    assert [ground.doubt for ground in grounds[1:]] == ["gone", "gone", "gone"]
    assert not any((ground.values > 0.5).any() for ground in grounds[1:])


def test_a_thrown_ball_of_points_that_last_a_frame_is_followed() -> None:
    ball = Thing(lambda frame: (0.09 * frame, 0, 0), RED, n=60, radius=0.1, lasts=2)
    grounds, of = grounds_of([ball, Thing(lambda frame: (3, 1, 0))], 2)
    parts = grounds[0].parts
    ObjectSearch(grounds).take(0, 4, said(grounds[0], of[0]) & (parts.opacities[4] > 0), nobody(grounds[0]))
    for ground, numbers in zip(grounds, of, strict=True):
        mine, others = found(ground, numbers)
        assert mine > 0.95
        assert others == 0.0


def test_a_correction_holds_up_to_the_next_one() -> None:
    things = [Thing(lambda frame: (0, 0, 0)), Thing(lambda frame: (1, 0, 0)), Thing(lambda frame: (2, 0, 0))]
    grounds, of = grounds_of(things, 5)
    search = ObjectSearch(grounds)
    search.take(2, 25, (of[2] == 0) | (of[2] == 1), nobody(grounds[2]))  # two by mistake
    search.take(0, 5, nobody(grounds[0]), of[0] == 1)
    assert found(grounds[0], of[0]) == (1.0, 0.0)
    for ground, numbers in zip(grounds[2:], of[2:], strict=True):  # what was said there stays
        assert (ground.values[numbers == 1] > 0.5).all()
    search.take(3, 35, nobody(grounds[3]), of[3] == 1)
    for place in (3, 4):
        assert found(grounds[place], of[place]) == (1.0, 0.0)
    assert (grounds[2].values[of[2] == 1] > 0.5).all()


@pytest.mark.parametrize("n_frames", [1, 2, 3])
def test_short_clips(n_frames: int) -> None:
    things = [Thing(lambda frame: (0, 0, 0)), Thing(lambda frame: (1, 0, 0))]
    made = [made_parts(things, n_frames * number, n_frames) for number in range(3)]
    grounds = [SearchGround(parts) for parts, _ in made]
    ObjectSearch(grounds).take(1, n_frames, made[1][1] == 0, nobody(grounds[1]))
    for ground, (_, of) in zip(grounds, made, strict=True):
        assert found(ground, of) == (1.0, 0.0)


def test_the_same_seed_gives_the_same_object() -> None:
    results = []
    for _ in range(2):
        grounds, of = grounds_of([Thing(lambda frame: (0.05 * frame, 0, 0)), Thing(lambda frame: (1, 0, 0))], 3)
        ObjectSearch(grounds).take(0, 2, said(grounds[0], of[0], side=0.5), nobody(grounds[0]))
        results.append(np.concatenate([ground.values for ground in grounds]))
    assert np.array_equal(results[0], results[1])


def test_what_was_hidden_is_asked_of_what_it_hangs_together_with() -> None:
    """A third of a thing is seen and selected: the rest of it, which was not seen, belongs to it; others do not."""
    grounds, of = grounds_of([Thing(lambda frame: (0, 0, 0)), Thing(lambda frame: (1, 0, 0))], 1)
    seen = said(grounds[0], of[0], side=0.7)
    none = nobody(grounds[0])
    ObjectSearch(grounds).take(0, 0, seen, none, seen | (of[0] == 1))
    assert found(grounds[0], of[0]) == (1.0, 0.0)
