"""A clip as its static features, or its dynamic ones, alone would have it: what each of the two carries."""

from __future__ import annotations

from typing import Literal

import torch

from engine.model.anchors import AnchorSet
from engine.model.clip_model import ClipModel

Features = Literal["both", "static", "dynamic"]


def with_features(model: ClipModel, features: Features) -> ClipModel:
    """A variant for rendering with f_s or f_d set to zero; "both" is the model itself.

    Everything else stays, and is shared with the model, not copied: positions, cloud colours, scales, presence in
    time, decoder. So "static" is what the clip inherits or keeps at every time, with moving anchors still appearing
    and disappearing; "dynamic" is the decoder's start on the cloud's colours, changed by the field alone.
    The variant is not for training: its anchor sets count as inherited. A clip without features is itself in each.
    """
    if features == "both" or not model.has_features:
        return model
    sets = {}
    for role in model.roles():
        anchors = model.anchor_set(role)
        sets[role] = AnchorSet(
            positions=anchors.positions,
            color_logits=anchors.color_logits,
            features=torch.zeros_like(anchors.features) if features == "dynamic" else anchors.features.detach(),
            log_offset_scales=anchors.log_offset_scales.detach(),
            log_base_scales=anchors.log_base_scales.detach(),
            presence=anchors.presence,
            is_trainable=False,
            motion=None if anchors.motion is None else anchors.motion.map(torch.Tensor.detach),
        )
    return ClipModel(
        sets=sets,
        decoder=model.decoder,
        field=None if features == "static" else model.field,
        clip_length=model.clip_length,
        n_frames=model.n_frames,
        backend=model.backend,
        light=model.light,
        hidden=model.hidden,
        still_decoder=model.still_decoder,
    )
