"""Tiny clips that inherit from each other, as models and as the states that they are loaded from."""

from __future__ import annotations

import torch
from msgspec import to_builtins

from engine.backends.table import backend_called
from engine.capture.clip import Clip
from engine.clip_files.clip_state import ClipState
from engine.clip_files.roles import ROLES
from engine.model.anchors import AnchorSet
from engine.model.clip_model import ClipModel, decoder_shape
from engine.model.reading import inherit
from tests.clip_headers import make_header
from tests.engine.metrics.tiny_clips import CLIP_LENGTH, make_model

CLIP = Clip(0, 0, CLIP_LENGTH, CLIP_LENGTH)


def reference() -> tuple[ClipModel, ClipState]:
    """A reference clip whose static and moving anchors are its own."""
    model = make_model(has_motion=True)
    model.decoder.requires_grad_(requires_grad=True)
    assert model.field is not None
    header = make_header(
        clip_length=CLIP_LENGTH,
        n_frames=CLIP_LENGTH,
        spacing=0.2,
        decoder=to_builtins(decoder_shape(model.decoder)),
        field=None if model.field is None else to_builtins(model.field.shape),
    )
    state = ClipState(model.own_arrays(), header).stamped()
    model.decoder.requires_grad_(requires_grad=False)
    return model, state


def source(state: ClipState, *, adapted: bool = False) -> tuple[ClipModel, ClipState]:
    """A clip that inherits all of it, with one residual anchor; its moving anchors learn on if wanted."""
    presence = torch.ones(3, CLIP_LENGTH, dtype=torch.bool)
    sets, decoder, _ = inherit(state, {"moving": presence})
    if adapted:
        sets["adapted"] = sets.pop("moving").subset(torch.ones(3, dtype=torch.bool), is_trainable=True)
    sets["residual"] = AnchorSet.from_cloud(
        torch.tensor([[0.6, 0.5, 1.2]]),
        torch.full((1, 3), 0.3),
        spacing=0.2,
        feature_dim=4,
        presence=torch.ones(1, CLIP_LENGTH, dtype=torch.bool),
    )
    field = make_model(has_motion=True, seed=1).field
    sets = {role: sets[role] for role in ROLES if role in sets}
    model = ClipModel(
        sets=sets,
        decoder=decoder,
        field=field,
        clip_length=CLIP_LENGTH,
        n_frames=CLIP_LENGTH,
        backend=backend_called("cpu"),
    ).requires_grad_(requires_grad=False)
    header = make_header(role="source", clip_index=1, reference_fingerprint=state.header.fingerprint, spacing=0.2)
    return model, ClipState({}, header)
