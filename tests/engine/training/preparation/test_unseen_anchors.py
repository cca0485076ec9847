"""Anchors that no pixel showed get the look of a usual neighbour, and the others stay as they are."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from engine.backends.table import backend_called
from engine.model.anchors import AnchorSet
from engine.model.clip_model import ClipModel
from engine.model.decoder import Decoder
from engine.training.preparation.unseen_anchors import FAINT, continue_unseen

N, N_UNSEEN = 200, 30


@pytest.fixture
def model() -> ClipModel:
    """A wall of anchors with features, some of which have drifted away."""
    generator = torch.Generator().manual_seed(0)
    points = torch.rand(N, 3, generator=generator) * torch.tensor([4.0, 3.0, 0.01])
    anchors = AnchorSet.from_cloud(points, torch.full((N, 3), 0.4), spacing=0.2, feature_dim=8, presence=None)
    with torch.no_grad():
        anchors.features.copy_(0.1 * torch.randn(N, 8, generator=generator))
        anchors.features[:N_UNSEEN] = 30.0
        anchors.log_base_scales[:N_UNSEEN] -= 5.0
    decoder = Decoder(static_dim=8, dynamic_dim=4, gaussians_per_anchor=3, hidden=16, generator=generator)
    backend = backend_called("cpu")
    return ClipModel(sets={"static": anchors}, decoder=decoder, field=None, clip_length=4, n_frames=4, backend=backend)


def squares(n_unseen: int) -> np.ndarray:
    """Mean squares of gradients: those of the first ones are a hundredth of what counts as seen."""
    found = np.random.default_rng(0).uniform(0.5, 2.0, (N, 8))
    found[:n_unseen] *= (0.1 * FAINT) ** 2
    return found.astype(np.float32)


def test_unseen_anchors_look_like_a_neighbour(model: ClipModel):
    before = {name: value.clone() for name, value in model.anchor_set("static").state_dict().items()}
    assert continue_unseen(model, "static", squares(N_UNSEEN)) == N_UNSEEN
    anchors = model.anchor_set("static")
    for name, value in anchors.state_dict().items():
        assert torch.equal(value[N_UNSEEN:], before[name][N_UNSEEN:]), name
    assert torch.equal(anchors.positions, before["positions"])
    assert torch.equal(anchors.color_logits, before["color_logits"])
    trained = {tuple(row.tolist()) for row in before["features"][N_UNSEEN:]}
    assert all(tuple(row.tolist()) in trained for row in anchors.features[:N_UNSEEN].detach())
    # as large as the distance to their neighbours, but no larger than the model, since they had shrunk
    grown = anchors.log_base_scales[:N_UNSEEN].detach() - before["log_base_scales"][N_UNSEEN]
    assert grown.max() <= 1e-6
    assert grown.min() > -1.5


def test_where_all_are_seen_nothing_changes(model: ClipModel):
    before = model.anchor_set("static").features.clone()
    assert continue_unseen(model, "static", squares(0)) == 0
    assert torch.equal(model.anchor_set("static").features, before)


def test_with_hardly_anything_seen_nothing_is_continued(model: ClipModel):
    found = np.zeros((N, 8), np.float32)
    found[:5] = 1.0
    assert continue_unseen(model, "static", found) == 0
    assert continue_unseen(model, "static", np.zeros((N, 8), np.float32)) == 0


def test_anchors_in_one_place_stay_finite(model: ClipModel):
    anchors = model.anchor_set("static")
    anchors.positions[:8] = anchors.positions[0]
    anchors.positions[100:108] = anchors.positions[100]
    continue_unseen(model, "static", squares(N_UNSEEN))
    for value in anchors.state_dict().values():
        assert torch.isfinite(value).all()
