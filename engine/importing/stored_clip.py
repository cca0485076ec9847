"""The Gaussians of some frames of a scene as the state of a clip that needs no training."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from msgspec.structs import replace

from engine.capture.clip import Clip
from engine.clip_files.array_names import GAINS
from engine.clip_files.clip_header import STORED_SCHEMA, ClipHeader
from engine.clip_files.clip_state import ClipState
from engine.clip_files.stored_gaussians import ONE_EACH, StoredGaussians

_LEAST = 1e-9


def stored_clip(clip: Clip, found: StoredGaussians, *, views: Sequence[str]) -> ClipState:
    """A clip of these Gaussians, which inherits nothing. Its near plane is for `with_near_plane` to say.

    Args:
        found: Of the frames of the clip.
        views: Names of the cameras, which take the scene's colours as they are.
    """
    sizes = np.concatenate([found.still["scales"].max(1, initial=0.0), found.moving["scales"].max(1, initial=0.0)])
    header = ClipHeader(
        schema=STORED_SCHEMA,
        role="reference",
        holds="gaussians",
        clip_index=clip.clip_index,
        clip_length=clip.clip_length,
        n_frames=clip.n_frames,
        start=clip.start,
        step=0,
        n_steps=0,
        seed=0,
        config={},
        camera_names=list(views),
        near_plane=_LEAST,
        spacing=max(float(np.median(sizes)) if len(sizes) else 1.0, _LEAST),
        decoder=ONE_EACH,
        field=None,
        fingerprint="",
        n_anchors={"static": len(found.still["means"]), "moving": len(found.presence)},
        n_alive=int(found.presence.sum(0).max(initial=0)),
    )
    arrays = found.arrays() | {GAINS: np.ones((len(views), 3), np.float32)}
    return ClipState(arrays, header).stamped()


def with_near_plane(state: ClipState, near_plane: float) -> ClipState:
    """The same clip with the nearest depth that is drawn, scene units."""
    return ClipState(state.arrays, replace(state.header, near_plane=max(near_plane, _LEAST)))
