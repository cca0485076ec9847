"""Where a typed time leads: "120", "12.5s", "00:01:02:03", "clip 7", "+10". Arithmetic only."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

from engine.capture.clip import Clip
from ui.panels.timeline.units import frames_per_second_of_timecode
from ui.style.numbers import format_count

HINT = "120   12.5s   00:01:02:03   clip 7   +10"
MAX_CHARACTERS = 40
_CLIP = re.compile(r"clip\s*([0-9]+)")
_SECONDS = re.compile(r"([0-9]+\.?[0-9]*|\.[0-9]+)\s*s(?:ec)?")
_TIMECODE = re.compile(r"[0-9]+(?::[0-9]+){1,3}")
_FRAME = re.compile(r"[0-9]+")
_RELATIVE = re.compile(r"([+-])\s*([0-9]+)")


@dataclass(frozen=True, slots=True)
class Jump:
    """Meaning of a typed time.

    Attributes:
        frame_index: The frame to go to; None where the text means nothing.
        words: A note for the user; empty where all is as typed.
    """

    frame_index: int | None
    words: str = ""


def parse_jump(text: str, frame_index: int, clips: Sequence[Clip], fps: float) -> Jump:
    """Meaning of a text, at a playhead in a capture of some clips."""
    typed = text.strip().lower()
    if not typed or len(typed) > MAX_CHARACTERS or not clips:
        return Jump(None, f"Type a time, for example: {HINT}")
    if match := _CLIP.fullmatch(typed):
        return _clip(int(match[1]), clips)
    n_frames = clips[-1].stop
    if match := _RELATIVE.fullmatch(typed):
        return _held(frame_index + int(match[1] + match[2]), n_frames)
    if match := _SECONDS.fullmatch(typed):
        return _held(math.floor(float(match[1]) * fps + 1e-6), n_frames)
    if _TIMECODE.fullmatch(typed):
        return _timecode(typed, n_frames, fps)
    if _FRAME.fullmatch(typed):
        return _held(int(typed), n_frames)
    return Jump(None, f"That is not a time. Type, for example: {HINT}")


def _held(frame_index: int, n_frames: int) -> Jump:
    if frame_index < 0:
        return Jump(0, "The first frame is 0.")
    if frame_index >= n_frames:
        return Jump(n_frames - 1, f"The last frame is {format_count(n_frames - 1)}.")
    return Jump(frame_index)


def _clip(clip_index: int, clips: Sequence[Clip]) -> Jump:
    if clip_index >= len(clips):
        return Jump(clips[-1].start, f"The last clip is {format_count(len(clips) - 1)}.")
    return Jump(clips[clip_index].start)


def _timecode(text: str, n_frames: int, fps: float) -> Jump:
    nominal = frames_per_second_of_timecode(fps)
    numbers = [int(part) for part in text.split(":")]
    hours, minutes, seconds, frames = [0] * (4 - len(numbers)) + numbers
    if frames >= nominal:
        return Jump(None, f"A second of timecode has {nominal} frames here: 00 to {nominal - 1}.")
    if seconds >= 60 or minutes >= 60:
        return Jump(None, "Minutes and seconds of a timecode go from 00 to 59.")
    return _held(((hours * 60 + minutes) * 60 + seconds) * nominal + frames, n_frames)
