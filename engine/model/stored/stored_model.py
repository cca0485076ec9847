"""StoredModel: a clip of Gaussians that another program made, behind the interface of a trained clip.

Each Gaussian is an anchor at its centre. Still ones are the static set, which is constant as that of a finished clip
is; tracks of what moves are the moving set. Nothing is between two frames: a time shows the nearest one.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
import torch
from msgspec.structs import asdict
from torch import Tensor

from engine.clip_files.clip_header import ClipHeader
from engine.clip_files.roles import STATIC
from engine.clip_files.stored_gaussians import COLUMNS, ONE_EACH, StoredGaussians
from engine.model.anchors import AnchorSet
from engine.model.clip_model import ClipModel
from engine.model.decoder import Decoder
from engine.model.model_backend import ModelBackend
from engine.raster.gaussians import Gaussians

MOVING = "moving"


class StoredModel(ClipModel):
    """Stored Gaussians of one clip. Nothing in it learns.

    Args:
        sets: The still Gaussians and the tracks as anchors, by role.
        still: Columns of the static set. [S, ...]
        moving: Those of all rows of tracks. [R, ...]
        rows_at: The row of each track at each frame of the clip, -1 where it has none. [M, A] int64
        first_rows: The first row of each track. [A] int64
        clip_length: M, the divisor of clip_time.
        backend: It draws the clip.
    """

    has_features = False

    def __init__(
        self,
        *,
        sets: dict[str, AnchorSet],
        still: Gaussians,
        moving: Gaussians,
        rows_at: Tensor,
        first_rows: Tensor,
        clip_length: int,
        backend: ModelBackend,
    ) -> None:
        super().__init__(
            sets=sets,
            decoder=Decoder(**asdict(ONE_EACH)),
            field=None,
            clip_length=clip_length,
            n_frames=len(rows_at),
            backend=backend,
        )
        self._still, self._moving, self._rows_at, self._first_rows = still, moving, rows_at, first_rows
        self.requires_grad_(requires_grad=False)

    @classmethod
    def of(cls, header: ClipHeader, gaussians: StoredGaussians, backend: ModelBackend) -> StoredModel:
        """The model of a clip file's Gaussians, moved to the device and dtype of the back end."""
        presence = gaussians.presence
        rows = np.full((header.n_frames, len(presence)), -1, np.int64)
        rows[presence.T] = np.arange(len(gaussians.moving["means"]))
        first = rows[presence.argmax(1), np.arange(len(presence))]
        sets = {}
        if len(gaussians.still["means"]):
            sets[STATIC] = _anchors(gaussians.still, None)
        if len(presence):
            at_first = {name: column[first] for name, column in gaussians.moving.items()}
            sets[MOVING] = _anchors(at_first, torch.from_numpy(presence.copy()))
        return cls(
            sets=sets,
            still=_gaussians(gaussians.still, backend),
            moving=_gaussians(gaussians.moving, backend),
            rows_at=torch.from_numpy(rows).to(backend.device),
            first_rows=torch.from_numpy(first).to(backend.device),
            clip_length=header.clip_length,
            backend=backend,
        )

    def part(self, roles: Collection[str]) -> StoredModel:
        """Some of its sets; see ClipModel.part."""
        return StoredModel(
            sets={role: self.anchor_set(role) for role in self.roles() if role in roles},
            still=self._still,
            moving=self._moving,
            rows_at=self._rows_at,
            first_rows=self._first_rows,
            clip_length=self.clip_length,
            backend=self.backend,
        )

    def positions(self, role: str, clip_time: float) -> Tensor:
        """Centres at the nearest frame; of tracks that do not exist there, where they first were. [A, 3]"""
        places = self.anchor_set(role).positions
        if role == STATIC:
            return places
        rows = self._rows_at[self._frame(clip_time)]
        return torch.where((rows >= 0)[:, None], self._moving.means[rows.clamp_min(0)], places)

    def decode(self, clip_time: float, rows: dict[str, Tensor] | None = None) -> Gaussians:
        """Gaussians at the nearest frame; see ClipModel.decode. Rows that do not exist there are as they first were."""
        parts = []
        for role in self.roles():
            chosen = self.alive(role, clip_time) if rows is None else rows[role]
            if role == STATIC:
                parts.append(self._still if len(chosen) == len(self._still) else self._still[chosen])
                continue
            found = self._rows_at[self._frame(clip_time)][chosen]
            parts.append(self._moving[torch.where(found >= 0, found, self._first_rows[chosen])])
        return Gaussians.concatenate(parts) if parts else self._moving[:0]

    def static_gaussians(self, role: str) -> Gaussians:
        """Gaussians of a whole set as it first is."""
        return self._still if role == STATIC else self._moving[self._first_rows]

    def _frame(self, clip_time: float) -> int:
        return self.knots(clip_time)[0][0]


def _anchors(columns: dict[str, np.ndarray], presence: Tensor | None) -> AnchorSet:
    """One anchor per Gaussian, as large as that."""
    n, sizes = len(columns["means"]), torch.from_numpy(columns["scales"].max(1, initial=1e-30))
    nothing = torch.zeros(n, 0)
    return AnchorSet(
        positions=torch.from_numpy(columns["means"].copy()),
        color_logits=nothing,
        features=nothing.clone(),
        log_offset_scales=sizes.log()[:, None],
        log_base_scales=nothing.clone(),
        presence=presence,
        is_trainable=True,
    )


def _gaussians(columns: dict[str, np.ndarray], backend: ModelBackend) -> Gaussians:
    tensors = (torch.from_numpy(columns[name].copy()) for name in COLUMNS)
    return Gaussians(*(tensor.to(backend.device, backend.dtype) for tensor in tensors))
