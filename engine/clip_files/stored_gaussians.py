"""StoredGaussians: what a clip file holds of a scene that another program made, and how that is spread over arrays.

Still Gaussians are stored once. What moves is a list of tracks, which exist at some frames of the clip; at each of
these a track has a row of values. Rows lie frame by frame, and at a frame in the order of the tracks.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from engine.clip_files.anchor_record import RecordError
from engine.clip_files.clip_header import DecoderShape

COLUMNS = {"means": 3, "quats": 4, "scales": 3, "opacities": 1, "colors": 3}
"""Values of a Gaussian and their widths, as engine.raster.gaussians orders them; a width of 1 has no axis."""
ONE_EACH = DecoderShape(static_dim=1, dynamic_dim=1, gaussians_per_anchor=1, hidden=1)
"""The decoder that a header of such a clip names: each Gaussian is an anchor of its own."""
_STILL, _MOVING, _PRESENCE = "gaussians.still.", "gaussians.moving.", "gaussians.moving.presence"


@dataclass(frozen=True, slots=True)
class StoredGaussians:
    """The Gaussians of a clip. A value.

    Attributes:
        still: Columns of those that are the same in all frames. [S, ...] float32
        moving: Columns of the rows of tracks. [R, ...] float32
        presence: Frames of the clip at which each track has a row. [A, M] bool
    """

    still: dict[str, np.ndarray]
    moving: dict[str, np.ndarray]
    presence: np.ndarray

    def at_first(self) -> dict[str, np.ndarray]:
        """Columns of the Gaussians at the first frame of the clip. [N, ...] float32"""
        n_first = int(self.presence[:, 0].sum())
        return {name: np.concatenate([self.still[name], self.moving[name][:n_first]]) for name in COLUMNS}

    def without(self, still: np.ndarray, tracks: np.ndarray) -> StoredGaussians:
        """Without some of them. still: [S] bool; tracks: [A] bool"""
        rows = ~tracks[np.nonzero(self.presence.T)[1]]
        return StoredGaussians(
            {name: column[~still] for name, column in self.still.items()},
            {name: column[rows] for name, column in self.moving.items()},
            self.presence[~tracks],
        )

    def arrays(self) -> dict[str, np.ndarray]:
        """By the names that they have in a file. Inverse of `read_stored`."""
        still = {f"{_STILL}{name}": array for name, array in self.still.items()}
        return still | {f"{_MOVING}{name}": array for name, array in self.moving.items()} | {_PRESENCE: self.presence}


def read_stored(arrays: Mapping[str, np.ndarray], n_frames: int) -> StoredGaussians:
    """The Gaussians in the arrays of a clip of that many frames.

    Raises:
        RecordError: Arrays are missing, or do not fit together; names them.
    """
    presence = arrays.get(_PRESENCE)
    if presence is None or presence.dtype != bool or presence.ndim != 2 or presence.shape[1] != n_frames:
        raise RecordError(f"its tracks do not say in which of {n_frames} frames they exist")
    if not presence.any(1).all():
        raise RecordError("a track exists in none of its frames")
    still, moving = _columns(arrays, _STILL, None), _columns(arrays, _MOVING, int(presence.sum()))
    return StoredGaussians(still, moving, presence)


def _columns(arrays: Mapping[str, np.ndarray], prefix: str, n_rows: int | None) -> dict[str, np.ndarray]:
    columns = {}
    for name, width in COLUMNS.items():
        array = arrays.get(f"{prefix}{name}")
        if array is None:
            raise RecordError(f"it has no {prefix}{name}")
        n_rows = len(array) if n_rows is None and array.ndim else n_rows
        shape = (n_rows,) if width == 1 else (n_rows, width)
        if array.shape != shape or array.dtype != np.float32 or not np.isfinite(array).all():
            raise RecordError(f"{prefix}{name} is {array.dtype} {list(array.shape)}, not finite float32 {list(shape)}")
        columns[name] = array
    return columns
