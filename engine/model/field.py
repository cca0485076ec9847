"""SpatioTemporalField: position and clip time to a dynamic feature. One per clip.

Knots lie exactly on the frames of the clip, so the temporal resolution is that of the capture and no frame falls
between two knots; times between frames interpolate the two neighbouring knots linearly. The field starts at (nearly)
zero, so an untrained field leaves the static look of the anchors unchanged.
Source: ClipGStream, spatio-temporal field; sizes follow the number of anchors instead of fixed 16 levels.
"""

from __future__ import annotations

import math

import numpy as np
import torch
from torch import Tensor, nn

from engine.clip_files.clip_header import FieldShape
from engine.model.grid import CornerTable, corner_table, encode, time_keys

_TABLE_INIT = 1e-3  # uniform half-width of the start; small enough that the field starts at zero look


class SpatioTemporalField(nn.Module):
    """(anchor rows, clip time) to f_d. Owns its tables and network; corner constants belong to the caller.

    Attributes:
        keys: Per knot and level what entries are combined with; zeros where every knot has a table. [n_knots, L] int32
    """

    def __init__(self, shape: FieldShape, generator: torch.Generator | None = None) -> None:
        super().__init__()
        self.shape = shape
        size = (len(shape.cells), shape.n_entries, shape.channels)
        # One parameter per knot: knots without gradient are left alone by the optimiser, which makes it lazy for free.
        self.tables = nn.ParameterList(
            nn.Parameter((torch.rand(size, generator=generator) * 2 - 1) * _TABLE_INIT) for _ in range(shape.n_tables)
        )
        keys = np.zeros((shape.n_knots, len(shape.cells)), np.int32)
        self.keys = time_keys(shape.cells, shape.n_entries, shape.n_knots) if shape.is_shared else keys
        n_in = len(shape.cells) * shape.channels
        self.hidden = nn.Linear(n_in, shape.hidden, bias=False)
        self.out = nn.Linear(shape.hidden, shape.feature_dim, bias=False)
        for layer in (self.hidden, self.out):
            bound = 1.0 / math.sqrt(layer.in_features)
            with torch.no_grad():
                layer.weight.copy_((torch.rand(layer.weight.shape, generator=generator) * 2 - 1) * bound)

    def table(self, knot: int) -> nn.Parameter:
        """The table of a knot, whose entries are combined with `keys[knot]`. [L, T, C]"""
        return self.tables[0 if self.shape.is_shared else knot]

    def corners(self, positions: Tensor) -> CornerTable:
        """Interpolation constants of fixed positions, scene units. [A, 3]"""
        lower = np.asarray(self.shape.bounds_min)
        unit = (positions.detach().cpu().numpy().astype(np.float64) - lower) / self.shape.side
        return corner_table(unit, self.shape.cells, self.shape.n_entries)

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
        return self.out(torch.relu(self.hidden(encoded)))
