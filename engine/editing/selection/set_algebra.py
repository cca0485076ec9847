"""The new selection when something more is selected."""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np

SelectMode = Literal["replace", "add", "subtract", "intersect"]
SELECT_MODES: tuple[SelectMode, ...] = get_args(SelectMode)


def combined(before: np.ndarray, found: np.ndarray, mode: SelectMode) -> np.ndarray:
    """The selection after something was found. before, found: [N] bool; returns [N] bool

    Raises:
        ValueError: There is no such mode.
    """
    match mode:
        case "replace":
            return found.copy()
        case "add":
            return before | found
        case "subtract":
            return before & ~found
        case "intersect":
            return before & found
        case _:
            raise ValueError(f"modes are {', '.join(SELECT_MODES)}, not {mode!r}")
