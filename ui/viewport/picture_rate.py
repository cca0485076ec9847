"""How many pictures per second are really shown while playing. Counts changes on screen, not frames of the window."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace

from app.playback.prefetch_order import Course

WINDOW_S = 2.0
"""The rate is that of the last seconds."""
LEAST_S = 0.5
"""Before this much time has passed no rate is shown."""


@dataclass(frozen=True)
class ShownRate:
    """Pictures of the last seconds.

    Attributes:
        per_s: Pictures per second; None before there was time to count.
        has_skipped: Whether frames were left out between them.
        every_nth: Of the frames that were to be played, one in about so many was shown.
        wanted_per_s: How many there would be if none was left out.
        is_every_frame: Whether playback waits for each frame.
    """

    per_s: float | None
    has_skipped: bool = False
    is_every_frame: bool = False
    every_nth: int = 1
    wanted_per_s: float = 30.0


class PictureRate:
    """Counts frames as they appear on screen, from one start of playback to its end."""

    def __init__(self) -> None:
        self._started_s: float | None = None
        self._before_s = 0.0  # the last change before those that are counted
        self._frame: int | None = None
        self._changes: deque[tuple[float, int]] = deque()  # when, and how many frames on
        self._wanted_per_s = 30.0

    def stop(self) -> None:
        """Playback has ended; the next note begins anew."""
        self._started_s, self._frame = None, None
        self._changes.clear()

    def note(self, frame_index: int, course: Course, now_s: float) -> None:
        """A picture of this frame is on screen now, whether it is another one or not.

        Args:
            course: The frames played, their direction and speed.
            now_s: Seconds of a clock that never goes back.
        """
        self._wanted_per_s = course.frames_per_s
        if self._started_s is None or self._frame is None:
            self._started_s = self._before_s = now_s
            self._frame = frame_index
            return
        if frame_index != self._frame:
            steps = replace(course, frame_index=self._frame, is_playing=True).distance(frame_index)
            self._changes.append((now_s, round(steps)))
            self._frame = frame_index

    def rate(self, now_s: float, *, is_every_frame: bool = False) -> ShownRate:
        """The counts so far."""
        recent = self._changes
        while recent and recent[0][0] <= now_s - WINDOW_S:
            self._before_s = recent.popleft()[0]
        if self._started_s is None or now_s - self._started_s < LEAST_S:
            return ShownRate(None, is_every_frame=is_every_frame, wanted_per_s=self._wanted_per_s)
        if not recent:
            return ShownRate(0.0, is_every_frame=is_every_frame, wanted_per_s=self._wanted_per_s)
        # From change to change, so that where the window happens to begin does not matter; late pictures count.
        seconds = recent[-1][0] - self._before_s
        late_s = now_s - recent[-1][0] - seconds / len(recent)
        per_s = len(recent) / max(seconds + max(late_s, 0.0), 1e-3)
        steps = [n for _, n in recent]
        return ShownRate(per_s, max(steps) > 1, is_every_frame, round(sum(steps) / len(steps)), self._wanted_per_s)
