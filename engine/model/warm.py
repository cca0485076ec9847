"""Compile, or load from the cache, every kernel of the decode."""

from __future__ import annotations

import numpy as np
import torch

from engine.clip_files.clip_header import FieldShape
from engine.model.anchors import AnchorSet
from engine.model.clip_model import ClipModel
from engine.model.decode.joining import join_frozen
from engine.model.decoder import Decoder
from engine.model.field import SpatioTemporalField


def warm_up() -> None:
    """Decode and differentiate a tiny clip once: the kernels that training and viewing use, and no others.

    A few seconds of one core when nothing is cached (holding the interpreter lock), a tenth of one after.
    """
    with torch.random.fork_rng(devices=[]):  # the process's own random numbers stay as they are
        _decode_tiny_clip()


def _decode_tiny_clip() -> None:
    generator = torch.Generator().manual_seed(0)
    point, color = torch.zeros(1, 3), torch.full((1, 3), 0.5)
    sets = {
        "static": AnchorSet.from_cloud(point, color, spacing=1.0, feature_dim=2, presence=None),
        "moving": AnchorSet.from_cloud(
            point, color, spacing=1.0, feature_dim=2, presence=torch.ones(1, 1, dtype=torch.bool)
        ),
    }
    decoder = Decoder(static_dim=2, dynamic_dim=2, gaussians_per_anchor=1, hidden=4, generator=generator)
    shape = FieldShape(
        n_knots=1,
        cells=(2,),
        n_entries=64,
        channels=4,
        hidden=4,
        feature_dim=2,
        bounds_min=(-1.0, -1.0, -1.0),
        side=2.0,
    )
    model = ClipModel(
        sets=sets, decoder=decoder, field=SpatioTemporalField(shape, generator), clip_length=1, n_frames=1
    )
    # a scalar: giving torch the gradients of several tensors makes it import half a second of symbolic mathematics
    gaussians = model.decode(0.0)
    torch.stack([tensor.sum() for tensor in gaussians.tensors()]).sum().backward()
    join_frozen(gaussians.detach(), np.zeros(1, np.int64), gaussians.detach())
