"""Frames with rows, as two clips show them that share what stands still: for tests of selecting."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np

from app.playback.modes.arrays import GaussianArrays
from app.session.editing.attributes import AnchorValues
from app.session.editing.selecting import ProjectSelecting
from engine.editing.gaussian_rows import GaussianRows, RowSet

T = TypeVar("T")
K = 2
STATIC, MOVING = RowSet("first", 0, "static"), RowSet("first", 0, "moving")
RESIDUAL = RowSet("second", 1, "residual")
N_STATIC = 40


def frame(clip_index: int = 0, *, key: object = None, hidden: int = 0) -> GaussianArrays:
    """40 static Gaussians on a line along x, one unit apart, and 10 that are the clip's own, 100 units further on.

    Args:
        hidden: So many of the first static ones are left out in this clip.
    """
    own = MOVING if clip_index == 0 else RESIDUAL
    n_static, n = N_STATIC - hidden, N_STATIC - hidden + 10
    means = np.zeros((n, 3), np.float32)
    means[:, 0] = np.concatenate([np.arange(hidden, N_STATIC), 100.0 + np.arange(10)])
    number = np.concatenate([np.arange(hidden, N_STATIC), np.arange(10)]).astype(np.int32)
    rows = GaussianRows((STATIC, own), np.repeat([0, 1], [n_static, 10]).astype(np.uint8), number)
    return GaussianArrays(
        means,
        np.tile(np.eye(4, dtype=np.float32)[0], (n, 1)),
        np.full((n, 3), 0.1, np.float32),
        np.linspace(0.1, 0.9, n).astype(np.float32),
        np.full((n, 3), 0.5, np.float32),
        key=(clip_index, key, hidden),
        births=np.repeat([0, 2], [n_static, 10]).astype(np.uint8),
        rows=rows,
    )


@dataclass
class MadeShown:
    """What is shown; tests change it."""

    gaussians: GaussianArrays | None = field(default_factory=frame)
    values: np.ndarray | None = None
    asked: list[str] = field(default_factory=list)

    def selectable(self) -> GaussianArrays | None:
        return self.gaussians

    def anchor_values(self, column: str) -> AnchorValues | None:
        self.asked.append(column)
        if self.gaussians is None or (column and self.values is None):
            return None
        positions = self.gaussians.means[::K]
        return AnchorValues(positions, np.zeros(len(positions)) if self.values is None else self.values)

    def gaussians_per_anchor(self) -> int:
        return K


def settle(selecting: ProjectSelecting) -> None:
    """Poll until nothing is looked for."""
    deadline_s = time.monotonic() + 120.0
    while selecting.status().is_busy:
        selecting.poll()
        assert time.monotonic() < deadline_s
        time.sleep(0.001)


def answer(ask: Callable[[], T | None]) -> T:
    """What is there once it was made."""
    deadline_s = time.monotonic() + 120.0
    while (found := ask()) is None:
        assert time.monotonic() < deadline_s
        time.sleep(0.001)
    return found
