"""What can be seen and what hides behind something, on surfaces whose truth is known, and against a slow picture."""

from __future__ import annotations

import numpy as np
import pytest

from engine.conventions import ALPHA_MAX, ALPHA_MIN, EPS2D_PX2
from engine.editing.selection.projected import project_gaussians
from engine.editing.selection.share import ENOUGH, selected_share
from engine.editing.selection.visibility import seen_rows
from tests.engine.editing.selection.made_views import SIZE, scattered, slow_spread, view_at


def wall(depth: float, *, step: float = 0.1, half: float = 1.0, tilt: float = 0.0) -> tuple[np.ndarray, ...]:
    """Flat Gaussians on a square that faces the camera, leaning back by a tilt: means, quats, scales."""
    places = np.arange(-half, half + step / 2, step)
    x, y = (grid.reshape(-1) for grid in np.meshgrid(places, places))
    means = np.stack([x, y * np.cos(tilt), depth + y * np.sin(tilt)], axis=1)
    quat = [np.cos(tilt / 2), np.sin(tilt / 2), 0.0, 0.0]
    n = len(means)
    return tuple(
        np.ascontiguousarray(array, np.float32)
        for array in (means, np.tile(quat, (n, 1)), np.tile([0.7 * step, 0.7 * step, 1e-4], (n, 1)))
    )


def together(*parts: tuple[np.ndarray, ...]) -> tuple[tuple[np.ndarray, ...], list[slice]]:
    ends = np.cumsum([len(part[0]) for part in parts])
    slices = [slice(end - len(part[0]), end) for part, end in zip(parts, ends, strict=True)]
    return tuple(np.concatenate(arrays) for arrays in zip(*parts, strict=True)), slices


@pytest.mark.parametrize("set_back", [0.0, 2000.0], ids=["perspective", "orthographic"])
@pytest.mark.parametrize("tilt", [0.0, 0.9], ids=["facing", "leaning"])
def test_a_wall_hides_the_wall_behind_it(set_back: float, tilt: float) -> None:
    (means, quats, scales), (front, back) = together(wall(0.0, half=0.8, tilt=tilt), wall(0.3, half=0.7, tilt=tilt))
    view = view_at(set_back=set_back, near=0.01 + set_back)
    seen = seen_rows(project_gaussians(means, quats, scales, view), np.full(len(means), 0.95))
    assert seen[front].all()
    is_inner = (np.abs(means[back]) < 0.55).all(axis=1) if tilt == 0.0 else np.abs(means[back, 1]) < 0.25
    is_inner &= np.abs(means[back, 0]) < 0.55
    assert is_inner.sum() > 20
    assert not seen[back][is_inner].any()


def test_what_stands_out_beside_the_wall_or_shines_through_it_is_seen() -> None:
    (means, quats, scales), (front, back) = together(wall(0.0, half=0.4), wall(0.5, half=0.9))
    projected = project_gaussians(means, quats, scales, view_at())
    seen = seen_rows(projected, np.full(len(means), 0.95))
    is_beside = np.abs(means[back, 0]) > 0.65
    assert seen[back][is_beside].all()
    assert not seen[back][(np.abs(means[back, :2]) < 0.36).all(axis=1)].any()
    faint = np.where(np.arange(len(means)) < front.stop, 0.03, 0.95)
    assert seen_rows(projected, faint)[back].all()


def test_a_thick_surface_is_seen_as_a_whole() -> None:
    """Trained surfaces are some Gaussians deep; what lies within their thickness belongs to what is seen."""
    rng = np.random.default_rng(0)
    n = 600
    means = np.stack([*rng.uniform(-0.6, 0.6, (2, n)), rng.normal(0.0, 0.02, n)], axis=1).astype(np.float32)
    quats, scales = rng.normal(size=(n, 4)).astype(np.float32), np.full((n, 3), 0.06, np.float32)
    seen = seen_rows(project_gaussians(means, quats, scales, view_at()), np.full(n, 0.9))
    assert seen.mean() > 0.98


def test_nothing_is_seen_that_is_behind_too_near_too_faint_or_not_finite() -> None:
    means = np.array([[0, 0, -9], [0, 0, -3.5], [0, 0, 0], [np.nan, 0, 0]], np.float32)
    quats, scales = np.tile(np.eye(4, dtype=np.float32)[0], (4, 1)), np.full((4, 3), 0.1, np.float32)
    projected = project_gaussians(means, quats, scales, view_at(near=1.0))
    assert seen_rows(projected, np.full(4, 0.5)).tolist() == [False, False, True, False]
    assert not seen_rows(projected, np.full(4, 0.5 * ALPHA_MIN)).any()
    assert not seen_rows(projected, np.full(4, np.nan)).any()


def test_the_share_of_what_is_selected_in_every_pixel() -> None:
    means, quats, scales, opacities = scattered(60, spread=0.4)
    view = view_at()
    rng = np.random.default_rng(1)
    selected = rng.random(60) < 0.4
    share = selected_share(project_gaussians(means, quats, scales, view), opacities, selected)
    truth, left = np.zeros((SIZE[1], SIZE[0])), np.ones((SIZE[1], SIZE[0]))
    for i in np.argsort(means[:, 2]):
        center, spread = slow_spread(means[i], quats[i], scales[i], view)
        if center[2] <= view.near:
            continue
        inverse = np.linalg.inv(spread[:2, :2] + EPS2D_PX2 * np.eye(2))
        off = np.stack(np.meshgrid(np.arange(SIZE[0]) + 0.5, np.arange(SIZE[1]) + 0.5), axis=2) - center[:2]
        alpha = opacities[i] * np.exp(-0.5 * np.einsum("hwi,ij,hwj->hw", off, inverse, off))
        alpha = np.where((alpha >= ALPHA_MIN) & (left > ENOUGH), np.minimum(alpha, ALPHA_MAX), 0.0)
        truth += alpha * left * selected[i]
        left *= 1.0 - alpha
    assert truth.max() > 0.3
    np.testing.assert_allclose(share, truth, atol=2e-3)
    assert not selected_share(project_gaussians(means, quats, scales, view), opacities, np.zeros(60, bool)).any()
