"""How far the cameras' exposure in a clip lies from the reference clip's, looked up before it is trained."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from engine.capture.capture import Capture
from engine.capture.clip import Clip
from engine.cloud.background.exposure import Exposure
from engine.training.config import TrainConfig
from engine.training.preparation.cloud_preparation import key_of_corrected, read_backgrounds

N_CAMERAS = 8
"""Looked at, spread over the rig: enough to detect drift, and quick where many clips are planned."""


def exposure_span(
    capture: Capture, clip: Clip, camera_indices: Sequence[int], config: TrainConfig, prep_dir: Path
) -> tuple[float, float] | None:
    """Smallest and largest change of exposure in the middle of a source clip, mean over the channels, 0 for none.

    Args:
        capture: At working resolution.
        clip: A clip that inherits.
        camera_indices: Training cameras, in capture numbering.
        config: All settings.
        prep_dir: Folder in which the reference clip kept its backgrounds.
    Returns:
        Shares of the exposure in the reference clip; None where that is unknown, or exposure does not count.
    Raises:
        CaptureError: A picture cannot be read.
    """
    if config.color == "off" or config.backgrounds == "clip":  # of which clip, is not known here
        return None
    backgrounds = read_backgrounds(prep_dir, key_of_corrected(capture, clip, camera_indices, config))
    if backgrounds is None:
        return None
    rows = np.unique(np.linspace(0, len(camera_indices) - 1, N_CAMERAS).round().astype(int))
    frame_index = clip.start + clip.n_frames // 2
    changes = []
    for row in rows:
        picture = capture.frame(camera_indices[row], frame_index)
        gains = Exposure.of_background(backgrounds.images[row]).gains_of(picture[None])
        changes.append(float(gains.mean()) - 1.0)
    return min(changes), max(changes)
