"""MendPage: what the window shows of a seam that is mended. Values only."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from app.mending.request import MendRequest
from app.project.mends.record import MendRecord


@dataclass(frozen=True, slots=True)
class MendPage:
    """What the panel shows.

    Attributes:
        request: What is to be mended.
        words: The same, as "the seam at frame 20".
        frame: Where to look: the boundary, or the first of the frames.
        state: "asking" before it begins, "running", "done", "reverted".
        clip_indices: Clips that may change.
        why_not: Why it cannot be mended; empty where it can.
        estimate_s: What it is expected to take; None where that is not known.
        record: What came of it; None before.
        number: Of the record in the project; None where nothing changed.
        compared: Clip whose earlier version stands beside it; None for none.
        failure, hint: Why it came to nothing.
    """

    request: MendRequest
    words: str
    frame: int
    clip_indices: tuple[int, ...] = ()
    state: Literal["asking", "running", "done", "reverted"] = "asking"
    why_not: str = ""
    estimate_s: float | None = None
    record: MendRecord | None = None
    number: int | None = None
    compared: int | None = None
    failure: str = ""
    hint: str = ""
