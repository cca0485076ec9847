"""Early stop: which pictures are kept out, when a figure has stalled, and how a phase then ends."""

from __future__ import annotations

import json
from collections import Counter

import numpy as np
import pytest
import torch
from torch import nn

from engine.training import clip_training
from engine.training.config import TrainConfig
from engine.training.optimizer.optimizer import PhaseOptimizer
from engine.training.step.early_stopping import Patience, held_in_items, steps_to_finish
from tests.engine.training.tiny_training import finish, same_arrays, take_steps


@pytest.mark.parametrize(
    ("n_cameras", "n_frames", "expected"), [(27, 10, 6), (18, 10, 4), (2, 1, 1), (8, 4, 4), (6, 1, 3), (40, 30, 24)]
)
def test_pictures_kept_out_are_few_and_spread_over_cameras_and_frames(n_cameras, n_frames, expected):
    items = held_in_items(n_cameras, n_frames, seed=3)
    assert items == held_in_items(n_cameras, n_frames, seed=3)
    assert len(items) == len(set(items)) == expected
    for parts, n in zip(
        zip(*(divmod(item, n_frames) for item in items), strict=True), (n_cameras, n_frames), strict=True
    ):
        assert all(0 <= part < n for part in parts)
        assert max(Counter(parts).values()) <= -(-expected // n)


def test_another_seed_keeps_other_pictures_out():
    assert held_in_items(27, 10, seed=0) != held_in_items(27, 10, seed=1)


def test_patience_ends_once_after_so_many_looks_without_a_rise():
    patience = Patience(2)
    assert [patience.saw(psnr) for psnr in (20.0, 21.0, 21.01, 21.05, 21.06, 21.0, 20.0)] == [
        False,
        False,
        False,  # a rise too small counts as none
        False,
        False,
        True,
        False,
    ]
    assert patience.best == 21.05


def test_patience_goes_on_exactly():
    patience, resumed = Patience(2), Patience(2)
    resumed.restore(json.loads(json.dumps(patience.state())))
    assert resumed.saw(20.0) is False
    patience.saw(20.0)
    patience.saw(19.0)
    resumed.restore(json.loads(json.dumps(patience.state())))
    assert patience.saw(18.0)
    assert resumed.saw(18.0)


@pytest.mark.parametrize(("done", "n_steps", "expected"), [(1000, 6000, 200), (5900, 6000, 100), (1, 2, 1), (5, 5, 0)])
def test_a_fifth_of_what_was_done_is_left_at_most(done, n_steps, expected):
    assert steps_to_finish(done, n_steps) == expected


def test_rates_fall_to_their_end_from_where_they_are():
    config = TrainConfig()

    def optimizer() -> PhaseOptimizer:
        parameters = {"a": (nn.Parameter(torch.zeros(2)), 0.1)}
        return PhaseOptimizer(parameters, n_steps=100, config=config, backend="reference")

    cut = optimizer()
    cut.steps_done = 50
    before = cut.share_done
    cut.finish_within(10)
    assert cut.n_steps == 60
    assert cut.share_done == pytest.approx(before)
    shares = []
    for cut.steps_done in range(50, 61):
        shares.append(cut.share_done)
    assert shares[-1] == pytest.approx(1.0)  # the rates end where they always do
    assert np.ptp(np.diff(shares)) < 1e-9
    resumed = optimizer()
    resumed.n_steps, resumed.steps_done, resumed.schedule = 60, 55, json.loads(json.dumps(cut.schedule))
    assert resumed.share_done == shares[5]


# ---------------------------------------------------------------- in a training


@pytest.fixture
def often(monkeypatch):
    """Looks at every second step."""
    monkeypatch.setattr(clip_training, "MEASURE_EVERY", 2)


def drawn_items(training) -> set[int]:
    """Pictures that a training has drawn in its phase."""
    return set(training._items)


def test_pictures_kept_out_are_never_drawn(tiny):
    training = tiny.prepared(1, patience=3)
    kept_out = held_in_items(8, 4, training.seed)
    assert not drawn_items(training) & set(kept_out)
    assert drawn_items(training) | set(kept_out) == set(range(32))
    assert np.isfinite(training.held_in_psnr())
    assert drawn_items(tiny.prepared(1)) == set(range(32))  # off: every picture is trained on


def test_a_stalled_clip_ends_early_with_all_of_the_schedule(tiny, often):
    said = []
    training = tiny.prepared(1, patience=1, source_steps=40, report=said.append)
    training.held_in_psnr = lambda: 20.0  # does not rise: the second look, after step 4, is one too many
    stats = take_steps(training, 4)
    assert stats.n_steps == 5
    finish(training)
    assert training.steps_done == 5
    assert training.state().header.n_steps == 5
    assert training._optimizer.share_done == pytest.approx(1.0)
    assert any(progress.stage == "Early stop" and "instead of 36" in progress.message for progress in said)


def test_a_clip_that_gains_is_not_cut_short(tiny, often):
    rising = iter(range(100))
    training = tiny.prepared(1, patience=1, source_steps=12)
    training.held_in_psnr = lambda: float(next(rising))
    finish(training)
    assert training.steps_done == 12


def test_a_stop_after_the_stall_goes_on_to_the_same_bits(tiny, often, tmp_path):
    settings = {"patience": 2, "source_steps": 60}

    def stalled():
        training = tiny.prepared(1, **settings)
        training.held_in_psnr = lambda: 20.0
        return take_steps(training, 10)

    whole = stalled()
    assert whole.n_steps < 60
    kept = tmp_path / "kept.safetensors"
    whole.write_checkpoint(kept)
    resumed = tiny.training(1, **settings)
    resumed.restore_checkpoint(kept)
    assert resumed.n_steps == whole.n_steps
    finish(whole)
    finish(resumed)
    assert same_arrays(whole.state().arrays, resumed.state().arrays)
