"""What moves in a clip, as bytes: every row once in full where it appears, and from then on how it changes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from engine.export.player.row_coding import Rounding, encoded_steps, in_steps, rounded
from engine.export.splats import Splats


@dataclass(frozen=True, slots=True)
class NamedRows:
    """The rows of a frame, and which of them are the same Gaussians in other frames of the clip.

    Attributes:
        splats: The rows. [N rows]
        names: Numbers, each at most once in a frame; None where nothing is known. [N] int64
    """

    splats: Splats
    names: np.ndarray | None = None

    def __getitem__(self, rows: np.ndarray) -> NamedRows:
        """The chosen rows, in the given order."""
        return NamedRows(self.splats[rows], None if self.names is None else self.names[rows])


def places_of(frames: Sequence[NamedRows]) -> list[np.ndarray]:
    """For the rows of each frame which Gaussians of the clip they are, in order of appearance. [n] int64 each"""
    known: dict[int, int] = {}
    n_nameless, places = 0, []
    for frame in frames:
        if frame.names is None:
            first = len(known) + n_nameless
            n_nameless += len(frame.splats)
            places.append(np.arange(first, first + len(frame.splats)))
            continue
        places.append(
            np.array([known.setdefault(name, len(known) + n_nameless) for name in frame.names.tolist()], np.int64)
        )
    return places


def encoded_moving(
    frames: Sequence[Splats], places: Sequence[np.ndarray], rounding: Rounding, held_steps: float
) -> tuple[bytes, int]:
    """Bytes of the frames, and how many rows appear in them at all.

    Args:
        frames: The rows of each frame.
        places: Which rows they are, in order of appearance; gaps do not matter. [n] int64 each
        rounding: All rows fit into it.
        held_steps: See `RowPrecision`.
    """
    everywhere = np.unique(np.concatenate([np.zeros(0, np.int64), *places]))
    n = len(everywhere)
    values, is_known = np.zeros((n, 14), np.int64), np.zeros(n, bool)
    presence, first, changes = [], np.zeros((n, 14), np.int64), [np.zeros((0, 14), np.int64)]
    for splats, at in zip(frames, places, strict=True):
        order = np.argsort(at, kind="stable")
        rows, steps = np.searchsorted(everywhere, at[order]), in_steps(splats[order], rounding)
        is_old = is_known[rows]
        now = np.where(is_old[:, None], rounded(steps, values[rows], held_steps), rounded(steps))
        changes.append((now - values[rows])[is_old])
        first[rows[~is_old]] = now[~is_old]
        values[rows], is_known[rows] = now, True
        is_here = np.zeros(n, bool)
        is_here[rows] = True
        presence.append(np.packbits(is_here, bitorder="little").tobytes())
    pieces = [*presence, encoded_steps(np.diff(first, axis=0, prepend=0)), encoded_steps(np.concatenate(changes))]
    return b"".join(pieces), n
