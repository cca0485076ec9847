"""Residual anchors within a budget, and what a clip says about how much of what moves has an anchor near it."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from engine.backends.table import backend_called
from engine.cloud.motion.moving_cloud import MovingCloud
from engine.model.anchors import AnchorSet
from engine.model.clip_model import ClipModel
from engine.training.config import TrainConfig
from engine.training.preparation.building import Coverage, add_residual
from engine.training.variants.variant_method import VariantMethod
from tests.engine.training.tiny_training import same_arrays

N_SIDE = 6


def scene() -> tuple[ClipModel, MovingCloud]:
    """Inherited anchors on a cube of voxels, and a clip in which as much again moves beside it.

    Every point is there in one of four frames, by its layer.
    """
    cube = np.stack(np.meshgrid(*[np.arange(N_SIDE)] * 3, indexing="ij"), -1).reshape(-1, 3).astype(np.float32)
    nobody = torch.zeros(len(cube), 4, dtype=torch.bool)
    moving = AnchorSet.from_cloud(
        torch.from_numpy(cube), torch.full((len(cube), 3), 0.5), spacing=1.0, feature_dim=16, presence=nobody
    )
    model = ClipModel(
        sets={"moving": moving},
        decoder=torch.nn.Module(),  # type: ignore[arg-type]
        field=None,
        clip_length=4,
        n_frames=4,
        backend=backend_called("cpu"),
    )
    points = np.concatenate([cube, cube + np.array([100, 0, 0], np.float32)])
    presence = (points[:, 2].astype(int) % 4)[:, None] == np.arange(4)
    return model, MovingCloud(points, np.full_like(points, 0.5), presence, 1.0)


N = N_SIDE**3


def test_without_need_every_point_outside_becomes_an_anchor():
    model, cloud = scene()
    coverage = add_residual(model, cloud, TrainConfig(max_moving_points=2 * N))
    assert coverage == Coverage(2 * N, N, N, 0, 1.0, "all of them")


def test_inherited_anchors_in_use_count_and_the_rest_is_left_to_anchors_beside_it():
    model, cloud = scene()
    coverage = add_residual(model, cloud, TrainConfig(max_moving_points=N + 120))
    residual = model.anchor_set("residual")
    assert (len(residual), coverage.n_residual, coverage.n_left_out) == (120, 120, N - 120)
    assert f"at most {N + 120} a clip, {N} inherited ones in use" in coverage.text
    assert f"{N - 120} points left to neighbouring anchors" in coverage.text
    assert residual.presence is not None
    # every point outside has, in its frame, an anchor no more than a voxel away
    new, frame = cloud.points[N:], cloud.presence[N:].argmax(1)
    distances = np.linalg.norm(new[:, None] - residual.positions.numpy()[None], axis=2)
    is_there = residual.presence.numpy().T[frame] & (distances <= 1.05)
    assert is_there.any(1).mean() == pytest.approx((coverage.share - 0.5) * 2)
    assert coverage.share > 0.97
    assert residual.presence.sum() > 120  # those left out are there in frames of their own


def test_the_busiest_frame_always_has_its_anchors():
    model, cloud = scene()
    coverage = add_residual(model, cloud, TrainConfig(max_moving_points=10))
    busiest = int(cloud.presence[N:].sum(0).max())
    assert (coverage.n_residual, coverage.reason) == (busiest, "as many as in the busiest frame")
    assert 0.5 < coverage.share < 1.0


@pytest.mark.parametrize(("residual", "n_residual", "share"), [("none", 0, 0.5), ("full", 2 * N, 1.0)])
def test_other_choices_know_no_budget(residual, n_residual, share):
    model, cloud = scene()
    config = TrainConfig(residual=residual, max_moving_points=10)
    coverage = add_residual(model, cloud, config, VariantMethod(config).choose_residual)
    assert (coverage.n_residual, coverage.n_left_out, coverage.share) == (n_residual, 0, share)


def test_a_clip_in_which_nothing_moves_is_covered():
    model, cloud = scene()
    nothing = MovingCloud(cloud.points[:0], cloud.colors[:0], cloud.presence[:0], 1.0)
    coverage = add_residual(model, nothing, TrainConfig())
    assert (coverage.n_points, coverage.n_residual, coverage.share) == (0, 0, 1.0)
    assert "residual" not in model.roles()


@pytest.mark.slow
def test_a_clip_keeps_its_coverage_through_a_checkpoint(tiny, tmp_path):
    said: list[str] = []
    first = tiny.prepared(1, max_moving_points=60, report=lambda progress: said.append(progress.message))
    coverage = first.state().header.coverage
    assert coverage.n_left_out > 0
    assert coverage.n_residual == len(first.model.anchor_set("residual"))
    assert any("within reach of an anchor" in line for line in said)
    first.step()
    first.write_checkpoint(tmp_path / "kept.safetensors")
    again = tiny.training(1, max_moving_points=60)
    again.restore_checkpoint(tmp_path / "kept.safetensors")
    first.step()
    again.step()
    assert again.state().header.coverage == coverage
    assert same_arrays(first.state().arrays, again.state().arrays)
    assert tiny.reference.header.coverage is None
