"""Offsets by sound: the shift at which the sound tracks of two cameras are most alike (GCC-PHAT).

Every frequency counts the same, whatever microphones make of it, so a clap or a step gives one sharp peak. Sound needs
3 ms for a metre: between a camera near the source and one far from it that much is not an offset of clocks.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from av.audio.resampler import AudioResampler

from engine.capture.files.media import VIDEO_FAULTS, opened_video
from engine.synchronisation.recording import Recording
from engine.synchronisation.solving import solve_pairs
from engine.synchronisation.synchronisation import Estimate, PairOffset

RATE = 8000
"""Samples per second that are compared: an eighth of a millisecond apart."""
MAX_SECONDS = 60.0
"""From the beginning of each track."""
BAND_HZ = (120.0, 3600.0)
"""Without hum below and without what compression leaves of hiss above."""
MIN_PEAK = 9.0
"""Height of the peak in standard deviations of the rest; chance reaches 6 in a million shifts."""
SIGMA_S = 0.002
SOUND_PATH_S = 0.004
"""How uncertain offsets are by the way of the sound, which nobody measures: a metre and a half."""
PARTNERS = 5
"""Cameras that each one is compared with, apart from those that are compared with it."""


def audio_estimate(
    recordings: Sequence[Recording], fps: float, *, after_camera: Callable[[int], None] = lambda done: None
) -> Estimate:
    """Offsets from the sound tracks of those recordings that have one.

    Args:
        recordings: One per camera.
        fps: Frames per second in which offsets are counted.
        after_camera: Called with how many tracks are read.
    """
    spectra: dict[int, tuple[np.ndarray, float, int]] = {}
    n_fft = 1 << (2 * int(MAX_SECONDS * RATE)).bit_length()
    for row, recording in enumerate(recordings):
        track = None if recording.video is None else _sound(recording)
        if track is not None and float(np.abs(track[0]).max()) > 1e-4:
            spectra[row] = (_whitened(track[0], n_fft), track[1] - recording.start_s, len(track[0]))
        after_camera(row + 1)
    pairs = []
    rows = list(spectra)
    for at, first in enumerate(rows):
        for step in range(1, PARTNERS + 1):
            second = rows[(at + step) % len(rows)]
            if second == first or (2 * step > len(rows) or (2 * step == len(rows) and at >= step)):
                continue
            delay_s = _delay(spectra[first][0], spectra[second][0], n_fft, min(spectra[first][2], spectra[second][2]))
            if delay_s is not None:
                offset = (delay_s + spectra[second][1] - spectra[first][1]) * fps
                pairs.append(PairOffset(first, second, offset, SIGMA_S * fps))
    solution = solve_pairs(len(recordings), pairs)
    sigmas = np.sqrt(np.maximum(solution.sigmas_frames, 0.5 * SIGMA_S * fps) ** 2 + (SOUND_PATH_S * fps) ** 2)
    if not spectra:
        note = "No sound tracks found."
    elif not pairs:
        note = f"{len(spectra)} cameras have sound, but no two share any."
    else:
        note = f"{len(spectra)} cameras have sound; {len(pairs)} pairs were compared over up to {MAX_SECONDS:g} s."
    return Estimate("audio", solution.offsets_frames, sigmas, solution.groups, tuple(pairs), solution.agreements, note)


def _sound(recording: Recording) -> tuple[np.ndarray, float] | None:
    """The sound of a file in one channel, and when it begins in seconds of the file; None without any. [S] float32"""
    assert recording.video is not None
    chunks: list[np.ndarray] = []
    start_s: float | None = None
    n_wanted = int(MAX_SECONDS * RATE)
    resampler = AudioResampler(format="flt", layout="mono", rate=RATE)

    def take(frames: list[Any]) -> int:
        chunks.extend(frame.to_ndarray().reshape(-1) for frame in frames)
        return sum(len(chunk) for chunk in chunks)

    try:
        with opened_video(recording.video) as container:
            if not container.streams.audio:
                return None
            for frame in container.decode(container.streams.audio[0]):
                if start_s is None:
                    start_s = float(frame.time or 0.0)
                if take(resampler.resample(frame)) >= n_wanted:
                    break
            else:
                take(resampler.resample(None))
    except (*VIDEO_FAULTS, ValueError, OSError):  # a sound track is a help, not a condition
        pass
    if start_s is None or not chunks:
        return None
    return np.concatenate(chunks)[:n_wanted].astype(np.float32), start_s


def _whitened(sound: np.ndarray, n_fft: int) -> np.ndarray:
    """The spectrum with all frequencies of the band alike. [F] complex64"""
    spectrum = np.fft.rfft(sound - sound.mean(), n_fft)
    frequencies = np.fft.rfftfreq(n_fft, 1 / RATE)
    size = np.abs(spectrum)
    is_in_band = (frequencies >= BAND_HZ[0]) & (frequencies <= BAND_HZ[1]) & (size > 1e-6 * size.max(initial=1e-12))
    return np.where(is_in_band, spectrum / np.maximum(size, 1e-30), 0).astype(np.complex64)


def _delay(first: np.ndarray, second: np.ndarray, n_fft: int, n_shared: int) -> float | None:
    """Seconds by which the same sound comes later in the second track; None where nothing is the same.

    n_shared: samples of the shorter track: so far are the tracks shifted against each other.
    """
    likeness = np.fft.irfft(np.conj(first) * second, n_fft)
    shifts = np.r_[likeness[-n_shared:], likeness[: n_shared + 1]]  # from -n_shared on
    row = int(np.argmax(shifts))
    if not 0 < row < len(shifts) - 1 or shifts[row] < MIN_PEAK * float(shifts.std()):
        return None
    before, top, after = shifts[row - 1 : row + 2]
    bend = before - 2 * top + after
    shift = 0.5 * (before - after) / bend if bend < 0 else 0.0
    return float((row - n_shared + shift) / RATE)
