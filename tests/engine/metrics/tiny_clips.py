"""A capture of two clips in memory and models of it: static anchors in front of one camera, one moving anchor."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import torch

from engine.backends.table import backend_called
from engine.capture.clip import Clip, split_clips
from engine.clip_files.clip_header import FieldShape
from engine.clip_files.clip_state import ClipState
from engine.model.anchors import AnchorSet
from engine.model.clip_model import ClipModel
from engine.model.decoder import Decoder
from engine.model.field import SpatioTemporalField
from tests.clip_headers import make_header

N_FRAMES, CLIP_LENGTH, SIZE = 6, 3, (64, 48)


@dataclass
class TinyRig:
    """Two cameras at the same place, so that their pictures differ in gain only."""

    names: tuple[str, ...] = ("a", "b")
    image_sizes: np.ndarray = field(default_factory=lambda: np.array([SIZE, SIZE]))
    world_to_camera: np.ndarray = field(default_factory=lambda: np.stack([np.eye(4)] * 2))
    Ks: np.ndarray = field(default_factory=lambda: np.stack([np.array([[40.0, 0, 32], [0, 40, 24], [0, 0, 1]])] * 2))

    def __len__(self) -> int:
        return len(self.names)


class TinyCapture:
    """What Evaluation asks of a capture: pictures [frame] of every camera, here the same."""

    def __init__(self, pictures: np.ndarray) -> None:
        self.pictures, self.rig, self.n_frames = pictures, TinyRig(), len(pictures)
        self.read: list[tuple[int, int]] = []

    def frame(self, camera: int, frame: int) -> np.ndarray:
        self.read.append((camera, frame))
        return self.pictures[frame]

    def frames_of(self, camera: int, frames: list[int]) -> np.ndarray:
        return self.pictures[list(frames)]

    def valid(self, camera: int) -> None:
        return None

    def valid_in(self, camera: int, frame: int) -> None:
        return None

    def is_usable(self, camera: int, frame: int) -> bool:
        return True


def clips() -> list[Clip]:
    return split_clips(N_FRAMES, CLIP_LENGTH)


def reference() -> ClipState:
    """Header and gains of a reference clip; camera b was held out."""
    arrays = {"gains": np.array([[0.5, 0.5, 0.5]], np.float32)}
    return ClipState(arrays, make_header(spacing=0.2, camera_names=["a"]))


def make_model(*, has_motion: bool, seed: int = 0, color: float = 0.5, n_frames: int = CLIP_LENGTH) -> ClipModel:
    """A wall of static anchors two units away, and three moving ones before it if wanted.

    Args:
        has_motion: Add the moving ones, which exist in frames 0 and 2, and a field far from zero.
        color: Of the wall.
    """
    generator = torch.Generator().manual_seed(seed)
    y, x = torch.meshgrid(torch.linspace(-1, 1, 8), torch.linspace(-1.4, 1.4, 10), indexing="ij")
    wall = torch.stack([x, y, torch.full_like(x, 2.0)], -1).reshape(-1, 3)
    arguments: dict[str, Any] = {"spacing": 0.2, "feature_dim": 4}
    sets = {"static": AnchorSet.from_cloud(wall, torch.full_like(wall, color), presence=None, **arguments)}
    if has_motion:
        points = torch.tensor([[0.0, 0.0, 1.0], [0.2, 0.1, 1.0], [-0.2, 0.1, 1.1]])
        presence = torch.tensor([[True, False, True]] * 3)
        sets["moving"] = AnchorSet.from_cloud(points, torch.full((3, 3), 0.9), presence=presence, **arguments)
    for anchors in sets.values():
        with torch.no_grad():
            anchors.features.copy_(torch.randn(anchors.features.shape, generator=generator))
    shape = FieldShape(n_frames, (4, 6), 1 << 8, 4, 8, 4, (-2.0, -2.0, 0.0), 4.0)
    spatio_temporal = SpatioTemporalField(shape, generator) if has_motion else None
    if spatio_temporal is not None:
        with torch.no_grad():
            for table in spatio_temporal.tables:
                table.mul_(2000.0)
    decoder_seed = torch.Generator().manual_seed(7)
    decoder = Decoder(static_dim=4, dynamic_dim=4, gaussians_per_anchor=2, hidden=8, generator=decoder_seed)
    return ClipModel(
        sets=sets,
        decoder=decoder,
        field=spatio_temporal,
        clip_length=CLIP_LENGTH,
        n_frames=n_frames,
        backend=backend_called("cpu"),
    ).requires_grad_(requires_grad=False)
