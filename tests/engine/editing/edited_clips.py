"""A clip with all that edits may meet: inherited and own sets, hidden anchors, light, anchors that come and go."""

from __future__ import annotations

import torch

from engine.backends.table import backend_called
from engine.capture.clip import Clip
from engine.clip_files.clip_header import FieldShape
from engine.editing.clip_rows import NamedSet, named_sets
from engine.editing.edited_clip import EditedClip
from engine.model.anchors import AnchorSet
from engine.model.clip_model import ClipModel
from engine.model.decoder import Decoder
from engine.model.field import SpatioTemporalField
from tests.clip_headers import make_header

CLIP = Clip(clip_index=2, start=10, n_frames=5, clip_length=6)
"""Frames 10 to 14; shorter than others."""
K = 3
REFERENCE, OWN = "reference-file", "own-file"


def make_anchors(n: int, *, seed: int, presence: torch.Tensor | None, is_own: bool = True) -> AnchorSet:
    """Anchors in the cube from 0 to 1 with random looks."""
    generator = torch.Generator().manual_seed(seed)
    anchors = AnchorSet.from_cloud(
        torch.rand(n, 3, generator=generator),
        torch.rand(n, 3, generator=generator),
        spacing=0.1,
        feature_dim=8,
        presence=presence,
    )
    with torch.no_grad():
        anchors.features.normal_(generator=generator)
    return anchors.subset(torch.ones(n, dtype=torch.bool), is_trainable=is_own)


def make_clip(*, has_light: bool = True, is_empty: bool = False) -> ClipModel:
    """A source clip of 12 static anchors of which 3 are hidden, 8 moving and 6 residual ones."""
    generator = torch.Generator().manual_seed(5)
    shape = FieldShape(CLIP.n_frames, (4, 7), 512, 4, 16, 6, (0.0, 0.0, 0.0), 1.0)
    field = SpatioTemporalField(shape, torch.Generator().manual_seed(3))
    with torch.no_grad():
        for table in field.tables:
            table.mul_(2000.0)
    is_hidden = torch.zeros(12, dtype=torch.bool)
    is_hidden[[0, 4, 11]] = True
    n_moving, n_residual = (0, 0) if is_empty else (8, 6)
    sets = {
        "static": make_anchors(12, seed=0, presence=None, is_own=False).subset(~is_hidden),
        "moving": make_anchors(
            n_moving, seed=1, presence=torch.rand(n_moving, CLIP.n_frames, generator=generator) < 0.6, is_own=False
        ),
        "residual": make_anchors(
            n_residual, seed=2, presence=torch.rand(n_residual, CLIP.n_frames, generator=generator) < 0.6
        ),
    }
    if is_empty:
        sets["static"], is_hidden = sets["static"].subset(torch.zeros(9, dtype=torch.bool)), torch.ones_like(is_hidden)
    return ClipModel(
        sets=sets,
        decoder=Decoder(
            static_dim=8, dynamic_dim=6, gaussians_per_anchor=K, hidden=16, generator=torch.Generator().manual_seed(2)
        ),
        field=field,
        clip_length=CLIP.clip_length,
        n_frames=CLIP.n_frames,
        backend=backend_called("cpu"),
        light=torch.randn(12, 2, generator=generator) * 0.2 if has_light else None,
        hidden={"static": is_hidden},
    ).requires_grad_(requires_grad=False)


def names_of(model: ClipModel) -> dict[str, NamedSet]:
    """The sets of such a clip by name."""
    header = make_header(role="source", clip_index=2, fingerprint=OWN, reference_fingerprint=REFERENCE)
    return named_sets(model, header, 0)


def edited(model: ClipModel) -> EditedClip:
    """A clip as edits leave it."""
    return EditedClip(model, CLIP, names_of(model))
