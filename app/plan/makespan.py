"""When clips are finished where several train at once, begun as a service does: the first that waits for no other."""

from __future__ import annotations

import heapq
from collections.abc import Mapping, Sequence


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
