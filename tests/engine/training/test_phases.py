"""Phases of a training: their steps, and where a step lies."""

from __future__ import annotations

import pytest

from engine.training.config import TrainConfig
from engine.training.phases import phase_at, phases_of

SIZES = {"n_cameras": 3, "n_frames": 2, "n_windows": 1}


def test_a_reference_clip_has_three_phases_and_a_source_clip_one():
    config = TrainConfig(static_steps=5, joint_steps=7, source_steps=4)
    assert phases_of(config, **SIZES, is_source=False) == [("static", 5), ("joint", 4), ("moving", 3)]
    assert phases_of(config, **SIZES, is_source=True) == [("source", 4)]


def test_where_every_anchor_moves_no_phase_is_of_moving_ones_alone():
    config = TrainConfig(static_steps=5, joint_steps=8, gate="off")
    assert phases_of(config, **SIZES, is_source=False) == [("static", 5), ("joint", 8)]


@pytest.mark.parametrize(("is_source", "growth"), [(False, 3), (True, 9)])
def test_derived_steps_grow_with_pictures_and_given_ones_do_not(is_source: bool, growth: int):
    small, large = (
        sum(n for _, n in phases_of(TrainConfig(), **(SIZES | {"n_windows": n}), is_source=is_source)) for n in (1, 9)
    )
    assert large == growth * small
    given = phases_of(TrainConfig(static_steps=5, joint_steps=7), **(SIZES | {"n_windows": 9}), is_source=False)
    assert given == [("static", 5), ("joint", 4), ("moving", 3)]


@pytest.mark.parametrize(
    ("step", "expected"), [(0, (0, 0)), (4, (0, 4)), (5, (1, 0)), (11, (1, 6)), (12, (1, 7)), (20, (1, 15))]
)
def test_a_step_lies_in_one_phase_and_the_last_has_no_end(step, expected):
    assert phase_at([("static", 5), ("joint", 7)], step) == expected


def test_a_phase_without_steps_is_passed_over_unless_it_is_the_last():
    assert phase_at([("static", 0), ("joint", 7)], 0) == (1, 0)
    assert phase_at([("source", 0)], 0) == (0, 0)


def test_qualities_differ_in_derived_steps_alone():
    n_steps = {
        quality: sum(n for _, n in phases_of(TrainConfig(quality=quality), **SIZES, is_source=False))
        for quality in ("draft", "standard", "best")
    }
    assert n_steps == {"draft": 600, "standard": 1500, "best": 4500}
    given = TrainConfig(quality="best", static_steps=5, joint_steps=7)
    assert phases_of(given, **SIZES, is_source=False) == [("static", 5), ("joint", 4), ("moving", 3)]
