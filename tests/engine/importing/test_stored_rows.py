"""Frames as a clip stores them: bit for bit, still rows once, and rows that are the same Gaussian as one."""

from __future__ import annotations

import numpy as np
import pytest

from engine.backends.table import backend_called
from engine.capture.clip import Clip
from engine.clip_files.anchor_record import RecordError
from engine.clip_files.clip_state import ClipState
from engine.clip_files.stored_gaussians import StoredGaussians, read_stored
from engine.export.splats import Splats
from engine.importing.stored_clip import stored_clip
from engine.importing.stored_rows import stored_gaussians
from engine.model.clip_model import ClipModel
from engine.model.reading import load_clip_model
from tests.engine.export.scenes import chance_splats
from tests.engine.importing.frames import moving_frames, values


def loaded(frames: list[Splats]) -> tuple[ClipState, ClipModel]:
    n = len(frames)
    state = stored_clip(Clip(0, 0, n, n), stored_gaussians(frames), views=["a"])
    return state, load_clip_model(state, None, backend=backend_called("reference"))


def check_bits(frames: list[Splats]) -> tuple[ClipState, ClipModel]:
    """Every frame decodes to exactly what it was."""
    state, model = loaded(frames)
    for frame, splats in enumerate(frames):
        found = Splats.of(model.decode(frame / len(frames)))
        np.testing.assert_array_equal(found.means[np.lexsort(found.means.T)], splats.means[np.lexsort(splats.means.T)])
        np.testing.assert_allclose(values(found), values(splats), atol=2e-7)  # rotations are normalised again
    return state, model


def test_rows_in_order_are_gaussians_throughout():
    state, model = check_bits(moving_frames(5))
    assert state.header.n_anchors == {"static": 40, "moving": 20}
    assert model.n_constant_rows() == 40
    way = model.positions("moving", 0.8) - model.positions("moving", 0.0)
    np.testing.assert_allclose(way.numpy(), 0.04, atol=1e-5)


def test_rows_that_come_and_go_are_known_by_what_does_not_change():
    frames = [
        splats[np.random.default_rng(frame).permutation(60 - frame)] for frame, splats in enumerate(moving_frames(4))
    ]
    state, model = check_bits(frames)
    assert state.header.n_anchors == {"static": 40, "moving": 20}
    assert [len(model.alive("moving", frame / 4)) for frame in range(4)] == [20, 19, 18, 17]


def test_an_order_by_chance_is_seen_and_does_not_mix_gaussians():
    frames = [splats[np.random.default_rng(frame).permutation(60)] for frame, splats in enumerate(moving_frames(4))]
    state, _ = check_bits(frames)
    assert state.header.n_anchors == {"static": 40, "moving": 20}


def test_gaussians_that_lie_on_each_other_stay_two():
    splats = chance_splats(8)
    doubled = splats[np.array([0, 0, 0, 1, 2, 3])]
    state, _ = check_bits([doubled, splats[np.array([0, 0, 4])], doubled])
    assert state.header.n_anchors["static"] == 2


def test_a_track_that_is_nowhere_is_refused():
    stored = stored_gaussians(moving_frames(3))
    arrays = StoredGaussians(stored.still, stored.moving, np.pad(stored.presence, ((0, 1), (0, 0)))).arrays()
    with pytest.raises(RecordError, match="in none of its frames"):
        read_stored(arrays, 3)


@pytest.mark.parametrize("n_empty", [1, 3])
def test_frames_without_gaussians(n_empty: int):
    splats = moving_frames(3)
    for frame in range(n_empty):
        splats[frame] = splats[frame][:0]
    state, model = check_bits(splats)
    assert state.header.n_anchors["static"] == 0
    assert len(model.decode(0.0)) == 0
