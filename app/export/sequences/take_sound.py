"""The sound of an exported take as a WAV file in memory."""

from __future__ import annotations

import io
import wave
from typing import TYPE_CHECKING

import numpy as np

from app.export.video.timed_sound import TimedSound
from engine.capture.files.sound import SoundReader, sound_source

if TYPE_CHECKING:
    from engine.capture.capture import Capture
    from engine.timing.timing import TakeTiming

RATE = 48_000
"""Samples per second."""
_BLOCK_S = 10


def take_sound(capture: Capture, camera: str, first: int, timing: TakeTiming | None, seconds: float) -> bytes:
    """Sound in stereo, 16 bits.

    Args:
        capture: Has the camera.
        camera: Name of the camera that recorded it.
        first: Frame with which it begins: of the take where that has a timing, else of the capture.
        timing: Of the take; None where it plays as captured.
        seconds: How long.
    Raises:
        CaptureError: There is no such camera, it has no sound, or its track is damaged.
    """
    row = capture.camera_indices([camera])[0]
    path, start_s = sound_source(capture, row, first if timing is None else 0)
    source = (
        SoundReader(path, start_s, rate=RATE)
        if timing is None
        else TimedSound(path, start_s, timing, capture.fps, first, rate=RATE)
    )
    found = io.BytesIO()
    with wave.open(found, "wb") as file, source:
        file.setnchannels(2)
        file.setsampwidth(2)
        file.setframerate(RATE)
        n_left = round(seconds * RATE)
        while n_left > 0:
            samples = source.read(min(n_left, _BLOCK_S * RATE))
            file.writeframes(np.round(np.clip(samples, -1.0, 1.0) * 32767).astype("<i2").tobytes())
            n_left -= len(samples)
    return found.getvalue()
