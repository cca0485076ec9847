"""Things of points that move, as a clip would show them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from engine.editing.gaussian_rows import GaussianRows, RowSet
from engine.objects.moving_parts import MovingParts, frames_of


@dataclass(frozen=True)
class Thing:
    """A ball of points.

    Attributes:
        way: Its centre at a frame; None where it is not there.
        color: Of its points.
        lasts: Frames that each point lasts; 0 for all of the clip.
    """

    way: Callable[[int], Sequence[float] | None]
    color: tuple[float, float, float] = (0.5, 0.5, 0.5)
    n: int = 120
    radius: float = 0.2
    lasts: int = 0


def made_parts(
    things: Sequence[Thing], start: int, n_frames: int = 10, seed: int = 0
) -> tuple[MovingParts, np.ndarray]:
    """Parts of a clip, other points in each clip, and the number of the thing that each is of. [N]"""
    random = np.random.default_rng((seed, start))
    frames = frames_of(start, n_frames)
    means, opacities, colors, of = [], [], [], []
    for number, thing in enumerate(things):
        n = thing.n * (1 if not thing.lasts else -(-n_frames // thing.lasts))
        offsets = random.normal(size=(n, 3))
        offsets *= thing.radius * random.uniform(0, 1, (n, 1)) ** (1 / 3) / np.linalg.norm(offsets, axis=1)[:, None]
        born = np.arange(n) % max(n // thing.n, 1) * thing.lasts
        where, there = np.zeros((len(frames), n, 3)), np.zeros((len(frames), n))
        for place, frame in enumerate(frames):
            center = thing.way(frame)
            if center is not None:
                where[place] = np.asarray(center) + offsets
                age = frame - start - born
                there[place] = ((age >= 0) & (age < thing.lasts)) if thing.lasts else 1.0
        means.append(where)
        opacities.append(0.8 * there)
        colors.append(np.clip(np.asarray(thing.color) + random.normal(0, 0.03, (n, 3)), 0, 1))
        of.append(np.full(n, number))
    n = sum(map(len, of))
    index = np.arange(n)
    rows = GaussianRows((RowSet("origin", 0, "residual"),), np.zeros(n, np.uint8), index.astype(np.int32))
    parts = MovingParts(
        start,
        start + n_frames,
        frames,
        index,
        index,
        np.concatenate(means, 1).astype(np.float32),
        np.concatenate(opacities, 1).astype(np.float32),
        np.concatenate(colors).astype(np.float32),
        np.full(n, 0.02, np.float32),
        rows,
    )
    return parts, np.concatenate(of)
