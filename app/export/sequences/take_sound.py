"""The sound of an exported take as a WAV file, made while it is written."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from app.export.video.timed_sound import TimedSound
from engine.capture.files.sound import SoundReader, sound_source
from engine.errors import ProjectError
from engine.export.sequences.sequence import SequenceSound

if TYPE_CHECKING:
    from engine.capture.capture import Capture
    from engine.timing.timing import TakeTiming

RATE = 48_000
"""Samples per second."""
SAMPLE_BYTES = 4
"""Of a moment: two channels of 16 bits."""
_BLOCK_S = 10
_HEAD = struct.Struct("<4sI4s4sIHHIIHH4sI")
_MAX_SAMPLES = ((1 << 32) - 1 - _HEAD.size) // SAMPLE_BYTES
"""Sizes in a WAV file have 32 bits."""


def take_sound(capture: Capture, camera: str, first: int, timing: TakeTiming | None, seconds: float) -> SequenceSound:
    """Sound in stereo, 16 bits. Its pieces are decoded as they are asked for, and raise CaptureError where the track is
    damaged.

    Args:
        capture: Has the camera.
        camera: Name of the camera that recorded it.
        first: Frame with which it begins: of the take where that has a timing, else of the capture.
        timing: Of the take; None where it plays as captured.
        seconds: How long.
    Raises:
        CaptureError: The camera does not exist, or has no sound.
        ProjectError: It is too long for a WAV file.
    """
    n_samples = round(seconds * RATE)
    if n_samples > _MAX_SAMPLES:
        hours, most = seconds / 3600.0, _MAX_SAMPLES / RATE / 3600.0
        raise ProjectError(
            f"The sound lasts {hours:.1f} hours; a WAV file holds {most:.1f}.",
            hint="Leave the sound out, or export fewer frames.",
        )
    row = capture.camera_indices([camera])[0]
    path, start_s = sound_source(capture, row, first if timing is None else 0)

    def pieces() -> Iterator[bytes]:
        yield _head(n_samples * SAMPLE_BYTES)
        source = (
            SoundReader(path, start_s, rate=RATE)
            if timing is None
            else TimedSound(path, start_s, timing, capture.fps, first, rate=RATE)
        )
        with source:
            for begin in range(0, n_samples, _BLOCK_S * RATE):
                samples = source.read(min(_BLOCK_S * RATE, n_samples - begin))
                yield np.round(np.clip(samples, -1.0, 1.0) * 32767).astype("<i2").tobytes()

    return SequenceSound(_HEAD.size + n_samples * SAMPLE_BYTES, pieces)


def _head(n_bytes: int) -> bytes:
    """What a WAV file of so many bytes of samples begins with."""
    what = 1, 2, RATE, RATE * SAMPLE_BYTES, SAMPLE_BYTES, 8 * SAMPLE_BYTES // 2
    return _HEAD.pack(b"RIFF", _HEAD.size - 8 + n_bytes, b"WAVE", b"fmt ", 16, *what, b"data", n_bytes)
