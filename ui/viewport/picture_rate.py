"""How many pictures per second are really shown while playing. Counts changes on screen, not frames of the window."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

WINDOW_S = 2.0
"""The rate is that of the last seconds."""
LEAST_S = 0.5
"""Before this much time has passed no rate is shown."""


@dataclass(frozen=True)
class ShownRate:
    """What was seen of the last seconds.

    Attributes:
        per_s: Pictures per second; None before there was time to count.
        has_skipped: Whether frames were left out between them.
        is_every_frame: Whether playback waits for each frame.
    """

    per_s: float | None
    has_skipped: bool = False
    is_every_frame: bool = False


class PictureRate:
    """Counts frames as they appear on screen, from one start of playback to its end."""

    def __init__(self) -> None:
        self._started_s: float | None = None
        self._before_s = 0.0  # the last change before those that are counted
        self._frame: int | None = None
        self._changes: deque[tuple[float, bool]] = deque()

    def stop(self) -> None:
        """Playback has ended; the next note begins anew."""
        self._started_s, self._frame = None, None
        self._changes.clear()

    def note(self, frame_index: int, n_frames: int, now_s: float) -> None:
        """A picture of this frame is on screen now, whether it is another one or not.

        Args:
            n_frames: Of the capture: after the last one comes the first.
            now_s: Seconds of a clock that never goes back.
        """
        if self._started_s is None or self._frame is None:
            self._started_s = self._before_s = now_s
            self._frame = frame_index
            return
        if frame_index != self._frame:
            has_skipped = frame_index != (self._frame + 1) % max(n_frames, 1)
            self._changes.append((now_s, has_skipped))
            self._frame = frame_index

    def rate(self, now_s: float, *, is_every_frame: bool = False) -> ShownRate:
        """What was counted up to now."""
        recent = self._changes
        while recent and recent[0][0] <= now_s - WINDOW_S:
            self._before_s = recent.popleft()[0]
        if self._started_s is None or now_s - self._started_s < LEAST_S:
            return ShownRate(None, is_every_frame=is_every_frame)
        if not recent:
            return ShownRate(0.0, is_every_frame=is_every_frame)
        # From change to change, so that where the window happens to begin does not matter; what is late counts.
        seconds = recent[-1][0] - self._before_s
        late_s = now_s - recent[-1][0] - seconds / len(recent)
        per_s = len(recent) / max(seconds + max(late_s, 0.0), 1e-3)
        return ShownRate(per_s, any(has_skipped for _, has_skipped in recent), is_every_frame)
