"""estimate_offsets: asks every source in turn and puts their answers together."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from engine.camera.rig import CameraRig
from engine.capture.capture import Capture
from engine.progress import Progress, ReportProgress
from engine.synchronisation.recording import Recording, recordings_of
from engine.synchronisation.synchronisation import Estimate, Synchronisation

Source = Callable[..., Estimate]


def estimate_offsets(
    recordings: Sequence[Recording],
    *,
    fps: float,
    rig: CameraRig | None = None,
    max_offset_s: float = 1.0,
    report: ReportProgress = lambda progress: None,
) -> Synchronisation:
    """Find how far each camera is ahead, from tags, sound, and what is seen to move.

    Args:
        recordings: One per camera.
        fps: Frames per second in which offsets are counted.
        rig: The calibration; with it, where things move is compared, not only how much.
        max_offset_s: How far pictures are compared beyond what tags and sound say.
        report: Called often with how far it is; may raise to cancel.
    Raises:
        CaptureError: Pictures cannot be read.
        ValueError: rig is not of as many cameras.
    """
    raise NotImplementedError


def synchronise(capture: Capture, *, report: ReportProgress = lambda progress: None) -> Synchronisation:
    """`estimate_offsets` of a capture with its calibration: what is left after the offsets it has already."""
    return estimate_offsets(recordings_of(capture), fps=capture.fps, rig=capture.rig, report=report)
