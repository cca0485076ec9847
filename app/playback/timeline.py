"""Timeline: the playhead, play state, and which clip a frame belongs to. Knows no pictures."""

from __future__ import annotations

import math
from collections.abc import Sequence

from engine.capture.clip import Clip


class Timeline:
    """Frame arithmetic and playing. An empty timeline (no capture) has zero frames and stands at frame 0.

    Attributes:
        frame_index: The playhead, in [0, n_frames).
        n_frames: Frames of the capture.
        fps: Frames per second of the capture.
        is_playing, is_looping: Play state.
        is_every_frame: Whether playing waits for each frame to be shown, instead of leaving some out.
    """

    def __init__(self, clips: Sequence[Clip] = (), *, fps: float = 30.0) -> None:
        self.clips = list(clips)
        self.n_frames = self.clips[-1].stop if self.clips else 0
        self.fps = fps if math.isfinite(fps) and fps > 0 else 30.0
        self.frame_index = 0
        self.is_playing = False
        self.is_looping = True
        self.is_every_frame = False
        self._carried_s = 0.0

    @property
    def last_frame(self) -> int:
        """Largest valid frame index; 0 when there are none."""
        return max(self.n_frames - 1, 0)

    def seek(self, frame_index: int) -> None:
        """Move the playhead, clamped to the capture."""
        self.frame_index = min(max(int(frame_index), 0), self.last_frame)
        self._carried_s = 0.0

    def step(self, n_frames: int) -> None:
        """Move by some frames; wraps around when looping."""
        target = self.frame_index + n_frames
        if self.is_looping and self.n_frames:
            target %= self.n_frames
        self.seek(target)

    def toggle_play(self) -> None:
        """Play or hold; playing from the last frame starts over."""
        self.is_playing = not self.is_playing and self.n_frames > 1
        self._carried_s = 0.0
        if self.is_playing and not self.is_looping and self.frame_index == self.last_frame:
            self.frame_index = 0

    def tick(self, dt_s: float, *, is_shown: bool = True) -> bool:
        """Let time pass while playing; time left over from whole frames is carried on.

        Args:
            dt_s: Seconds since the last tick; negative or non-finite values count as none.
            is_shown: Whether the frame under the playhead is on screen. Playing every frame waits for that.
        Returns:
            Whether the playhead moved.
        """
        if not self.is_playing or not math.isfinite(dt_s) or dt_s <= 0:
            return False
        self._carried_s += dt_s
        # the small addition keeps 3 ticks of 1/30 s at 10 fps from falling one ulp short of a frame
        n_frames = math.floor(self._carried_s * self.fps + 1e-9)
        if self.is_every_frame:
            n_frames = min(n_frames, 1 if is_shown else 0)
            self._carried_s = min(self._carried_s, (1 + n_frames) / self.fps)  # time lost is not caught up with
        if n_frames == 0:
            return False
        self._carried_s = max(self._carried_s - n_frames / self.fps, 0.0)
        before = self.frame_index
        if self.is_looping:
            self.frame_index = (self.frame_index + n_frames) % self.n_frames
        else:
            self.frame_index = min(self.frame_index + n_frames, self.last_frame)
            self.is_playing = self.frame_index < self.last_frame
        return self.frame_index != before

    def clip_of(self, frame_index: int) -> Clip | None:
        """The clip of a frame; None outside the capture."""
        if not self.clips or not 0 <= frame_index < self.n_frames:
            return None
        return self.clips[frame_index // self.clips[0].clip_length]

    @property
    def clip(self) -> Clip | None:
        """The clip under the playhead."""
        return self.clip_of(self.frame_index)

    def next_clip_start(self, frame_index: int) -> int:
        """First frame of the next clip; the last frame when there is none."""
        return next((clip.start for clip in self.clips if clip.start > frame_index), self.last_frame)

    def previous_clip_start(self, frame_index: int) -> int:
        """First frame of this clip, or of the one before when already there."""
        return next((clip.start for clip in reversed(self.clips) if clip.start < frame_index), 0)
