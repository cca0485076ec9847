"""The selection as a window shows it: a value that the window knows without loading the code that finds things."""

from __future__ import annotations

from dataclasses import dataclass

from engine.editing.gaussian_rows import RowSet


@dataclass(frozen=True, slots=True)
class SelectionStatus:
    """Size and state of the selection.

    Attributes:
        words: "1,240 Gaussians, 96 anchors, 3 clips"; empty where nothing is selected.
        n_gaussians, n_shown: Selected ones, and those of them that exist in the shown frame.
        is_busy: Whether something is being looked for.
        has_before: Whether there is a selection to go back to.
        can_select: Whether there are Gaussians to select.
        revision: Differs whenever the selection does.
        counts: Anchor sets, and how many Gaussians of each are selected.
    """

    words: str = ""
    n_gaussians: int = 0
    n_shown: int = 0
    is_busy: bool = False
    has_before: bool = False
    can_select: bool = False
    revision: int = 0
    counts: tuple[tuple[RowSet, int], ...] = ()
