"""Anchors of source clips that travel."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from engine.clip_files.anchor_record import read_records
from engine.cloud.motion.moving_cloud import MovingCloud
from engine.model.reading import inherit
from engine.training.config import TrainConfig
from engine.training.optimizer.optimizer import named_parameters
from engine.training.preparation.building import adapt_moving, add_residual
from tests.engine.training.test_coverage import N, scene


def travelling_scene():
    model, cloud = scene()
    numbers = np.arange(2 * N, dtype=np.float32)
    motion = numbers % 4, np.stack([numbers, 0 * numbers, -numbers], 1), np.full((2 * N, 3), 0.5, np.float32)
    return model, MovingCloud(cloud.points, np.full_like(cloud.points, 0.25), cloud.presence, 1.0, motion)


def test_all_points_that_travel_become_anchors_and_inherited_ones_stay_behind():
    model, cloud = travelling_scene()
    coverage = add_residual(model, cloud, TrainConfig(max_moving_points=2 * N))
    adapt_moving(model)
    assert model.roles() == ["residual"]
    assert (coverage.n_points, coverage.n_inherited, coverage.n_residual) == (2 * N, N, 2 * N)
    residual = model.anchor_set("residual")
    assert residual.is_trainable
    assert not residual.features.any(), "an inherited anchor was on something else"
    np.testing.assert_array_equal(residual.positions.numpy(), cloud.points)
    assert residual.presence is not None
    np.testing.assert_array_equal(residual.presence.numpy(), cloud.presence)
    motion = residual.motion
    assert motion is not None
    assert cloud.motion is not None
    found = (motion.birth_frames, motion.velocities, motion.accelerations)
    for ours, truth in zip(found, cloud.motion, strict=True):
        np.testing.assert_array_equal(ours.detach().numpy(), truth)


def test_some_points_of_a_cloud_keep_their_motion():
    _, cloud = travelling_scene()
    rows = np.flatnonzero(cloud.points[:, 0] == 3)
    some = cloud.chosen(rows)
    assert some.motion is not None
    assert cloud.motion is not None
    for ours, all_of_them in zip(some.motion, cloud.motion, strict=True):
        np.testing.assert_array_equal(ours, all_of_them[rows])
    still = MovingCloud(cloud.points, cloud.colors, cloud.presence, 1.0)
    assert still.chosen(rows).motion is None


@pytest.mark.parametrize(
    ("settings", "travels"),
    [
        ({}, True),
        ({"motion": "stay"}, False),
        ({"inherit": "frozen"}, False),  # frozen anchors are places
        ({"gate": "static"}, False),
        ({"gate": "off"}, False),
        ({"field": "continue"}, False),
        ({"independent": True, "start": "previous"}, False),
        ({"inherit": "trainable"}, False),
        ({"inherit": "off"}, True),
        ({"residual": "none"}, False),
        ({"residual": "full"}, True),
        ({"independent": True}, True),
    ],
)
def test_when_anchors_travel(settings, travels):
    assert TrainConfig(**settings).anchors_travel == travels


def test_rates_of_motion_are_in_spacings():
    model, cloud = travelling_scene()
    add_residual(model, cloud, TrainConfig())
    gains = torch.nn.Parameter(torch.ones(1, 3))
    model.decoder.head_parameters = lambda head: []
    one, two = (
        {name: rate for name, (_, rate) in named_parameters(model, gains, TrainConfig(), spacing=spacing).items()}
        for spacing in (1.0, 2.0)
    )
    changed = {name for name, rate in two.items() if rate != one[name]}
    assert changed == {"sets.residual.velocities", "sets.residual.accelerations"}


@pytest.mark.slow
def test_clips_travel_and_are_read_as_they_were_written(tiny):
    own = read_records(tiny.reference.arrays)["moving"].own
    assert own is not None
    assert own.velocities is not None
    sets, _, _ = inherit(tiny.reference, {"moving": torch.ones(len(own), 4, dtype=torch.bool)})
    assert sets["moving"].motion is None, "they travelled with what the reference clip shows"
    training = tiny.prepared(1)
    assert any(training.model.anchor_set(role).travels for role in training.model.roles())
    training.step()
