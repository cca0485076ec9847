"""A fresh field of a long clip: one table has room for any number of frames, a table for every frame has not."""

from __future__ import annotations

import pytest
import torch
from msgspec.structs import replace

from engine.backends.table import backend_called
from engine.errors import PreparationError
from engine.model.anchors import AnchorSet
from engine.model.clip_model import ClipModel
from engine.model.decoder import Decoder
from engine.training.config import TrainConfig
from engine.training.preparation.clip_field import fit_field

N_FRAMES = 300
PUBLISHED = TrainConfig(field_levels=16, field_channels=4, field_log2_entries=17)


def long_clip() -> ClipModel:
    points = torch.rand(5, 3, generator=torch.Generator().manual_seed(0))
    presence = torch.ones(5, N_FRAMES, dtype=torch.bool)
    anchors = AnchorSet.from_cloud(points, points, spacing=0.1, feature_dim=4, presence=presence)
    decoder = Decoder(static_dim=4, dynamic_dim=PUBLISHED.dynamic_feature_dim, gaussians_per_anchor=2, hidden=8)
    return ClipModel(
        sets={"moving": anchors},
        decoder=decoder,
        field=None,
        clip_length=N_FRAMES,
        n_frames=N_FRAMES,
        backend=backend_called("cpu"),
    )


def test_a_long_clip_has_a_field_of_the_published_size():
    model = long_clip()
    fit_field(model, spacing=0.1, config=PUBLISHED, generator=torch.Generator())
    assert model.field is not None
    assert [table.shape for table in model.field.tables] == [(16, 2**17, 4)]
    assert model.field.shape.n_knots == N_FRAMES


def test_tables_of_every_frame_that_are_too_large_are_refused():
    config = replace(PUBLISHED, field_tables="per_frame")
    with pytest.raises(PreparationError, match="field of 300 frames would have more than"):
        fit_field(long_clip(), spacing=0.1, config=config, generator=torch.Generator())
