"""Trails: where Gaussians were, which of their ways are drawn, and how."""

from __future__ import annotations

import numpy as np
import pytest

from app.playback.modes.contents import EditedParts
from app.playback.modes.trails import N_TRAILS, TrailMaker, TrailRequest, paths_of, trail_lines
from engine.editing.actions import Hide
from engine.editing.edit import Edit, Everything, Scope
from engine.editing.effects import NO_EFFECTS, EditStack
from tests.app.playback.clip_models import CLIP, reference, source

WAIT_S = 300.0


def test_paths_are_where_the_gaussians_were() -> None:
    _, state = reference()
    model, own = source(state)
    part = EditedParts(model, CLIP, own, state).apart("dynamic")
    paths, opacities = paths_of(part, 2, [NO_EFFECTS] * 3)
    assert len(paths) == 3, "a trail does not leave its clip"
    for frame in range(3):
        np.testing.assert_array_equal(paths[frame], part.decode(CLIP.clip_time(frame)).gaussians.means.numpy())
    assert len(opacities) == paths.shape[1]


def test_a_path_begins_where_its_anchor_begins_to_exist() -> None:
    model, state = reference()  # its moving anchors exist in frames 0 and 2 only
    paths, opacities = paths_of(EditedParts(model, CLIP, state, None).apart("dynamic"), 2, [NO_EFFECTS] * 3)
    assert np.isnan(paths[1]).all()
    assert np.isfinite(paths[[0, 2]]).all()
    vertices, colors = trail_lines(paths, opacities)
    assert len(vertices) == len(colors) == 0, "no step of it is whole"


def test_a_path_has_a_gap_where_an_edit_hides_it() -> None:
    _, state = reference()
    model, own = source(state)
    part = EditedParts(model, CLIP, own, state).apart("dynamic")
    stack = EditStack((Edit(0, "", Everything(), Hide(), Scope(1, 2)),))
    plain, _ = paths_of(part, 2, [NO_EFFECTS] * 3)
    paths, _ = paths_of(part, 2, [stack.at(frame) for frame in range(3)])
    assert np.isfinite(plain[1]).any()
    assert np.isnan(paths[1]).all()
    np.testing.assert_array_equal(paths[[0, 2]], plain[[0, 2]])


def test_the_longest_trails_are_drawn_and_fade() -> None:
    n = N_TRAILS + 50
    speeds = np.random.default_rng(2).permutation(n).astype(np.float32)
    paths = np.zeros((3, n, 3), np.float32)
    paths[:, :, 0] = np.arange(3)[:, None] * speeds
    opacities = np.full(n, 0.9, np.float32)
    opacities[speeds == n - 1] = 0.05  # the fastest is hardly seen
    vertices, colors = trail_lines(paths, opacities)
    assert len(vertices) == 2 * 2 * N_TRAILS
    lengths = np.linalg.norm(vertices[1::2] - vertices[::2], axis=1)
    assert set(lengths) == set(range(n - 1 - N_TRAILS, n - 1))
    first, last = colors[0, 3], colors[-1, 3]
    assert first < 0.2
    assert last == 1.0


@pytest.mark.parametrize("n_frames", [1, 3])
def test_what_stands_still_has_no_trail(n_frames: int) -> None:
    vertices, colors = trail_lines(np.ones((n_frames, 5, 3), np.float32), np.ones(5))
    assert vertices.shape == (0, 3)
    assert colors.shape == (0, 4)


def test_trails_of_another_clip_are_not_shown() -> None:
    model, state = reference()
    parts, effects = EditedParts(model, CLIP, state, None), (NO_EFFECTS,) * 3
    maker = TrailMaker()
    try:
        request = TrailRequest("one", 2, effects, parts)
        assert maker.trails(request) is None
        assert maker.worker.wait_idle(WAIT_S)
        assert maker.worker.take_error() is None
        assert maker.trails(request) is not None
        assert maker.trails(TrailRequest("two", 2, effects, parts)) is None
    finally:
        maker.close()
