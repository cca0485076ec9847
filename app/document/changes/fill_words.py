"""Words about the fill of an edit."""

from __future__ import annotations

from functools import lru_cache

from engine.editing.edit import Edit
from engine.editing.fills.fill import fits, unpacked_fill
from engine.editing.picks import n_rows


def fill_text(edit: Edit) -> str:
    """What an edit fills, in a sentence without its end; empty where it has no fill."""
    if edit.fill is None:
        return ""
    if not fits(edit):
        return "what it fills was made for another selection, and is not shown"
    n_gaussians, n_guessed = _counts(edit.fill.gaussians)
    n_traces = sum(n_rows(one.rows) for one in edit.fill.traces)
    parts = [f"fills {_count(n_gaussians)}, {round(100 * n_guessed / n_gaussians)} % guessed"] if n_gaussians else []
    parts += (
        [f"takes {_count(n_traces)} away that {'was' if n_traces == 1 else 'were'} a trace of it"] if n_traces else []
    )
    return ", and ".join(parts) or "nothing had to be filled"


def _count(n: int) -> str:
    return f"{n:,} Gaussian{'' if n == 1 else 's'}"


@lru_cache(maxsize=64)
def _counts(packed: bytes) -> tuple[int, int]:
    """Gaussians of a fill, and guessed ones."""
    found = unpacked_fill(packed)
    return len(found), int(found.is_guess.sum())
