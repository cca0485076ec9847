"""The drift of a clip's pictures: the cameras' exposure against the reference clip's, and pictures without it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from engine.cloud.background.exposure import Exposure
from engine.parallel import map_ordered
from engine.progress import Progress, ReportProgress
from engine.training.preparation.training_pictures import TrainingPictures

STAGE = "Measuring exposure"


def exposures_of(pictures: TrainingPictures) -> list[Exposure]:
    """The mean exposure of each training camera in a reference clip."""
    return map_ordered(lambda row: Exposure.of_frames(pictures.of_camera(row)), range(pictures.n_cameras))


def exposures_in(backgrounds: np.ndarray) -> list[Exposure]:
    """The exposure that each camera's background is in. backgrounds: [C, H, W, 3] uint8"""
    return map_ordered(Exposure.of_background, backgrounds)


def no_drift(pictures: TrainingPictures) -> np.ndarray:
    """Ones. [C, M, 3] float32"""
    return np.ones((pictures.n_cameras, pictures.clip.n_frames, 3), np.float32)


def remove_drift(pictures: TrainingPictures, exposures: Sequence[Exposure], report: ReportProgress) -> np.ndarray:
    """Bring pictures into an exposure.

    Args:
        pictures: As the cameras took them; changed in place.
        exposures: Of each training camera.
        report: Gets one line.
    Returns:
        Gains that the pictures had against it, exactly 1 where nothing drifts. [C, M, 3] float32
    """

    def gains_of(row: int) -> np.ndarray:
        return exposures[row].gains_of(pictures.of_camera(row))

    n_cameras = pictures.n_cameras
    drift = np.stack(map_ordered(gains_of, range(n_cameras)))
    pictures.remove(drift, None)
    means = 100 * (drift.mean((1, 2)) - 1.0)
    n_changed = int((drift != 1.0).any((1, 2)).sum())
    said = f"{means.min():+.1f} to {means.max():+.1f} % against the reference clip, {n_changed} of {n_cameras} cameras"
    report(Progress(STAGE, 1.0, said if n_changed else "all cameras as in the reference clip"))
    return drift
