"""`--preset paper` from pixels to stored clips: what the points of the published method say happens to a model."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch

from engine.capture.clip import split_clips
from engine.cloud.motion.dedup import mean_neighbor_distance, union_distance
from engine.model.host_array import host_array
from engine.training.clip_training import ClipTraining
from engine.training.presets import preset
from tests.engine.training.tiny_training import Tiny, finish, make_training

SMALLER = {
    "static_feature_dim": 8,
    "dynamic_feature_dim": 8,
    "gaussians_per_anchor": 2,
    "head_hidden": 16,
    "field_hidden": 16,
    "field_levels": 3,
    "field_log2_entries": 10,
    "max_static_points": 600,
    "max_moving_points": 600,
    "joint_steps": 6,
    "source_steps": 6,
}
"""Sizes and steps alone; every decision is that of the preset."""


class Trained:
    """A reference clip and the next one, both before and after their training."""

    def __init__(self, tiny: Tiny, folder: Path) -> None:
        settings = {**preset("paper"), **SMALLER, "prep_dir": folder}
        first, second = split_clips(4, 2)
        self.reference = make_training(tiny.capture, tiny.holdout, clip=first, reference=None, **settings)
        self.reference.prepare()
        self.start = arrays_of(self.reference)
        self.reference_end = finish(self.reference).arrays
        self.reference_file = self.reference.finish()
        self.source = make_training(
            tiny.capture, tiny.holdout, clip=second, reference=self.reference_file.state, **settings
        )
        self.source.prepare()
        self.source_start = arrays_of(self.source)
        self.source_end = finish(self.source).arrays
        self.source_file = self.source.finish()


def arrays_of(training: ClipTraining) -> dict[str, np.ndarray]:
    return {name: host_array(value).copy() for name, value in training.model.state_dict().items()}


@pytest.fixture(scope="module")
def trained(tiny, tmp_path_factory) -> Trained:
    return Trained(tiny, tmp_path_factory.mktemp("paper"))


def outermost(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return points.min(0), points.max(0)


def test_one_cloud_of_all_frames_of_which_everything_changes_at_all_times(trained):
    assert trained.reference.phases == [("joint", SMALLER["joint_steps"])]
    assert trained.reference.model.roles() == ["static"]
    assert trained.source.model.roles() == ["static", "residual"]
    for arrays in (trained.start, trained.source_start):
        assert all(presence.all() for name, presence in arrays.items() if name.endswith(".presence"))
    assert trained.source.model.light is None


@pytest.mark.parametrize(("clip", "role"), [("start", "static"), ("source_start", "residual")])
def test_anchors_start_as_released(trained, clip, role):
    arrays = getattr(trained, clip)
    own = {name.split(".")[-1]: values for name, values in arrays.items() if name.startswith(f"sets.{role}.")}
    assert not own["features"].any()
    assert not own["color_logits"].any()
    among = np.concatenate([values for name, values in arrays.items() if name.endswith(".positions")])
    apart = np.linalg.norm(own["positions"][:, None] - among[None], axis=2)
    distances = np.sqrt((np.sort(apart, axis=1)[:, 1:4] ** 2).mean(1))  # the first one is the anchor itself
    for name in ("log_offset_scales", "log_base_scales"):
        np.testing.assert_allclose(np.exp(own[name]), np.repeat(distances[:, None], 3, axis=1), rtol=1e-4)


@pytest.mark.parametrize("clip", ["reference", "source"])
def test_the_field_spans_all_anchors_of_its_clip_and_its_features_are_not_negative(trained, clip):
    training, arrays = getattr(trained, clip), {"reference": trained.start, "source": trained.source_start}[clip]
    field = training.model.field
    lower, upper = outermost(np.concatenate([v for name, v in arrays.items() if name.endswith(".positions")]))
    shape = field.shape
    np.testing.assert_allclose(shape.bounds_min, lower, rtol=1e-5, atol=1e-5)
    np.testing.assert_allclose(np.asarray(shape.bounds_min) + shape.side * np.asarray(shape.aspect), upper, rtol=1e-4)
    assert 0.9e-4 < np.abs(arrays["field.tables.0"]).max() <= 1e-4
    corners = field.corners(training.model.anchor_set("static").positions.detach())
    with torch.no_grad():
        features = field(torch.arange(len(corners.indices)), corners, [(0, 1.0)])
    assert float(features.min()) == 0.0
    assert float(features.max()) > 0.0


def test_residual_anchors_lie_outside_the_spheres_of_all_inherited_ones(trained):
    inherited = trained.reference_file.state.arrays["sets.static.positions"]
    own = trained.source_start["sets.residual.positions"]
    assert len(own) > 0
    assert union_distance(own, inherited, mean_neighbor_distance(inherited)).min() > 0.0


def test_the_reference_learns_everything_and_a_source_clip_only_what_is_its_own(trained):
    after = arrays_of(trained.reference)
    fixed = {name for name in after if np.array_equal(after[name], trained.start[name])}
    assert fixed == {"sets.static.color_logits", "sets.static.presence"}
    after = arrays_of(trained.source)
    changed = {name for name in after if not np.array_equal(after[name], trained.source_start[name])}
    assert changed == {
        "sets.residual.positions", "sets.residual.features", "sets.residual.log_offset_scales",
        "sets.residual.log_base_scales", "field.tables.0", "field.hidden.weight", "field.out.weight"}  # fmt: skip


@pytest.mark.parametrize("clip", ["reference", "source"])
def test_what_is_stored_is_what_was_trained_bit_for_bit(trained, clip):
    stored = getattr(trained, f"{clip}_file").state.arrays
    for name, values in getattr(trained, f"{clip}_end").items():
        if name.startswith("field.tables"):  # entries that no anchor reads are left out
            is_kept = stored[name].any(-1)
            assert is_kept.any()
            assert np.array_equal(stored[name][is_kept], values[is_kept])
        else:
            assert np.array_equal(stored[name], values), name
