"""The cameras' exposure that a clip file holds, without the rest of the file."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from engine.clip_files.array_names import LOG_DRIFT
from engine.clip_files.clip_state import read_clip_state


def read_drift(path: Path | str) -> np.ndarray | None:
    """Exposure of the training cameras in each frame of a clip against the reference clip's. [C, M, 3] float32

    Returns:
        None where no camera's exposure changes, or where nobody looked.
    Raises:
        ProjectError: The file is missing, damaged, or of a newer schema.
    """
    return read_clip_state(path, only=(LOG_DRIFT,)).drift


def mean_change(drift: np.ndarray | None) -> float:
    """How far exposures are from the reference clip's: mean over cameras, frames and channels, as a share, never
    negative; 0.01 is 1 percent."""
    return 0.0 if drift is None else float(np.expm1(np.abs(np.log(drift)).mean()))
