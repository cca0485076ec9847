"""Frames as people write them: frames, seconds or timecode; and where the ruler has its ticks. Arithmetic only."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass

from engine.text import rate_text
from ui.panels.timeline.time_range import TimeRange

FRAMES, SECONDS, TIMECODE = "frames", "seconds", "timecode"
UNITS = (FRAMES, SECONDS, TIMECODE)
TICK_SPACING = {FRAMES: 56.0, SECONDS: 64.0, TIMECODE: 104.0}
"""Labels are at least so far apart, units of the screen."""
MINUTE_S, HOUR_S = 60, 3600


def frames_per_second_of_timecode(fps: float) -> int:
    """Frames that a second of timecode counts: whole ones, 30 for 29.97 frames per second."""
    return max(round(fps), 1)


def unit_note(unit: str, fps: float) -> str:
    """A note on a unit."""
    if unit == FRAMES:
        return "Frames, counted from 0"
    if unit == SECONDS:
        return f"Seconds at {rate_text(fps)} frames per second"
    nominal = frames_per_second_of_timecode(fps)
    note = f"Hours:minutes:seconds:frames, {nominal} frames to the second"
    if abs(fps - nominal) < 1e-6:
        return note
    return f"{note}, non-drop: the capture has {rate_text(fps)}, so that this is not the time of day"


def timecode(frame_index: int, fps: float) -> str:
    """HH:MM:SS:FF, non-drop."""
    nominal = frames_per_second_of_timecode(fps)
    seconds, frames = divmod(max(int(frame_index), 0), nominal)
    digits = len(str(nominal - 1)) if nominal > 10 else 2
    return (
        f"{seconds // HOUR_S:02d}:{seconds // MINUTE_S % 60:02d}:{seconds % MINUTE_S:02d}:{frames:0{max(digits, 2)}d}"
    )


def format_time(frame_index: int, fps: float, unit: str) -> str:
    """One frame in a unit, exact to the frame."""
    if unit == SECONDS:
        return f"{frame_index / fps:.2f} s"
    return timecode(frame_index, fps) if unit == TIMECODE else str(frame_index)


@dataclass(frozen=True, slots=True)
class Ticks:
    """Labelled ticks of a ruler.

    Attributes:
        positions: In frames, rising; a whole number except for seconds that no frame begins with.
        labels: One for each.
    """

    positions: tuple[float, ...]
    labels: tuple[str, ...]


def ruler_ticks(shown: TimeRange, width: float, fps: float, unit: str, n_frames: int) -> Ticks:
    """Ticks of the shown part: at round values, as far apart as their labels need.

    Args:
        width: Of the ruler, units of the screen.
        n_frames: Of the capture; there are no ticks behind its last frame.
    """
    smallest = shown.length * TICK_SPACING[unit] / max(width, 1.0)
    step = next(step for step in _steps(unit, fps) if step >= smallest)
    first = max(math.ceil(shown.start / step - 1.0), 0)
    last = math.floor(min(shown.stop, n_frames - 1) / step + 1e-9)
    numbers = range(first, last + 1)
    positions = tuple(number * step for number in numbers)
    if unit != SECONDS:
        return Ticks(positions, tuple(format_time(round(position), fps, unit) for position in positions))
    decimals = max(0, -math.floor(math.log10(step / fps) + 1e-9))
    return Ticks(positions, tuple(f"{number * step / fps:.{decimals}f}" for number in numbers))


def _steps(unit: str, fps: float) -> Iterator[float]:
    """Frames between ticks that are round in a unit, rising without end; at least one frame."""
    if unit == TIMECODE:
        nominal = frames_per_second_of_timecode(fps)
        yield from (float(frames) for frames in (1, 2, 5, 10, 15, 30) if frames < nominal)
        yield from (float(seconds * nominal) for seconds in (1, 2, 5, 10, 15, 30))
        yield from (float(minutes * MINUTE_S * nominal) for minutes in (1, 2, 5, 10, 15, 30))
        yield from (hours * HOUR_S * nominal for hours in _round_numbers(0))
        return
    scale, smallest = (fps, -4) if unit == SECONDS else (1.0, 0)
    yield from (number * scale for number in _round_numbers(smallest) if number * scale >= 1.0 - 1e-9)


def _round_numbers(power: int) -> Iterator[float]:
    """1, 2 and 5 times the powers of ten from one on."""
    for exponent in itertools.count(power):
        for digit in (1, 2, 5):
            yield digit * 10.0**exponent
