"""Coarse to fine: exact half-size truths and cameras, the steps that see them, and going on from a checkpoint."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from engine.camera.rig import CameraRig
from engine.errors import ProjectError
from engine.training.config import TrainConfig
from engine.training.step.half_size import HalfSize
from tests.engine.training.tiny_training import same_arrays, take_steps

pytestmark = pytest.mark.slow


def rig(width: int, height: int) -> CameraRig:
    K = np.array([[50.0, 1.0, 7.5], [0.0, 60.0, 4.5], [0.0, 0.0, 1.0]])
    return CameraRig(("a",), np.eye(4)[None], K[None], np.array([[width, height]]))


def test_a_half_size_truth_is_the_mean_of_what_it_covers_and_counts_where_all_of_it_does():
    rng = np.random.default_rng(0)
    pixels = rng.integers(0, 256, (10, 16, 3), dtype=np.uint8)
    is_counted = rng.random((10, 16)) < 0.8
    half = HalfSize(rig(16, 10), near_plane=0.1)
    truth, counted = half.truth(3, pixels, is_counted)
    blocks = pixels.reshape(5, 2, 8, 2, 3).astype(float).mean((1, 3))
    assert truth.dtype == np.uint8
    assert np.abs(truth - blocks).max() <= 0.5  # rounded to a byte
    assert counted is not None
    assert np.array_equal(counted, is_counted.reshape(5, 2, 8, 2).all((1, 3)))
    assert 0 < counted.sum() < counted.size
    assert half.truth(3, pixels, is_counted)[0] is truth  # kept
    assert half.truth(4, pixels, None)[1] is None


@pytest.mark.parametrize(("width", "height"), [(16, 10), (17, 11)])
def test_a_point_lies_at_the_same_place_of_both_pictures(width, height):
    given = rig(width, height)
    made = HalfSize(given, near_plane=0.1)
    (view,) = made.views
    assert (view.width, view.height) == (8, 5)
    assert made.truth(0, np.zeros((height, width, 3), np.uint8), None)[0].shape == (5, 8, 3)
    point = np.array([0.3, -0.2, 2.0])
    full, half = given.Ks[0] @ point, view.K.numpy() @ point
    assert half[:2] / half[2] == pytest.approx(full[:2] / full[2] / 2, abs=1e-6)  # K is float32


def test_the_first_steps_of_every_phase_are_drawn_at_half_size(tiny, tmp_path):
    settings = {"static_steps": 4, "joint_steps": 6, "coarse_share": 0.5, "max_static_points": 200}
    training = tiny.prepared(0, is_source=False, prep_dir=tmp_path, **settings)
    is_half = []
    while not training.is_finished:
        training.step()
        is_half.append(training._half is not None)
    assert is_half == [True] * 2 + [False] * 2 + [True] * 3 + [False] * 3


@pytest.mark.parametrize("tiles", ["active", "all"])
def test_the_same_is_learned_with_active_tiles(tiny, tiles):
    training = take_steps(tiny.prepared(1, coarse_share=0.5, tiles=tiles), 6)
    every = take_steps(tiny.prepared(1, coarse_share=0.5, tiles="all"), 6)
    full = take_steps(tiny.prepared(1, tiles=tiles), 6)
    assert same_arrays(training.state().arrays, every.state().arrays)
    assert not same_arrays(training.state().arrays, full.state().arrays)


@pytest.mark.parametrize("n_before", [2, 3, 4])  # of six steps three are at half size
def test_going_on_from_a_checkpoint_is_exact(tiny, tmp_path, n_before):
    straight = take_steps(tiny.prepared(1, coarse_share=0.5), 6)
    stopped = take_steps(tiny.prepared(1, coarse_share=0.5), n_before)
    stopped.write_checkpoint(tmp_path / "kept.safetensors")
    resumed = tiny.training(1, coarse_share=0.5)
    resumed.restore_checkpoint(tmp_path / "kept.safetensors")
    assert (resumed._half is not None) == (n_before < 3)
    take_steps(resumed, 6 - n_before)
    assert same_arrays(straight.state().arrays, resumed.state().arrays)


def test_early_stop_looks_at_pictures_only_after_the_steps_at_half_size(tiny, monkeypatch):
    monkeypatch.setattr("engine.training.clip_training.MEASURE_EVERY", 1)
    training = tiny.prepared(1, coarse_share=0.5, source_steps=8, patience=100)
    looked: list[int] = []
    monkeypatch.setattr(training, "held_in_psnr", lambda: looked.append(training.steps_done) or 20.0)
    take_steps(training, 8)
    assert looked == [5, 6, 7]


def test_a_share_is_between_none_and_all():
    assert [TrainConfig(coarse_share=share).n_coarse_steps(1000) for share in (0.0, 0.25, 1.0)] == [0, 250, 1000]
    with pytest.raises(ProjectError, match=r"coarse_share is 1\.5"):
        TrainConfig(coarse_share=1.5)


def test_pixels_without_truth_leave_no_gradient_at_half_size(tiny, tmp_path):
    training = tiny.prepared(0, is_source=False, prep_dir=tmp_path, coarse_share=1.0, static_steps=4)
    training.backgrounds.is_stable[:] = False
    before = {name: value.clone() for name, value in training.model.state_dict().items()}
    training.config = TrainConfig(**{**training.config.difference(), "volume_weight": 0.0})
    training.step()
    assert all(torch.equal(value, before[name]) for name, value in training.model.state_dict().items())
