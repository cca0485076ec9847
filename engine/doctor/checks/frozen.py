"""Pictures that repeat the one before: a camera that froze or lost frames, or a recording brought to a higher rate.

Judged by how much changes from picture to picture: nearly nothing, where that camera else changes and the others do at
the same moment. Where nothing moves at all, as in a single moment, nothing can be said.
"""

from __future__ import annotations

import numpy as np

from engine.capture.writers.capture_json import Corrections
from engine.doctor.checks.black import empty_pictures
from engine.doctor.finding import Finding, PictureEvidence
from engine.doctor.picture_survey import PictureSurvey
from engine.doctor.words import spans

STILL_SHARE = 0.08
"""A picture repeats the one before when it changes by less than this share of what is usual for the camera..."""
MOVING_SHARE = 0.4
"""... while the others change by more than this share of what is usual for them."""
LEAST_CHANGE = 0.02
"""Mean grey levels that usually change; less cannot be distinguished from nothing."""
MANY = 0.6
"""Share of the cameras that makes it a repeated moment, not a frozen camera."""
BAD_SHARE = 0.1
"""Of the frames; a camera with more repeated ones is better left out."""


def changes(gray: np.ndarray) -> np.ndarray:
    """Mean change of grey from each picture to the next. [T, h, w] uint8 to [T - 1]"""
    steps = np.abs(np.diff(gray.astype(np.int16), axis=0))
    return steps.reshape(len(steps), -1).mean(1)


def check_frozen(look: PictureSurvey) -> list[Finding]:
    """Frozen cameras, and moments that all cameras show twice."""
    rows = [row for row, camera in enumerate(look.cameras) if camera is not None]
    is_next = look.is_consecutive
    if len(rows) == 0 or is_next.sum() < 3:
        return []
    moved = np.stack([changes(camera.gray) for camera in look.cameras if camera is not None])[:, is_next]
    later = np.array(look.frames[1:])[is_next]
    usual = np.median(moved, axis=1)
    can_tell = usual > LEAST_CHANGE
    if not can_tell.any():
        return []
    ratios = moved / np.maximum(usual[:, None], 1e-9)
    is_empty = np.stack([np.logical_or(*empty_pictures(c.gray))[1:][is_next] for c in look.cameras if c is not None])
    is_still = (ratios < STILL_SHARE) & can_tell[:, None] & ~is_empty  # which another check reports
    n_telling = int(can_tell.sum())
    is_everywhere = is_still.sum(0) >= max(MANY * n_telling, 2)
    found = _repeated(look, later[is_everywhere], n_telling) if is_everywhere.any() else []
    for position, row in enumerate(rows):
        others = [i for i in range(len(rows)) if i != position and can_tell[i]]
        do_others_move = np.median(ratios[others], axis=0) > MOVING_SHARE if others else np.zeros(len(later), bool)
        frames = later[is_still[position] & do_others_move & ~is_everywhere]
        if len(frames):
            found.append(_frozen(look, row, frames.tolist(), len(later)))
    return found


def _frozen(look: PictureSurvey, row: int, frames: list[int], n_looked_at: int) -> Finding:
    name, share = look.names[row], len(frames) / n_looked_at
    is_bad = share > BAD_SHARE
    first = frames[0]
    many = f"{len(frames)} of {n_looked_at} pictures" if len(frames) > 1 else "1 picture"
    return Finding(
        kind="frozen",
        severity="warning",
        cameras=(name,),
        frames=tuple(frames),
        text=f"{name} repeats its previous picture in {many} (frames {spans(frames)}) while the other cameras "
        "continue.",
        certainty=0.95 if len(frames) > 1 else 0.85,
        advice="Leave this camera out, or export its video again without repeated frames."
        if is_bad
        else "Repeated frames blur motion; export the video again, or leave the camera out.",
        fix=Corrections(is_excluded={name: True}),
        evidence=(
            PictureEvidence(name, first - 1, f"{name}, frame {first - 1}"),
            PictureEvidence(name, first, f"frame {first}: the same picture again"),
        ),
    )


def _repeated(look: PictureSurvey, frames: np.ndarray, n_cameras: int) -> list[Finding]:
    listed_frames = [int(frame) for frame in frames]
    gaps = np.diff(listed_frames)
    every = f", every {int(gaps[0])} frames" if len(gaps) > 1 and (gaps == gaps[0]).all() and gaps[0] > 1 else ""
    name, first = look.names[0], listed_frames[0]
    return [
        Finding(
            kind="repeated",
            severity="warning",
            cameras=(),
            frames=tuple(listed_frames),
            text=f"Nearly all of {n_cameras} cameras show {len(listed_frames)} moments twice (frames "
            f"{spans(listed_frames)}{every}): the recording was probably converted to a higher frame rate.",
            certainty=0.85,
            advice="Export the videos at their recorded rate; repeated frames make motion stutter.",
            evidence=(
                PictureEvidence(name, first - 1, f"{name}, frame {first - 1}"),
                PictureEvidence(name, first, f"frame {first}: the same moment"),
            ),
        )
    ]
