"""State of measured pictures for the window: figures and seams. Plain values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

CELL_COLUMNS = ("psnr", "flip", "E")
"""Figures of single pictures: PSNR in dB, mean FLIP, and mean excess flicker against the frame before in 1/255."""
CELL_RANGES = {"psnr": (20.0, 40.0), "flip": (0.0, 0.3), "E": (0.0, 2.0)}
"""Ranges of the cells' colours, the same for all projects. PSNR: below 20 dB a picture is plainly wrong, above 40 dB
nobody sees a difference. FLIP: trained clips lie around 0.1, and 0.3 is bad everywhere. E: trained clips lie around 0.3
levels of a display, mostly where something moves; two on average are plain flicker."""
LOW_IS_BAD = frozenset({"psnr"})
"""Columns in which higher figures are better."""
SEAM_RANGE = (0.0, 1.0)
"""Range of the colours of seam scores, 1/255, one range for all projects. Where everything is inherited scores are
0.01 to 0.1; with heads of their own clips are 0.4 to 0.8 apart, and independent ones 1.4 and more."""
SEAM_FLAGGED = 0.3
"""Scores above it are pointed out."""
SEAM_RATIO_RANGE = (1.0, 3.0)
"""Range of the colours of seam ratios: at 1 nothing shows; inheriting clips have 1.0 to 1.4, others 10 and more."""
SEAM_RATIO_FLAGGED = 2.0
"""Ratios above it are pointed out."""


@dataclass(frozen=True, slots=True)
class SeamStatus:
    """The boundary between two clips.

    Attributes:
        clip_index: The later clip.
        frame_index: Its first frame.
        score: Excess flicker of static pixels there, less what is normal inside the two clips, in 1/255, a mean over
            cameras: see engine.metrics.clips.seams. None where no camera was measured in both clips.
        ratio: Change of static pixels there / inside the two clips, over all cameras; 1 where nothing shows. None where
            nothing changes inside, or nothing was measured.
        n_cameras, n_all: Cameras of which the boundary and both clips are measured, and those of which they can be.
        worst_camera: The camera with the highest score; None without one.
    """

    clip_index: int
    frame_index: int
    score: float | None = None
    ratio: float | None = None
    n_cameras: int = 0
    n_all: int = 0
    worst_camera: int | None = None

    @property
    def is_provisional(self) -> bool:
        """Whether cameras are missing: with few of them a ratio is often twice the final one."""
        return self.n_cameras < self.n_all


@dataclass(frozen=True, slots=True, eq=False)
class ResidualStatus:
    """Measurements of every picture of the project.

    Attributes:
        seams: One per boundary between clips, in order.
        cells: By column of CELL_COLUMNS: figures by frame and camera, NaN where not measured. [F, C] float32, not to be
            changed
        is_held_out: Of each camera.
        measured: By column of CELL_COLUMNS: of how many pictures it is measured, and of how many it can be.
        n_done, n_all: Pictures of which every column is measured, and all of trained clips.
        is_measuring: Whether more are being measured now.
        is_held_back: Whether that continues slowly only, because a clip trains or the user looks around.
        rate: Pictures per second; 0 when unknown.
        eta_s: Seconds until all are measured; None while it is not known well.
        message: The failure, in sentences; empty without one.
        revision: Grows with every change of the figures.
    """

    seams: tuple[SeamStatus, ...] = ()
    cells: Mapping[str, np.ndarray] = field(default_factory=dict)
    is_held_out: tuple[bool, ...] = ()
    measured: Mapping[str, tuple[int, int]] = field(default_factory=dict)
    n_done: int = 0
    n_all: int = 0
    is_measuring: bool = False
    is_held_back: bool = False
    rate: float = 0.0
    eta_s: float | None = None
    message: str = ""
    revision: int = 0

    def worst(self, column: str, n_worst: int) -> list[tuple[float, int, int]]:
        """The worst figures of a column: (value, frame_index, camera_index), worst first; only measured ones.

        Raises:
            ValueError: There is no such column.
        """
        if column not in CELL_COLUMNS:
            raise ValueError(f"columns are {', '.join(CELL_COLUMNS)}, not {column!r}")
        values = self.cells.get(column)
        if values is None or n_worst <= 0:
            return []
        known = np.flatnonzero(np.isfinite(values))
        ranked = values.ravel()[known] * (1.0 if column in LOW_IS_BAD else -1.0)
        if len(known) > n_worst:
            known = known[np.argpartition(ranked, n_worst - 1)[:n_worst]]
            ranked = values.ravel()[known] * (1.0 if column in LOW_IS_BAD else -1.0)
        found = known[np.lexsort((known, ranked))]
        frames, cameras = np.divmod(found, values.shape[1])
        return [(float(values[f, c]), int(f), int(c)) for f, c in zip(frames, cameras, strict=True)]
