"""Offsets by what cameras wrote into their files: timecode, to the frame; time of creation, to the second.

Timecode is only as good as the clocks that wrote it: cameras that were set alike in the morning differ by frames in
the evening. The time of creation is often that of a copy, so it is shown, but nothing follows from it.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import datetime

import numpy as np

from engine.capture.files.media import VIDEO_FAULTS, opened_video
from engine.synchronisation.recording import Recording
from engine.synchronisation.synchronisation import Estimate, SourceName

TIMECODE_SIGMA_FRAMES = 0.4
"""Two cameras with the same timecode expose at any time within that frame."""
CREATION_SIGMA_S = 0.6
DAY_S = 86400.0
_TIMECODE = re.compile(r"(\d{1,2}):(\d{2}):(\d{2})([:;.,])(\d{2,3})")


def tag_estimates(recordings: Sequence[Recording], fps: float) -> tuple[Estimate, Estimate]:
    """Offsets by timecode and by time of creation."""
    codes, created = [], []
    for recording in recordings:
        code, creation = _tags(recording)
        codes.append(code - recording.skipped_s if code is not None else None)
        created.append(creation - recording.skipped_s if creation is not None else None)
    return (
        _estimate("timecode", codes, fps, TIMECODE_SIGMA_FRAMES),
        _estimate("creation time", created, fps, CREATION_SIGMA_S * fps),
    )


def timecode_seconds(text: str, rate: float) -> float | None:
    """Seconds of the day at which a timecode begins, "01:02:03:04" or with ";" where frame numbers are dropped.

    Args:
        text: As the file has it.
        rate: True frames per second of the camera, such as 29.97.
    """
    match = _TIMECODE.fullmatch(text.strip())
    if match is None or rate <= 0:
        return None
    hours, minutes, seconds, frames = (int(match[group]) for group in (1, 2, 3, 5))
    nominal = round(rate)
    if nominal < 1 or frames >= max(nominal, 1) or minutes > 59 or seconds > 59 or hours > 23:
        return None
    count = (hours * 3600 + minutes * 60 + seconds) * nominal + frames
    if match[4] != ":" and nominal % 30 == 0:  # two numbers in 30 are left out each minute but each tenth
        all_minutes = hours * 60 + minutes
        count -= nominal // 15 * (all_minutes - all_minutes // 10)
    return count / rate


def _tags(recording: Recording) -> tuple[float | None, float | None]:
    """Seconds of the day by timecode, and seconds since 1970 by time of creation."""
    if recording.video is None:
        return None, None
    try:
        with opened_video(recording.video) as container:
            stream = container.streams.video[0]
            places = [container.metadata, *(other.metadata for other in container.streams)]
            rate = float(stream.average_rate or 0)
            code = next((place["timecode"] for place in places if "timecode" in place), None)
            created = next((place["creation_time"] for place in places if "creation_time" in place), None)
    except (*VIDEO_FAULTS, OSError, ValueError, IndexError):  # tags are a help, not a condition
        return None, None
    code_s = None if code is None else timecode_seconds(code, rate)
    try:
        created_s = None if created is None else datetime.fromisoformat(created).timestamp()
    except ValueError:
        created_s = None
    return code_s, created_s


def _estimate(source: SourceName, begins_s: list[float | None], fps: float, sigma: float) -> Estimate:
    """A camera that began later has a smaller frame number at the same moment."""
    known = np.array([begin is not None for begin in begins_s], dtype=bool)
    begins = np.array([np.nan if begin is None else begin for begin in begins_s])
    offsets = np.full(len(begins), np.nan)
    what = "a timecode" if source == "timecode" else "a time of creation"
    if known.sum() < 2:
        note = f"{int(known.sum()) or 'No'} camera{'' if known.sum() == 1 else 's'} wrote {what}."
        known[:] = False
    elif source == "timecode" and np.ptp(begins[known]) == 0 and begins[known][0] == 0:
        note = "All timecodes are 0 and therefore useless."
        known[:] = False
    else:
        later_s = begins - begins[known][0]
        later_s = later_s - DAY_S * np.round(later_s / DAY_S) if source == "timecode" else later_s  # around midnight
        offsets = -later_s * fps
        note = f"{int(known.sum())} cameras recorded {what}."
    offsets[~known] = np.nan
    return Estimate(
        source=source,
        offsets_frames=offsets,
        sigmas_frames=np.where(known, sigma, np.nan),
        groups=np.where(known, 0, -1).astype(np.int64),
        pairs=(),
        agreements=np.full(len(begins), np.nan),
        note=note,
    )
