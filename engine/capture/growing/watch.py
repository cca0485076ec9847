"""GrowthWatch: sees a capture grow. Frames count once all cameras have them; one that stays away is given up.

Times are those of this process's own clock, never those of files, so that clocks of other machines do not matter.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable

from engine.capture.capture import Capture
from engine.capture.growing.arrivals import Arrivals, arrivals_of
from engine.capture.growing.growth import CameraGrowth, Growth
from engine.errors import CaptureError

PATIENCE_S = 60.0
"""A frame that most cameras have and one lacks is waited for so long."""
END_FILE = "END"
"""A file of this name in a capture's folder says that its recording has ended."""
MAX_NEW = 64
"""Frames of a camera that one look takes up, so that it stays short where much is there already."""


class GrowthWatch:
    """For one thread. Memory does not grow with the capture.

    A camera is late once most cameras have a frame that it lacks. A late frame is given up after `patience_s`, counted
    from when the camera delivered something last, unless it has later frames already: one that is only slow is not.

    Args:
        capture: Opened as growing.
        first: Frame to begin with; those before are taken in already.
        patience_s: See PATIENCE_S.
        is_wanted: (camera row, frame) to whether the frame is needed; one that is excluded need not come.
        clock: Seconds; tests bring their own.
    """

    def __init__(
        self,
        capture: Capture,
        *,
        first: int = 0,
        patience_s: float = PATIENCE_S,
        is_wanted: Callable[[int, int], bool] = lambda camera_index, frame_index: True,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.folder, self._names, self._patience_s = capture.path, capture.rig.names, patience_s
        self._first_frame, self._is_wanted, self._clock = capture.first_frame, is_wanted, clock
        cameras = capture.layout.cameras
        self._arrivals: list[Arrivals] = [arrivals_of(camera.source, clock) for camera in cameras]
        now_s = clock()
        self._n_complete = [first] * len(cameras)
        self._progress_s = [now_s] * len(cameras)
        self._reached: deque[tuple[int, float]] = deque()  # frames that most cameras had, and since when
        self._lost: list[tuple[int, int]] = []
        self._gone_s: float | None = None
        self._last_s = now_s
        self._last: Growth | None = None

    def look(self) -> Growth:
        """How far the capture is now.

        Raises:
            CaptureError: The folder is gone for longer than the patience, or a video has been replaced.
        """
        now_s = self._clock()
        if not self.folder.is_dir():
            return self._without_folder(now_s)
        self._gone_s = None
        has_ended = (self.folder / END_FILE).exists()  # before the frames: what comes after it is none of them
        reach = [self._advance(row, now_s) for row in range(len(self._arrivals))]
        wanted = [reach[row] for row in range(len(reach)) if self._is_wanted(row, self._n_complete[row])] or reach
        reached = sorted(wanted)[(len(wanted) - 1) // 2]
        for row in range(len(reach)):
            self._skip_unwanted(row, reached)
        if not self._reached or reached > self._reached[-1][0]:
            self._reached.append((reached, now_s))
        late = [self._late_s(row, reach[row], now_s) for row in range(len(reach))]
        cameras = tuple(
            CameraGrowth(
                name,
                self._n_complete[row],
                max(reached - self._n_complete[row], 0),
                late[row],
                has_later=reach[row] > self._n_complete[row],
                fault=self._arrivals[row].fault,
            )
            for row, name in enumerate(self._names)
        )
        lowest = min(self._n_complete)
        while len(self._reached) > 1 and self._reached[0][0] <= lowest:
            self._reached.popleft()
        self._last = Growth(cameras, reached, now_s - self._last_s, has_ended)
        return self._last

    def take_lost(self, stop: int) -> list[tuple[int, int]]:
        """Frames before one that were given up: (camera row, frame), each told once."""
        taken = [one for one in self._lost if one[1] < stop]
        self._lost = [one for one in self._lost if one[1] >= stop]
        return taken

    def _advance(self, row: int, now_s: float) -> int:
        """Take up the new frames of a camera. Returns one past the last frame that it has."""
        arrivals = self._arrivals[row]
        for _ in range(MAX_NEW):
            frame = self._n_complete[row]
            if not self._is_wanted(row, frame):
                return frame
            if not arrivals.has(self._first_frame + frame, now_s):
                return arrivals.reach(self._first_frame + frame) - self._first_frame
            self._progress_s[row] = self._last_s = now_s
            self._n_complete[row] += 1
        return self._n_complete[row]

    def _skip_unwanted(self, row: int, reached: int) -> None:
        """Go past frames that need not come, as far as most cameras are."""
        while self._n_complete[row] < reached and not self._is_wanted(row, self._n_complete[row]):
            self._n_complete[row] += 1

    def _late_s(self, row: int, reach: int, now_s: float) -> float:
        """For how long a camera has lacked its next frame; gives up what has been late for too long."""
        while True:
            frame = self._n_complete[row]
            since_s = next((at_s for reached, at_s in self._reached if reached > frame), None)
            if since_s is None:
                return 0.0
            if reach <= frame:  # nothing behind it either: it may only be slow
                since_s = max(since_s, self._progress_s[row])
            if now_s - since_s < self._patience_s:
                return now_s - since_s
            self._lost.append((row, frame))
            self._n_complete[row] += 1
            self._last_s = now_s  # something has happened
            self._skip_unwanted(row, self._reached[-1][0])
            reach = self._advance(row, now_s)

    def _without_folder(self, now_s: float) -> Growth:
        self._gone_s = now_s if self._gone_s is None else self._gone_s
        if now_s - self._gone_s >= self._patience_s or self._last is None:
            raise CaptureError(
                f"The folder of the capture has been gone for {now_s - self._gone_s:.0f} s.",
                hint="Make it available again, and repeat the command.",
                path=self.folder,
            )
        last = self._last
        return Growth(last.cameras, last.n_reached, now_s - self._last_s, last.has_ended, is_gone=True)
