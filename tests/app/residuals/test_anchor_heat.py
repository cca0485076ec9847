"""Heat of anchors: maps spread by the weights of the picture, cameras one after another, and a reason for none."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from app.evaluation.headless import open_trained
from app.project.opening.project_access import open_project
from app.residuals.anchor_heat import MIN_PIXELS, cameras_around
from app.residuals.heat_map import LEVELS
from engine.metrics.clips.anchor_shares import anchor_shares, anchors_at
from engine.model.clip_view import render_gaussians, visible_rows
from tests.app.fakes import N_ANCHORS
from tests.app.residuals.conftest import until


def finished(opened, column: str, frame: int):
    opened.timeline.seek(frame)
    return until(
        lambda: opened.residuals.anchor_heat(opened.timeline, column),
        lambda heat: not heat.is_stale and heat.n_cameras == heat.n_cameras_all,
        opened,
    )


def test_shares_are_weights_of_the_picture(project):
    trained = open_trained(open_project(project, is_writable=False))
    loaded, rig = trained.load(1), trained.capture.rig
    height, width = int(rig.image_sizes[1][1]), int(rig.image_sizes[1][0])
    random = np.random.default_rng(0)
    maps = random.uniform(0, 9, (height, width, 2)).astype(np.float32)
    shares = anchor_shares(loaded, rig, 1, 0.0, maps)
    view = loaded.view(rig, 1)
    rows = visible_rows(loaded.model, view, 0.0, reach=loaded.reach)
    with torch.no_grad():
        alpha = render_gaussians(loaded.model.decode(0.0, rows), view, backend=loaded.model.backend).alpha[0].numpy()
    assert alpha.max() > 0.3
    np.testing.assert_allclose(shares.weights.sum(), alpha.sum(), rtol=1e-4)
    np.testing.assert_allclose(shares.sums.sum(0), (alpha * maps).sum((0, 1)), rtol=1e-4)
    even = anchor_shares(loaded, rig, 1, 0.0, np.full_like(maps, 3.0))
    np.testing.assert_allclose(even.sums[:, 0], 3.0 * even.weights, rtol=1e-3, atol=1e-3)
    rows_now, positions = anchors_at(loaded, 0.0)
    assert len(positions) == len(rows_now) == len(shares.weights) == 2 * N_ANCHORS


def test_only_the_anchors_behind_hot_pixels_are_hot(project):
    """A pixel heats the anchors that it shows, and hardly any other."""
    trained = open_trained(open_project(project, is_writable=False))
    loaded, rig = trained.load(0), trained.capture.rig
    rows, positions = anchors_at(loaded, 0.0)
    pose, K = rig.world_to_camera[1], rig.Ks[1]
    seen = (positions @ pose[:3, :3].T + pose[:3, 3]) @ K.T
    pixels = seen[:, :2] / seen[:, 2:]
    width, height = (int(side) for side in rig.image_sizes[1])
    maps = np.zeros((height, width, 2), np.float32)
    x, y = (int(value) for value in pixels[0])
    maps[y, x] = 1.0
    shares = anchor_shares(loaded, rig, 1, 0.0, maps)
    heat = shares.sums[rows, 0]
    distances = np.hypot(*(pixels - pixels[0]).T)
    assert heat[distances < 3].sum() > 0.5 * heat.sum() > 0


def test_means_over_cameras_are_those_of_the_maps(open_residuals):
    opened = open_residuals()
    heat = finished(opened, "error", 4)
    assert heat.n_cameras == 4
    assert heat.positions.shape == (2 * N_ANCHORS, 3)
    trained = open_trained(opened.project)
    loaded, rig = trained.load(1), opened.opened.rig
    sums, weights = np.zeros((2 * N_ANCHORS, 2)), np.zeros(2 * N_ANCHORS)
    for camera in range(4):
        error, excess = (opened.heat(camera, 4, kind).values for kind in ("error", "E"))
        shares = anchor_shares(loaded, rig, camera, 1 / 3, np.stack([error, excess], axis=2))
        sums, weights = sums + shares.sums, weights + shares.weights
    is_seen = weights >= MIN_PIXELS
    assert is_seen.any()
    np.testing.assert_allclose(heat.values[is_seen], (sums[:, 0] / weights)[is_seen], rtol=1e-5)
    assert np.isnan(heat.values[~is_seen]).all()
    excess = finished(opened, "E", 4)
    np.testing.assert_allclose(excess.values[is_seen], (sums[:, 1] / weights)[is_seen], rtol=1e-4, atol=1e-6)
    assert 0 < np.nanmean(heat.values) < LEVELS


def test_until_a_camera_was_looked_at_the_last_frame_is_stale(open_residuals):
    opened = open_residuals()
    assert opened.residuals.anchor_heat(opened.timeline, "error") is None
    first = finished(opened, "error", 0)
    opened.timeline.seek(4)
    stale = opened.residuals.anchor_heat(opened.timeline, "error")
    assert stale.is_stale
    assert stale.frame_index == 0
    np.testing.assert_array_equal(stale.values, first.values)
    assert finished(opened, "error", 4).frame_index == 4
    again = finished(opened, "error", 0)
    np.testing.assert_array_equal(again.values, first.values)


def test_a_reason_where_there_is_none(open_residuals, project):
    (project / "clips" / "0001.safetensors").unlink()
    opened = open_residuals()
    opened.timeline.seek(4)
    heat = opened.residuals.anchor_heat(opened.timeline, "error")
    assert (len(heat.values), "Clip 1" in heat.note) == (0, True)
    opened.timeline.seek(0)
    assert opened.residuals.anchor_heat(opened.timeline, "E").note.startswith("Frame 0")
    assert finished(opened, "error", 0).note == ""


def test_a_damaged_clip_is_a_reason(open_residuals, project):
    opened = open_residuals()
    (project / "clips" / "0001.safetensors").write_bytes(b"nothing")
    opened.timeline.seek(4)
    assert opened.residuals.anchor_heat(opened.timeline, "error") is None
    assert opened.residuals._anchors.worker.wait_idle(60.0)
    (failure,) = opened.residuals.take_failures()
    assert opened.residuals.anchor_heat(opened.timeline, "error").note == failure.error.message


@pytest.mark.parametrize("n_cameras", [1, 3, 9])
def test_the_first_cameras_stand_around_the_scene(open_residuals, n_cameras):
    rig = open_residuals().opened.rig  # four cameras on a circle
    chosen = cameras_around(rig, n_cameras)
    assert len(set(chosen)) == len(chosen) == min(n_cameras, 4)
    if n_cameras > 1:
        assert chosen[:2] == (0, 2), "first the one opposite"
