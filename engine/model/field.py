"""SpatioTemporalField: position and clip time to a dynamic feature. One per clip.

Knots lie exactly on the frames of the clip, so the temporal resolution is that of the capture and no frame falls
between two knots; times between frames interpolate the two neighbouring knots linearly. The field starts at (nearly)
zero, so an untrained field leaves the static look of the anchors unchanged. Fine levels may keep their entries for
several frames: what is small in space rarely changes from one frame to the next, and is then learned from all of them.
Source: ClipGStream, spatio-temporal field; sizes follow the number of anchors instead of fixed 16 levels.
"""

from __future__ import annotations

import math

import numpy as np
import torch
from torch import Tensor, nn

from engine.clip_files.clip_header import FieldShape
from engine.model.grid import CornerTable, corner_table, encode, time_keys
from engine.model.host_array import host_array

TABLE_INIT = 1e-3
"""Half-width of a table's uniform start: small enough that the field starts at zero look."""
PUBLISHED_TABLE_INIT = 1e-4


class SpatioTemporalField(nn.Module):
    """(anchor rows, clip time) to f_d. Owns its tables and network; corner constants belong to the caller.

    Args:
        shape: Sizes.
        generator: Draws the start.
        is_published: Whether it starts as that of the released code: smaller tables, weights as Glorot and Bengio
            have them.

    Attributes:
        keys: Per knot and level, the number combined with entries; 0 where every knot has a table. [n_knots, L] int32
    """

    keys: Tensor

    def __init__(
        self, shape: FieldShape, generator: torch.Generator | None = None, *, is_published: bool = False
    ) -> None:
        super().__init__()
        self.shape = shape
        half_width = PUBLISHED_TABLE_INIT if is_published else TABLE_INIT
        size = (len(shape.cells), shape.n_entries, shape.channels)
        # One parameter per knot: knots without gradient are left alone by the optimiser, which makes it lazy for free.
        self.tables = nn.ParameterList(
            nn.Parameter((torch.rand(size, generator=generator) * 2 - 1) * half_width) for _ in range(shape.n_tables)
        )
        keys = torch.zeros(shape.n_knots, len(shape.cells), dtype=torch.int32)
        if shape.is_shared:
            keys = time_keys(shape.cells, shape.n_entries, shape.n_knots, shape.strides)
        self.register_buffer("keys", keys, persistent=False)
        n_in = len(shape.cells) * shape.channels
        self.hidden = nn.Linear(n_in, shape.hidden, bias=False)
        self.out = nn.Linear(shape.hidden, shape.feature_dim, bias=False)
        for layer in (self.hidden, self.out):
            scale = 6.0 / (layer.in_features + layer.out_features) if is_published else 1.0 / layer.in_features
            bound = math.sqrt(scale)
            with torch.no_grad():
                layer.weight.copy_((torch.rand(layer.weight.shape, generator=generator) * 2 - 1) * bound)

    def table(self, knot: int) -> nn.Parameter:
        """The table of a knot, whose entries are combined with `keys[knot]`. [L, T, C]"""
        return self.tables[0 if self.shape.is_shared else knot]

    def corners(self, positions: Tensor) -> CornerTable:
        """Interpolation constants of fixed positions, scene units, on their device. [A, 3]"""
        lower = np.asarray(self.shape.bounds_min)
        unit = (host_array(positions).astype(np.float64) - lower) / (self.shape.side * np.asarray(self.shape.aspect))
        return corner_table(unit, self.shape.cells, self.shape.n_entries).to(positions.device)

    def knots(self, clip_time: float, clip_length: int) -> list[tuple[int, float]]:
        """Knots around a clip time and their weights; one knot when the time is a frame's, the last one beyond it."""
        position = min(max(clip_time * clip_length, 0.0), self.shape.n_knots - 1.0)
        lower = math.floor(position + 1e-6)
        fraction = position - lower
        if fraction < 1e-6:
            return [(lower, 1.0)]
        return [(lower, 1.0 - fraction), (lower + 1, fraction)]

    def forward(self, rows: Tensor, corners: CornerTable, knots: list[tuple[int, float]]) -> Tensor:
        """Dynamic features of the chosen anchors in plain torch, any dtype. [n, feature_dim]

        Args:
            rows: Rows of the corner table. [n] int64
            corners: From `corners`.
            knots: From `knots`.
        """
        encoded = sum(weight * encode(self.table(knot), rows, corners, self.keys[knot]) for knot, weight in knots)
        features = self.out(torch.relu(self.hidden(encoded)))
        return torch.relu(features) if self.shape.is_rectified else features
