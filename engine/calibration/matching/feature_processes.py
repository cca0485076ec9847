"""Looks for the key points of one camera in a process of its own, a few cameras side by side."""

from __future__ import annotations

import time
from collections.abc import Callable
from threading import Semaphore

import numpy as np

from engine.calibration.matching.matching import KeyPoints
from engine.calibration.matching.pictures import CameraPictures
from engine.children.kind import ChildFailed
from engine.errors import PreparationError
from engine.features.child import arrays_kind, work_on_arrays

MAX_PROCESSES = 4
"""Each takes half a gigabyte."""
USUAL_S = 5.0
"""For progress: a process tells none, since its interpreter is busy."""
LOOKING = arrays_kind(
    "engine.calibration.matching.feature_processes:LOOKING",
    "engine.calibration.matching.features_child:main",
    "the process that finds key points",
)
_may_begin = Semaphore(MAX_PROCESSES)


def key_points(
    pictures: CameraPictures, name: str, advance: Callable[[float], None] = lambda _: None, *, is_thorough: bool = False
) -> KeyPoints:
    """Key points of background and moving parts; see engine.calibration.matching.features. Called by several threads.

    Args:
        pictures: Of one camera.
        name: Of the camera, for messages.
        advance: Called several times a second with the share done since its last call, which is a guess.
        is_thorough: See `extract`.
    Raises:
        PreparationError: The process gave no result.
        DiskError: There is no room for what it reads.
    """
    arrays = {"background": pictures.background, "is_thorough": np.array(is_thorough)}
    arrays["moments"] = np.array([part.moment for part in pictures.moving], dtype=np.int64)
    arrays["corners"] = np.array([part.corner for part in pictures.moving], dtype=np.int64).reshape(-1, 2)
    for row, part in enumerate(pictures.moving):
        arrays |= {f"picture{row}": part.picture, f"is_moving{row}": part.is_moving}
    told = 0.0

    def tell() -> None:
        nonlocal told
        spent_s = time.monotonic() - began_s
        share = spent_s / (spent_s + USUAL_S)
        advance(share - told)
        told = share

    with _may_begin:
        began_s = time.monotonic()
        try:
            found = work_on_arrays(LOOKING, arrays, alive=tell)
        except ChildFailed as error:
            hint = "Try again; if it happens again, check free memory."
            raise PreparationError(f"Key points of {name} could not be found: {error}.", hint=hint) from error
    advance(1.0 - told)
    return KeyPoints(found["pixels"], found["moments"], found["descriptors"])
