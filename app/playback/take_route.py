"""TakeRoute: the frames that playing a take visits, one after another."""

from __future__ import annotations

import numpy as np

from engine.timing.timing import TakeTiming, nearest_frames


class TakeRoute:
    """The output frames of a take that lie between the in and out points, and where in them playing is.

    Args:
        timing: Of the take.
        first, last: Frames of the capture between which it is played.
        frame_index: The playhead.
    """

    def __init__(self, timing: TakeTiming, first: int, last: int, frame_index: int) -> None:
        frames = nearest_frames(timing)
        self.outputs = np.flatnonzero((frames >= first) & (frames <= last))
        self._frames = frames[self.outputs]
        self.at = 0
        self.seek(frame_index)

    def __len__(self) -> int:
        return len(self._frames)

    @property
    def frame_index(self) -> int:
        """The frame of the capture where playing is."""
        return int(self._frames[self.at])

    @property
    def output(self) -> int:
        """The frame of the take where playing is."""
        return int(self.outputs[self.at])

    def seek(self, frame_index: int) -> None:
        """Go to where the take shows a frame, or the one nearest to it: of several places to the nearest."""
        if len(self._frames):
            away = np.abs(self._frames - frame_index)
            found = np.flatnonzero(away == away.min())
            self.at = int(found[np.argmin(np.abs(found - self.at))])

    def go(self, n_frames: int, *, is_looping: bool) -> bool:
        """Go on by frames of the take, round and round or to its end. Whether it has come to an end."""
        target = self.at + n_frames
        if is_looping:
            self.at = target % len(self)
            return False
        self.at = min(max(target, 0), len(self) - 1)
        return self.at == (len(self) - 1 if n_frames > 0 else 0)
