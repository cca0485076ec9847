"""Times of a window, worked out of what it wrote while it was driven: see tests.ui.observed_app."""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

LOOK_BACK_S = 0.002
LONGEST_GAP_S = 0.5
"""Images farther apart than this do not belong to one move."""

Sent = list[tuple[str, float]]
"""Kind of an input, and CLOCK_MONOTONIC seconds just before it was sent."""
Log = Sequence[dict[str, Any]]


def percentile(times: Sequence[float], share: float) -> float:
    """Of times in any order; 0.95 for the 95th percentile."""
    ordered = sorted(times)
    return ordered[min(int(share * len(ordered)), len(ordered) - 1)]


def _seen_s(sent: Sent, log: Log) -> list[float | None]:
    """When the program saw each input; None where another one came before it did."""
    events = [line["at_s"] for line in log if "event" in line]
    found = []
    for i, (_, sent_s) in enumerate(sent):
        end_s = sent[i + 1][1] if i + 1 < len(sent) else float("inf")
        found.append(next((at_s for at_s in events if sent_s - LOOK_BACK_S <= at_s < end_s), None))
    return found


def _frames(log: Log) -> list[dict[str, Any]]:
    return [line for line in log if "frame_s" in line]


def answer_times_ms(sent: Sent, log: Log) -> dict[str, list[float]]:
    """Per kind of input, milliseconds from sending to the end of the first frame begun after the program saw it."""
    frames = _frames(log)
    answers: dict[str, list[float]] = {}
    for (kind, sent_s), seen_s in zip(sent, _seen_s(sent, log), strict=True):
        finished = next((f["at_s"] for f in frames if seen_s is not None and f["frame_s"] >= seen_s), None)
        if finished is not None:
            answers.setdefault(kind, []).append((finished - sent_s) * 1e3)
    return answers


def image_times_ms(sent: Sent, log: Log) -> dict[str, list[float]]:
    """Per kind of input, milliseconds from sending until an image is on screen that is of the frame and the view after
    it, or of a later one."""
    frames = _frames(log)
    places: dict[tuple[int, int], int] = {}  # the order in which frames and views were wanted
    wanted, shown = [], []
    for line in frames:
        now = (line["playhead"], line["view"])
        wanted.append(places.setdefault(now, len(places)) if now not in places else places[now])
        shown.append(places.get((line["frame"], line["look"]), -1) if line["kind"] == "Rendered" else -1)
    times: dict[str, list[float]] = {}
    for (kind, sent_s), seen_s in zip(sent, _seen_s(sent, log), strict=True):
        first = next((i for i, line in enumerate(frames) if seen_s is not None and line["frame_s"] >= seen_s), None)
        if first is None:
            continue
        done = next((i for i in range(first, len(frames)) if shown[i] >= wanted[first]), None)
        if done is not None:
            times.setdefault(kind, []).append((frames[done]["at_s"] - sent_s) * 1e3)
    return times


def image_gaps_ms(log: Log, since_s: float, until_s: float) -> list[float]:
    """Milliseconds from image to image while the view moves."""
    changes = []
    before = None
    for line in _frames(log):
        shown = (line["frame"], line["look"])
        if line["kind"] == "Rendered" and shown != before and since_s <= line["at_s"] <= until_s:
            changes.append(line["at_s"])
        before = shown
    return [1e3 * (b - a) for a, b in pairwise(changes) if b - a < LONGEST_GAP_S]


def frames_per_s(log: Log, since_s: float, until_s: float) -> float:
    """Rendered frames that followed each other on screen, per second."""
    shown = [
        line["frame"] for line in _frames(log) if since_s <= line["at_s"] <= until_s and line["kind"] == "Rendered"
    ]
    return sum(a != b for a, b in pairwise(shown)) / (until_s - since_s)


def row(title: str, times: Sequence[float], *, target: str = "") -> str:
    """One line of a table: how many, median, 95th percentile, largest."""
    if not times:
        return f"{title:52}{0:6}"
    figures = (statistics.median(times), percentile(times, 0.95), max(times))
    return f"{title:52}{len(times):6}" + "".join(f"{figure:10.1f}" for figure in figures) + f"   {target}"


HEADING = f"{'ms':52}{'n':>6}{'median':>10}{'p95':>10}{'max':>10}   target"
