"""MendPage: a mending as the window shows it. Values only."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from app.mending.request import MendRequest
from app.project.mends.record import MendRecord


@dataclass(frozen=True, slots=True)
class MendPage:
    """Contents of the panel.

    Attributes:
        request: The boundary or frames to mend.
        words: The same, as "the seam at frame 20".
        frame: Where to look: the boundary, or the first of the frames.
        state: "asking" before it begins, "running", "done", "reverted".
        clip_indices: Clips that may change.
        why_not: Why it cannot be mended; empty where it can.
        estimate_s: Expected time; None where unknown.
        record: The result; None before.
        number: Of the record in the project; None where nothing changed.
        compared: Clip that is compared with its earlier version; None for none.
        failure, hint: Why it failed.
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
