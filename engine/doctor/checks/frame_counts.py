"""Cameras with fewer or more frames than the others, pictures that cannot be read, and captures that are very short."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from engine.capture.capture import Capture
from engine.capture.frames import IndexedFrames
from engine.capture.writers.capture_json import Corrections
from engine.doctor.finding import Finding
from engine.doctor.words import counted, listed
from engine.errors import CaptureError

SMALL_SHARE = 0.02
"""Cameras are started and stopped one after the other: so much less or more than usual is nothing to worry about."""


def check_frame_counts(capture: Capture) -> list[Finding]:
    """Look at numbers only."""
    counts = np.array([_n_frames(capture, row) for row in range(len(capture.rig))])
    usual = int(np.median(counts))
    names = np.array(capture.rig.names)
    found = []
    is_short = counts < usual * (1 - SMALL_SHARE) - 1
    if is_short.any():
        short = tuple(names[is_short].tolist())
        least = int(counts[is_short].min())
        found.append(
            Finding(
                kind="frame counts",
                severity="warning",
                cameras=short,
                frames=(),
                text=f"{listed(short)} {counted(short, 'has', 'have')} {_span(counts[is_short])} frames, most cameras "
                f"have {usual}; only the {capture.n_frames} frames they share are used.",
                certainty=1.0,
                advice=f"Copy the missing part, or leave {counted(short, 'this camera', 'these cameras')} out: that "
                f"gives {usual - least} frames more.",
                fix=Corrections(is_excluded=dict.fromkeys(short, True)),
            )
        )
    elif len(set(counts.tolist())) > 1:
        text = f"Cameras have {_span(counts)} frames; the {capture.n_frames} they share are used."
        advice = "Check that all of them were started at the same moment: see synchronisation."
        found.append(Finding("frame counts", "note", (), (), text, 1.0, advice))
    return found


def check_readable(unreadable: Mapping[str, CaptureError]) -> list[Finding]:
    """Cameras whose pictures could not be decoded, by name."""
    return [
        Finding(
            kind="unreadable",
            severity="error",
            cameras=(name,),
            frames=(),
            text=f"{name} cannot be read: {error.message}",
            certainty=1.0,
            advice=f"{error.hint} Or leave the camera out.",
            fix=Corrections(is_excluded={name: True}),
        )
        for name, error in unreadable.items()
    ]


def _n_frames(capture: Capture, row: int) -> int:
    """Frames of a camera, counted at the rate of the capture: one of another rate has others, and none is missing."""
    source = capture.layout.cameras[row].source
    if not isinstance(source, IndexedFrames):
        return source.n_frames
    own, shown = source.source.n_frames, source.frame_indices
    n_across = int(shown[-1]) - int(shown[0])
    if n_across <= 0 or n_across == len(shown) - 1:
        return own
    return round(own * (len(shown) - 1) / n_across)


def _span(counts: np.ndarray) -> str:
    low, high = int(counts.min()), int(counts.max())
    return f"{low}" if low == high else f"{low} to {high}"
