"""When clips are finished where several train at once, begun as a service does: the first that waits for no other."""

from __future__ import annotations

import heapq
import time
from collections.abc import Callable, Hashable, Mapping, Sequence

ANEW_EVERY_S = 1.0
WORK_SHARE = 0.01
"""Share of the time in which the time left is worked out: clips may be thousands, and it is shown all the time."""


def ends_of(seconds: Mapping[int, float], needs: Mapping[int, Sequence[int]], n_workers: int) -> dict[int, float]:
    """When each clip is finished.

    Args:
        seconds: How long each takes, by clip, in the order of training.
        needs: Clips that have to be finished before one begins; those that are not among them are.
        n_workers: How many train at once, at least one.
    Returns:
        Seconds from the beginning, by clip.
    """
    order = list(seconds)
    rank = {clip: place for place, clip in enumerate(order)}
    n_open = {clip: sum(other in seconds for other in needs.get(clip, ())) for clip in order}
    behind: dict[int, list[int]] = {}
    for clip in order:
        for other in needs.get(clip, ()):
            behind.setdefault(other, []).append(clip)
    ready = [rank[clip] for clip in order if not n_open[clip]]
    running: list[tuple[float, int]] = []
    ends: dict[int, float] = {}
    now_s = 0.0
    while ready or running:
        while ready and len(running) < n_workers:
            clip = order[heapq.heappop(ready)]
            heapq.heappush(running, (now_s + seconds[clip], clip))
        now_s = running[0][0]
        while running and running[0][0] == now_s:  # all that end now, since what follows may be earlier in the order
            clip = heapq.heappop(running)[1]
            ends[clip] = now_s
            for other in behind.get(clip, ()):
                n_open[other] -= 1
                if not n_open[other]:
                    heapq.heappush(ready, rank[other])
    return ends


def time_left(
    going: Mapping[int, float | None],
    waiting: Mapping[int, float | None],
    needs: Mapping[int, Sequence[int]],
    n_workers: int,
) -> float | None:
    """Seconds until the last of some clips is finished; None where nobody can know.

    Args:
        going: What is left of each clip that trains; None where that is not known.
        waiting: How long each of the others takes, next to those that train at the same time, in the order of training.
        needs, n_workers: See `ends_of`.
    """
    seconds = {**going, **waiting}
    known = {clip: left for clip, left in seconds.items() if left is not None}
    return max(ends_of(known, needs, n_workers).values(), default=0.0) if len(known) == len(seconds) else None


class Seldom:
    """A figure that is asked for all the time and takes a while to work out: anew where clips began or ended, else now
    and then. clock: Seconds; tests bring their own."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock, self._basis, self._next_s = clock, object(), 0.0
        self._value: float | None = None

    def value(self, basis: Hashable, work_out: Callable[[], float | None]) -> float | None:
        """The figure. basis: Another one, and it is worked out at once."""
        began_s = self._clock()
        if basis != self._basis or began_s >= self._next_s:
            self._value, self._basis = work_out(), basis
            ended_s = self._clock()
            self._next_s = ended_s + max(ANEW_EVERY_S, (ended_s - began_s) / WORK_SHARE)
        return self._value
