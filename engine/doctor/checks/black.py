"""Black and white pictures: a lens cap, a lamp that failed, a video with an empty beginning."""

from __future__ import annotations

import numpy as np

from engine.capture.writers.capture_json import Corrections
from engine.doctor.finding import Finding, PictureEvidence
from engine.doctor.picture_survey import PictureSurvey
from engine.doctor.words import spans

DARK, BRIGHT = 20.0, 240.0
"""Grey levels: a picture is empty when nearly all of it is below the first, or above the second."""
NEARLY_ALL = 98.0
"""Percent of the picture."""


def empty_pictures(gray: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Which pictures [T, h, w] uint8 are black, and which are white. [T] bool each"""
    flat = gray.reshape(len(gray), -1)
    is_black = np.percentile(flat, NEARLY_ALL, axis=1) < DARK
    return is_black, np.percentile(flat, 100.0 - NEARLY_ALL, axis=1) > BRIGHT


def check_black(look: PictureSurvey) -> list[Finding]:
    """Empty pictures of each camera."""
    found = []
    for name, camera in zip(look.names, look.cameras, strict=True):
        if camera is None:
            continue
        is_black, is_white = empty_pictures(camera.gray)
        for is_empty, word in ((is_black, "black"), (is_white, "white")):
            if is_empty.any():
                frames = [frame for frame, is_bad in zip(look.frames, is_empty, strict=True) if is_bad]
                found.append(_finding(name, frames, len(camera.gray), word))
    return found


def _finding(name: str, frames: list[int], n_looked_at: int, word: str) -> Finding:
    is_all = len(frames) == n_looked_at
    where = "every picture" if is_all else f"{len(frames)} of {n_looked_at} pictures (frames {spans(frames)})"
    return Finding(
        kind=word,
        severity="error" if len(frames) > 0.5 * n_looked_at else "warning",
        cameras=(name,),
        frames=() if is_all else tuple(frames),
        text=f"{name} is {word} in {where}.",
        certainty=0.98,
        advice="Leave this camera out, or cut these frames from the capture.",
        fix=Corrections(is_excluded={name: True}),
        evidence=(PictureEvidence(name, frames[0], f"{name}, frame {frames[0]}"),),
    )
