"""The points of the published method: complete, true of the preset, and true of the code wherever that differs."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
import torch
from torch import nn

from engine.backends.backend import ADAM_EPSILON
from engine.backends.table import backend_called
from engine.camera.depth_range import NEAR_SHARE
from engine.clip_files.clip_header import FieldShape
from engine.cloud.fusion import N_PLANE_NEIGHBORS, Samples, fuse_tiers
from engine.cloud.motion.dedup import residual_rows
from engine.cloud.stereo.depth.depth_scene import WORKING_PIXELS
from engine.cloud.stereo.frames_cloud import FRAME_SPACING_PX
from engine.conventions import ALPHA_MAX, ALPHA_MIN
from engine.model.anchors import AnchorSet
from engine.model.clip_view import REACH_SPACINGS
from engine.model.decoder import Decoder
from engine.model.field import SpatioTemporalField
from engine.model.field_sizes import derive_cells
from engine.model.grid import corner_table, time_keys
from engine.training.config import SETTINGS, TrainConfig
from engine.training.optimizer.optimizer import PhaseOptimizer, schedule_of
from engine.training.plan.synthetic_clip import ClipRecipe, make_clip, make_view
from engine.training.presets import preset
from engine.training.published.point import Point
from engine.training.published.points import POINTS
from engine.training.step.order import ShuffledOrder
from engine.training.step.visible_anchors import Sight
from engine.training.windows import Windows

PAPER = TrainConfig(**preset("paper"))
DIFFERENCES = [point for point in POINTS if point.is_difference]


def test_every_setting_that_is_named_has_that_value_in_the_preset():
    for point in POINTS:
        assert point.settings.keys() <= SETTINGS.keys(), point.name
        for name, value in point.settings.items():
            assert getattr(PAPER, name) == value, f"{point.name}: {name}"


def test_every_setting_that_the_preset_changes_is_explained():
    explained = {name for point in POINTS for name in point.settings}
    assert PAPER.difference().keys() - explained == set()


def test_points_say_all_that_their_kind_needs():
    assert len({point.name for point in POINTS}) == len(POINTS)
    for point in POINTS:
        needed = {
            "both": [point.paper],
            "paper": [point.paper],
            "released code": [point.released],
            "neither": [point.paper or point.released, point.here, point.reason],
        }[point.follows]
        assert all(needed), point.name
        assert bool(point.here) == point.is_difference, point.name
        if point.follows == "both":
            assert not point.is_difference, point.name
        if point.follows == "paper":  # else it would be both
            assert point.released, point.name
            assert point.reason, point.name


def field_shape(n_knots: int = 3) -> FieldShape:
    cells = derive_cells(side=1.0, spacing=0.0, base=16, growth=2.0, max_levels=3)
    return FieldShape(
        n_knots=n_knots, cells=cells, n_entries=2**10, channels=4, hidden=128, feature_dim=64,
        bounds_min=(0.0, 0.0, 0.0), side=1.0, is_shared=True)  # fmt: skip


def knots_lie_on_frames() -> None:
    field = SpatioTemporalField(field_shape(n_knots=10))
    assert [field.knots(frame / 10, 10) for frame in range(10)] == [[(frame, 1.0)] for frame in range(10)]
    corners = field.corners(torch.rand(5, 3))
    assert corners.indices.shape == (5, 3, 8)


def cells_double_from_sixteen_and_space_is_hashed_apart_from_time() -> None:
    assert field_shape().cells == (16, 32, 64)
    n_entries, places = 2**17, np.random.default_rng(1).random((50, 3))
    corners, keys = corner_table(places, (32,), n_entries), time_keys((32,), n_entries, 10)
    assert 33**3 < n_entries < 10 * 33**3
    assert int(corners.indices.max()) < 33**3
    assert keys[1, 0] == 3674653429 % n_entries


def the_field_is_float32_and_starts_as_released() -> None:
    field = SpatioTemporalField(field_shape(), torch.Generator().manual_seed(1), is_published=True)
    for layer in (field.hidden, field.out):
        bound = math.sqrt(6.0 / (layer.in_features + layer.out_features))
        assert layer.weight.dtype == torch.float32
        assert 0.95 * bound < float(layer.weight.detach().abs().max()) <= bound


def places_outside_are_the_nearest_inside() -> None:
    outside, border = (corner_table(np.array([[x, 0.5, 0.5]]), (16,), 2**14) for x in (1.7, 1.0))
    assert torch.equal(outside.indices, border.indices)
    assert torch.equal(outside.weights, border.weights)


def anchors_have_six_scales() -> None:
    points, colors = torch.rand(4, 3), torch.rand(4, 3)
    anchors = AnchorSet.from_cloud(points, colors, spacing=0.1, feature_dim=8, presence=None)
    assert {name for name, _ in anchors.named_parameters()} == {"features", "log_offset_scales", "log_base_scales"}
    assert anchors.log_offset_scales.shape == anchors.log_base_scales.shape == (4, 3)


def heads_are_equally_wide() -> None:
    decoder = Decoder(static_dim=64, dynamic_dim=64, gaussians_per_anchor=10, hidden=PAPER.head_hidden)
    assert {decoder.first[head].shape[1] for head in decoder.first} == {256}


def depth_maps_are_as_small_as_said() -> None:
    assert WORKING_PIXELS == 160 * 90


def noise_is_flattened() -> None:
    points = np.random.default_rng(1).normal(size=(2000, 3)) * [1.0, 1.0, 0.02]
    flat = fuse_tiers([Samples(points, np.tile([0.0, 0.0, 1.0], (2000, 1)), points)], spacing=0.1)[0]
    assert flat[:, 2].std() < 0.5 * points[:, 2].std()
    assert N_PLANE_NEIGHBORS == 20


def voxels_are_four_pixels() -> None:
    assert FRAME_SPACING_PX == 4.0


def coverage_is_the_union() -> None:
    centers, radii = np.array([[0.0, 0, 0], [1.0, 0, 0]]), np.array([0.9, 0.05])
    candidates = np.array([[0.8, 0, 0], [0.901, 0, 0]])  # nearest to the small sphere, the first one in the large one
    assert residual_rows(candidates, centers, radii).tolist() == [False, True]


def passes_follow_each_other() -> None:
    order = ShuffledOrder(5, seed=1)
    drawn = [order.draw() for _ in range(10)]
    assert sorted(drawn[:5]) == sorted(drawn[5:]) == list(range(5))


def large_pictures_are_cut_into_windows() -> None:
    assert [len(Windows(*size)) for size in ((640, 480), (1920, 1080))] == [1, 8]
    assert PAPER.n_source_steps(10, 8) == 8 * PAPER.n_source_steps(10)


def optimizer(n_steps: int) -> tuple[PhaseOptimizer, nn.Parameter]:
    parameter = nn.Parameter(torch.ones(3))
    schedule = schedule_of({"x": (parameter, 0.1)}, PAPER, n_steps=n_steps)
    return PhaseOptimizer({"x": parameter}, schedule=schedule, backend=backend_called("reference")), parameter


def rates_end_with_the_clip() -> None:
    made, parameter = optimizer(4)
    for _ in range(4):
        parameter.grad = torch.ones(3)
        made.step()
    assert made.steps_done == 4


def gradients_are_taken_as_they_are_or_stop_the_training() -> None:
    made, parameter = optimizer(4)
    assert schedule_of({}, PAPER, n_steps=4).max_gradient_norm == 0.0
    parameter.grad = torch.tensor([1.0, float("nan"), 1.0])
    assert not made.step().isfinite()
    assert torch.equal(parameter.detach(), torch.ones(3))


def adam_divides_by_what_is_said() -> None:
    assert ADAM_EPSILON == 1e-15


def anchors_beside_the_picture_are_decoded() -> None:
    assert REACH_SPACINGS == 4.0
    model, view = make_clip(ClipRecipe(40), backend=backend_called("cpu")), make_view(ClipRecipe(40))
    sight = Sight(model, [view], reach=0.1)
    before = {role: reaches.clone() for role, reaches in sight.reaches.items()}
    for role in model.roles():
        model.anchor_set(role).log_offset_scales.data += 5.0
    sight.rows(0, 0.5)
    assert all(torch.equal(sight.reaches[role], reaches) for role, reaches in before.items())


def limits_of_the_rasterizer_are_those() -> None:
    assert (ALPHA_MAX, ALPHA_MIN, NEAR_SHARE) == (0.999, 1 / 255, 0.2)


CHECKS: dict[str, Callable[[], None]] = {
    "scales of an anchor": anchors_have_six_scales,
    "knots in time": knots_lie_on_frames,
    "cells of a level": cells_double_from_sixteen_and_space_is_hashed_apart_from_time,
    "numbers in the field": the_field_is_float32_and_starts_as_released,
    "outside of the box": places_outside_are_the_nearest_inside,
    "head of offsets": heads_are_equally_wide,
    "stereo": depth_maps_are_as_small_as_said,
    "noise of the point clouds": noise_is_flattened,
    "density of the point clouds": voxels_are_four_pixels,
    "deduplication": coverage_is_the_union,
    "what a step compares": large_pictures_are_cut_into_windows,
    "end of a pass": passes_follow_each_other,
    "where rates end": rates_end_with_the_clip,
    "gradients": gradients_are_taken_as_they_are_or_stop_the_training,
    "Adam": adam_divides_by_what_is_said,
    "what a camera decodes": anchors_beside_the_picture_are_decoded,
    "rasterizer": limits_of_the_rasterizer_are_those,
}
"""What the code does now, by the name of the point that says so: a point whose check fails is out of date."""

NOT_CHECKED = {"cameras and pictures", "parts without effect"}
"""Absence, and what lies before a training: nothing that a line of code could show."""


@pytest.mark.parametrize("point", DIFFERENCES, ids=lambda point: point.name)
def test_a_difference_is_still_there(point: Point):
    if check := CHECKS.get(point.name):
        check()
    else:
        assert point.settings or point.name in NOT_CHECKED, "neither a setting nor a check holds it"


def test_no_check_is_left_over():
    assert CHECKS.keys() | NOT_CHECKED <= {point.name for point in DIFFERENCES}
