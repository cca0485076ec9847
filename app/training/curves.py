"""Curves of a clip's training, read from its metrics file when somebody looks at them, and kept at a bounded length."""

from __future__ import annotations

import math
import os
from collections import OrderedDict
from dataclasses import dataclass, field
from pathlib import Path

from app.background.latest import LatestWorker
from app.project.clips.metrics_file import read_metrics

Points = list[tuple[int, float]]
"""(step, value)."""
MAX_POINTS = 4000
"""Points of a curve; beyond that every second one goes."""
MAX_KEPT = 16
"""Clips whose curves stay in memory."""


@dataclass(frozen=True, slots=True)
class Curves:
    """Loss, and PSNR of held-out pictures in dB, over the steps of a training."""

    loss: Points = field(default_factory=list)
    psnr: Points = field(default_factory=list)


def read_curves(path: Path) -> Curves:
    """The curves in a metrics file; empty ones when it is missing. Lines that cannot be read are left out."""
    rows = read_metrics(path)
    return Curves(
        thinned([(row["step"], row["loss"]) for row in rows if is_number(row.get("loss"))]),
        thinned([(row["step"], row["held_out_psnr"]) for row in rows if is_number(row.get("held_out_psnr"))]),
    )


def append_thinned(history: Points, point: tuple[int, float]) -> None:
    """Append a point; a list that grew too long loses every second one."""
    history.append(point)
    if len(history) > MAX_POINTS:
        del history[1:-1:2]


def thinned(history: Points) -> Points:
    """At most MAX_POINTS points, first and last kept."""
    while len(history) > MAX_POINTS:
        del history[1:-1:2]
    return history


def is_number(value: object) -> bool:
    """Whether a value of a metrics row can be drawn."""
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


@dataclass(frozen=True, slots=True)
class CurvesRequest:
    """A metrics file as it is now: time and size tell whether it was read before."""

    path: Path
    changed_ns: int
    n_bytes: int


class CurveReader:
    """Reads the curves of clips that are looked at, on a thread. Methods are for one other thread and do not wait."""

    def __init__(self) -> None:
        self._kept: OrderedDict[CurvesRequest, Curves] = OrderedDict()
        self.worker: LatestWorker[CurvesRequest, Curves] = LatestWorker("curves", lambda asked: read_curves(asked.path))

    def curves(self, path: Path) -> Curves | None:
        """The curves of a file; None until they are read, empty ones when there is no such file."""
        try:
            status = os.stat(path)
        except OSError:
            return Curves()
        request = CurvesRequest(path, status.st_mtime_ns, status.st_size)
        newest = self.worker.newest
        if newest is not None and newest[0] not in self._kept:
            self._kept[newest[0]] = newest[1]
            while len(self._kept) > MAX_KEPT:
                self._kept.popitem(last=False)
        known = self._kept.get(request)
        if known is None:
            self.worker.request(request)
        return known

    def close(self) -> None:
        """End the thread, without waiting for a read."""
        self.worker.close(timeout_s=0.1)
