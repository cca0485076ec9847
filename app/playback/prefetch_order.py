"""Course: where the playhead goes next, and how far off every other frame is. Decides what is made ahead, and what is
kept of it."""

from __future__ import annotations

from dataclasses import dataclass

from app.playback.timeline import Timeline

BEHIND = 2.0
"""A frame that was passed while standing still counts as this many times as far away as one that comes."""


@dataclass(frozen=True, slots=True)
class Course:
    """A playhead and its way.

    Attributes:
        frame_index: Where it is.
        direction: 1 or -1.
        first, last: The frames that are played, ends included.
        is_looping: Whether it continues at the other end.
        is_playing: Whether it moves automatically.
        frames_per_s: How fast, while it does.
        is_loaded_first: Whether all played frames are made ready first, because none may be left out.
    """

    frame_index: int = 0
    direction: int = 1
    first: int = 0
    last: int = 0
    is_looping: bool = True
    is_playing: bool = False
    frames_per_s: float = 30.0
    is_loaded_first: bool = False

    @classmethod
    def of(cls, timeline: Timeline) -> Course:
        """As the timeline says."""
        first, last = timeline.play_range
        return cls(
            frame_index=timeline.frame_index,
            direction=timeline.direction,
            first=first,
            last=last,
            is_looping=timeline.is_looping or timeline.around is not None,
            is_playing=timeline.is_playing,
            frames_per_s=timeline.fps * timeline.speed,
            is_loaded_first=timeline.is_playing and timeline.around is not None and timeline.plays_every_frame,
        )

    @property
    def n_frames(self) -> int:
        """Number of frames that are played in all."""
        return self.last - self.first + 1

    def ahead(self, n: int) -> list[int]:
        """The next frames, nearest first: n of them, or as many as there are."""
        start, step = self.frame_index, self.direction
        if self.is_looping and self.first <= start <= self.last:
            n = min(n, self.n_frames - 1)
            return [self.first + (start - self.first + step * (i + 1)) % self.n_frames for i in range(n)]
        end = self.last if step > 0 else self.first
        return list(range(start + step, end + step, step))[: max(n, 0)]

    def distance(self, frame_index: int) -> float:
        """How far off it is that a frame is shown, in frames. While it plays, passed frames come last."""
        steps = (frame_index - self.frame_index) * self.direction
        is_within = self.first <= frame_index <= self.last and self.first <= self.frame_index <= self.last
        if steps >= 0:
            return float(steps) if is_within or not self.is_playing else float(self.n_frames + steps)
        if not self.is_playing:
            return -BEHIND * steps
        return float(steps % self.n_frames) if is_within and self.is_looping else float(self.n_frames - steps)
