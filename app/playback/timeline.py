"""Timeline: the playhead, how it plays, and which clip a frame belongs to. Knows no pictures."""

from __future__ import annotations

import math
from collections.abc import Sequence

from app.playback.markers import Markers
from app.playback.take_route import TakeRoute
from engine.capture.clip import Clip, ClipSpans
from engine.timing.timing import TakeTiming

SPEEDS = (0.125, 0.25, 0.5, 1.0, 2.0, 4.0)
"""Speeds at which a capture can be played, as multiples of its own speed."""
SEAM_REACH = 12
"""Frames on either side of a clip's first frame that are played around it."""


class Timeline:
    """Frame arithmetic and playing. An empty timeline (no capture) has zero frames and stands at frame 0.

    Ranges of frames name their first and last frame, as people do.

    Attributes:
        frame_index: The playhead, in [0, n_frames).
        spans: Finds the clip of a frame.
        n_frames: Frames of the capture.
        fps: Frames per second of the capture.
        is_playing, is_looping: Play state.
        is_every_frame: Whether playing waits for each frame to be shown, instead of leaving some out; around a seam it
            does so unless `is_skipping_around`.
        direction: 1 plays forward, -1 backward.
        speed: Multiple of the capture's own speed, one of SPEEDS.
        in_frame, out_frame: Where playing begins and ends; None where the capture does. in_frame <= out_frame.
        around: Frames that are played over and over for the moment, regardless of in_frame and out_frame; else None.
        is_following: Whether the playhead follows the training. Ends when the user moves it.
        timing: Of the take; None where it plays as captured.
        is_take: Whether playing follows the timing, so that the playhead goes where the take goes.
        markers: Frames that the user wants to find again; put here by who owns the document.
    """

    def __init__(self, clips: Sequence[Clip] = (), *, fps: float = 30.0) -> None:
        self.clips = list(clips)
        self.spans = ClipSpans(self.clips)
        self.n_frames = self.clips[-1].stop if self.clips else 0
        self.fps = fps if math.isfinite(fps) and fps > 0 else 30.0
        self.frame_index = 0
        self.is_playing = False
        self.is_looping = True
        self.is_every_frame = False
        self.is_skipping_around = False
        self.direction = 1
        self.speed = 1.0
        self.in_frame: int | None = None
        self.out_frame: int | None = None
        self.around: tuple[int, int] | None = None
        self.is_following = False
        self.timing: TakeTiming | None = None
        self.is_take = False
        self._route: TakeRoute | None = None
        self._route_key: object = None
        self.markers = Markers()
        self._carried = 0.0  # frames that are due and not yet gone: less than one, but for rounding not below zero

    def take_over(self, other: Timeline) -> None:
        """Continue where another timeline of the same frames is, as when they are cut into other clips."""
        for name in ("is_looping", "is_every_frame", "speed", "markers", "timing", "is_take"):
            setattr(self, name, getattr(other, name))
        self.set_range(other.in_frame, other.out_frame)
        self.seek(other.frame_index)

    # ---------------------------------------------------------------- the playhead

    @property
    def last_frame(self) -> int:
        """Largest valid frame index; 0 when there are none."""
        return max(self.n_frames - 1, 0)

    def clamped(self, frame_index: float) -> int:
        """The frame, held inside the capture."""
        return min(max(int(frame_index), 0), self.last_frame)

    def seek(self, frame_index: int) -> None:
        """The user moves the playhead; clamped to the capture. Ends following, and playing around some other place."""
        self.is_following = False
        self.go_to(frame_index)

    def go_to(self, frame_index: int) -> None:
        """Move the playhead as `seek` does, and keep following."""
        self.frame_index = self.clamped(frame_index)
        self._carried = 0.0
        if self.around is not None and not self.around[0] <= self.frame_index <= self.around[1]:
            self.around = None

    def step(self, n_frames: int) -> None:
        """Move by some frames; wraps around when looping."""
        target = self.frame_index + n_frames
        if self.is_looping and self.n_frames:
            target %= self.n_frames
        self.seek(target)

    # ---------------------------------------------------------------- the played range

    @property
    def play_range(self) -> tuple[int, int]:
        """First and last frame that playing visits."""
        if self.around is not None:
            return self.around
        first = 0 if self.in_frame is None else self.in_frame
        return first, self.last_frame if self.out_frame is None else self.out_frame

    def set_range(self, in_frame: int | None, out_frame: int | None) -> None:
        """Play from one frame to another; None where the capture begins or ends. Clamped, and put in order."""
        first = None if in_frame is None else self.clamped(in_frame)
        last = None if out_frame is None else self.clamped(out_frame)
        if first is not None and last is not None:
            first, last = min(first, last), max(first, last)
        self.in_frame, self.out_frame, self.around = first, last, None

    def set_in(self) -> None:
        """Playing begins at the playhead. An end before it is given up."""
        is_past_end = self.out_frame is not None and self.out_frame < self.frame_index
        self.set_range(self.frame_index, None if is_past_end else self.out_frame)

    def set_out(self) -> None:
        """Playing ends at the playhead. A beginning behind it is given up."""
        is_before_start = self.in_frame is not None and self.in_frame > self.frame_index
        self.set_range(None if is_before_start else self.in_frame, self.frame_index)

    def clear_range(self) -> None:
        """Play all of the capture."""
        self.set_range(None, None)

    @property
    def route(self) -> TakeRoute | None:
        """Where the take goes from the playhead on; None where the capture is played, or nothing of the take is between
        the in and out points."""
        if not self.is_take or self.timing is None or self.around is not None:
            return None
        key = (self.timing, *self.play_range)
        if self._route is None or self._route_key != key:
            self._route, self._route_key = TakeRoute(self.timing, *self.play_range, self.frame_index), key
        if not len(self._route):
            return None
        if self._route.frame_index != self.frame_index:
            self._route.seek(self.frame_index)
        return self._route

    @property
    def nearest_seam(self) -> int | None:
        """The first frame of the clip whose beginning is nearest to the playhead; None with a single clip."""
        if len(self.clips) < 2:
            return None
        before = self.spans.index_of(self.frame_index)
        near = [self.clips[place].start for place in (before, before + 1) if 0 < place < len(self.clips)]
        return min(near, key=lambda start: abs(start - self.frame_index))

    def play_around(self, seam_frame: int, reach: int = SEAM_REACH) -> None:
        """Play the frames on either side of a clip's first frame over and over."""
        self.seek(seam_frame - reach)
        self.is_skipping_around = False
        self.around = (self.frame_index, self.clamped(seam_frame + reach - 1))
        self._start(1)

    def toggle_around(self) -> None:
        """Play around the nearest seam; stop if that is done already."""
        if self.around is not None:
            self.around = None
            self.is_playing = False
        elif self.nearest_seam is not None:
            self.play_around(self.nearest_seam)

    # ---------------------------------------------------------------- playing

    @property
    def plays_every_frame(self) -> bool:
        """Whether playing waits for each frame now."""
        return self.is_every_frame if self.around is None else not self.is_skipping_around

    def toggle_every_frame(self) -> None:
        """Wait for each frame, or leave some out to keep the speed; around a seam for as long as that is played."""
        if self.around is None:
            self.is_every_frame = not self.is_every_frame
        else:
            self.is_skipping_around = not self.is_skipping_around

    def toggle_play(self) -> None:
        """Play forward or hold; playing from the last frame starts over."""
        if self.is_playing:
            self.hold()
        else:
            self._start(1)

    def hold(self) -> None:
        """Stop where the playhead is."""
        self.is_playing = False
        self._carried = 0.0

    def shuttle(self, direction: int) -> None:
        """Play one way; when that is done already, faster.

        Args:
            direction: 1 forward, -1 backward.
        """
        if self.is_playing and self.direction == direction:
            self.change_speed(1)
        else:
            self.speed = min(self.speed, 1.0)
            self._start(direction)

    def change_speed(self, n_steps: int) -> None:
        """Faster or slower by steps of SPEEDS, as far as they go."""
        nearest = min(range(len(SPEEDS)), key=lambda place: abs(SPEEDS[place] - self.speed))
        self.speed = SPEEDS[min(max(nearest + n_steps, 0), len(SPEEDS) - 1)]

    def _start(self, direction: int) -> None:
        self.is_playing = self.n_frames > 1
        self.is_following &= not self.is_playing
        self.direction = direction
        self._carried = 0.0
        first, last = self.play_range
        start, end = (first, last) if direction > 0 else (last, first)
        route = self.route
        if self.is_playing and route is not None:
            if route.at == (len(route) - 1 if direction > 0 else 0) and not self.is_looping:
                route.at = 0 if direction > 0 else len(route) - 1
            self.frame_index = route.frame_index
            return
        is_at_end = self.frame_index == end and not self.is_looping and self.around is None
        if self.is_playing and (is_at_end or not first <= self.frame_index <= last):
            self.frame_index = start

    def tick(self, dt_s: float, *, is_shown: bool = True) -> bool:
        """Let time pass while playing; the rest below a whole frame is carried over, so that no error adds up.

        Args:
            dt_s: Seconds since the last tick; negative or non-finite values count as none.
            is_shown: Whether the frame under the playhead is on screen. Playing every frame waits for that.
        Returns:
            Whether the playhead moved.
        """
        if not self.is_playing or not math.isfinite(dt_s) or dt_s <= 0:
            return False
        self._carried += dt_s * self.fps * self.speed
        # the small addition keeps 3 ticks of 1/30 s at 10 fps from falling one ulp short of a frame
        n_frames = math.floor(self._carried + 1e-9)
        if self.plays_every_frame:
            n_frames = min(n_frames, 1 if is_shown else 0)
            self._carried = min(self._carried, 1.0 + n_frames)  # time lost is not caught up with
        if n_frames == 0:
            return False
        self._carried -= n_frames
        before = self.frame_index
        route = self.route
        if route is None:
            self._advance(n_frames * self.direction)
        else:
            self.is_playing = not route.go(n_frames * self.direction, is_looping=self.is_looping)
            self.frame_index = route.frame_index
        return self.frame_index != before

    def _advance(self, n_frames: int) -> None:
        """Move on inside the played frames: round and round, or to its end and no farther."""
        first, last = self.play_range
        target = self.frame_index + n_frames
        if self.is_looping or self.around is not None:
            self.frame_index = first + (target - first) % (last - first + 1)
            return
        self.frame_index = min(max(target, first), last)
        self.is_playing = self.frame_index != (last if self.direction > 0 else first)

    # ---------------------------------------------------------------- clips

    def clip_of(self, frame_index: int) -> Clip | None:
        """The clip of a frame; None outside the capture."""
        if not self.clips or not 0 <= frame_index < self.n_frames:
            return None
        return self.clips[self.spans.index_of(frame_index)]

    @property
    def clip(self) -> Clip | None:
        """The clip under the playhead."""
        return self.clip_of(self.frame_index)

    def next_clip_start(self, frame_index: int) -> int:
        """First frame of the next clip; the last frame when there is none."""
        clip = self.clip_of(frame_index)
        return self.last_frame if clip is None or clip.stop >= self.n_frames else clip.stop

    def previous_clip_start(self, frame_index: int) -> int:
        """First frame of this clip, or of the one before when already there."""
        clip = self.clip_of(frame_index - 1)
        return 0 if clip is None else clip.start
