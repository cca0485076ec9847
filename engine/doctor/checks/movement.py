"""Cameras that move although they ought to stand still: knocked, sagging, or on a floor that shakes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from engine.capture.writers.capture_json import Corrections
from engine.doctor.alignment import align
from engine.doctor.finding import Finding, PictureEvidence
from engine.doctor.picture_survey import PictureSurvey
from engine.parallel import map_ordered

MOVED_SHARE = 0.0022
"""Of the picture's width; less motion than this cannot be distinguished from moving people."""
LEAST_GAIN = 0.25
"""Share of the difference between two pictures that the motion has to explain."""
ROWS = (2, 4, 6, 8, 11)
"""Pictures, of those spread over the length, that are compared with the first."""
LEAST_DIFFERENCE = 1.0
"""Grey levels; with less there is nothing to explain."""


def check_movement(look: PictureSurvey, tell: Callable[[float], None] = lambda done: None) -> list[Finding]:
    """Compare pictures over the whole length with the first one.

    tell: Called with the share that is done; may raise.
    """
    done = [0]
    rows = [spread_row for spread_row in ROWS if spread_row < len(look.spread)]
    frames = [look.spread[spread_row] for spread_row in rows]

    def motions(row: int) -> np.ndarray:
        """Of each later picture against the first, as shares of the width."""
        camera = look.cameras[row]
        if camera is None:
            return np.zeros(0)
        found = np.zeros(len(rows))
        for i, spread_row in enumerate(rows):
            picture = camera.steady[spread_row]
            one = align(camera.steady[0], picture)
            is_clear = one.before > LEAST_DIFFERENCE and one.after < (1 - LEAST_GAIN) * one.before
            found[i] = one.shift_px / picture.shape[1] if is_clear else 0.0
        done[0] += 1
        tell(done[0] / len(look.cameras))
        return found

    findings = []
    for row, found in enumerate(map_ordered(motions, range(len(look.cameras)))):
        has_moved = found > MOVED_SHARE
        # one picture alone may be a passer-by close to the lens; a camera that was moved stays there or continues
        if has_moved.sum() >= 2 or (len(found) and has_moved[-1]):
            findings.append(_finding(look, row, frames, found, has_moved))
    return findings


def _finding(look: PictureSurvey, row: int, frames: list[int], found: np.ndarray, has_moved: np.ndarray) -> Finding:
    name, width = look.names[row], int(look.capture.rig.image_sizes[row, 0])
    worst = int(found.argmax())
    first = int(np.flatnonzero(has_moved)[0])
    start = look.spread[0]
    since, until = frames[first - 1] if first else start, frames[first]
    n_moved = int(has_moved.sum())
    return Finding(
        kind="moves",
        severity="warning",
        cameras=(name,),
        frames=(until,),
        text=f"{name} moves: against frame {start} its picture is shifted by up to {found[worst] * width:.1f} px; "
        f"this begins between frames {since} and {until}.",
        certainty=min(0.6 + 0.05 * n_moved + 20.0 * (float(found[worst]) - MOVED_SHARE), 0.97),
        advice="Cameras must stand still. Leave this one out, or train only the frames before it moves.",
        fix=Corrections(is_excluded={name: True}),
        evidence=(
            PictureEvidence(name, start, f"{name}, frame {start}"),
            PictureEvidence(name, frames[worst], f"frame {frames[worst]}"),
        ),
    )
