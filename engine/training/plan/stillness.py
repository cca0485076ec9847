"""Whether nothing moves in a clip, looked up before it is trained: then it takes no steps and stores next to nothing.

By the motion masks that training itself would find, against the backgrounds that the reference clip left behind.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from engine.capture.capture import Capture
from engine.capture.clip import Clip
from engine.cloud.background.exposure import Exposure
from engine.training.config import TrainConfig
from engine.training.preparation.cloud_preparation import key_of_corrected, moving_pixels, read_backgrounds


def looks_still(
    capture: Capture, clip: Clip, camera_indices: Sequence[int], config: TrainConfig, prep_dir: Path
) -> bool:
    """Whether no training camera sees anything move in the middle, at the end and at the beginning of a
    source clip.

    It ends at the first picture in which something moves. False where that is unknown, as there are no backgrounds yet,
    and where a clip learns something even if nothing moves.

    Args:
        capture: At working resolution.
        clip: A clip that inherits.
        camera_indices: Training cameras, in capture numbering.
        config: All settings.
        prep_dir: Folder in which the reference clip kept its backgrounds.
    Raises:
        CaptureError: A picture cannot be read.
    """
    if config.gate != "hull" or not config.keeps_static or config.field != "per_clip" or config.backgrounds == "clip":
        return False
    backgrounds = read_backgrounds(prep_dir, key_of_corrected(capture, clip, camera_indices, config))
    if backgrounds is None:
        return False
    last = clip.n_frames - 1
    instants = dict.fromkeys((last // 2, last, 0))  # each once; most motion shows in the first picture or two
    return not any(
        moving_pixels(
            _seen(capture.frame(camera, clip.start + instant), background, config),
            background,
            capture,
            camera,
            clip.start + instant,
        ).any()
        for instant in instants
        for camera, background in zip(camera_indices, backgrounds.images, strict=True)
    )


def _seen(picture: np.ndarray, background: np.ndarray, config: TrainConfig) -> np.ndarray:
    """The picture as training compares it: in the background's exposure, where exposure counts."""
    if config.color == "off":
        return picture
    return Exposure.of_background(background).applied_to(picture[None])[0]
