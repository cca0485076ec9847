"""A scene over time for the formats that hold a whole sequence: still things under changing light, and moving ones."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from engine.export.player.blocks import joined
from engine.export.sequences.sequence import MovingSplats, SequenceStretch
from engine.export.splats import Splats
from tests.engine.export.scenes import chance_splats

STRETCH_FRAMES, N_STRETCHES, FPS = 12, 3, 25.0
N_FRAMES = STRETCH_FRAMES * N_STRETCHES
N_STILL, N_OTHER, N_MOVING = 400, 30, 120


class MadeSequence:
    """Three stretches. The first still rows are the same in all of them, the last ones differ in each. Half of what
    moves goes straight ahead, the other half swings and comes and goes."""

    def __init__(self) -> None:
        self._shared = chance_splats(N_STILL, seed=1)
        self._moving = chance_splats(N_MOVING, seed=2, extent=1.0)
        self._moving = replace(self._moving, opacities=np.maximum(self._moving.opacities, 0.1))
        self._shared = replace(self._shared, opacities=np.maximum(self._shared.opacities, 0.1))

    def still(self, stretch: int) -> Splats:
        """Of a stretch."""
        own = chance_splats(N_OTHER, seed=10 + stretch)
        return joined(self._shared, replace(own, opacities=np.maximum(own.opacities, 0.1)))

    def moving(self, frame: int) -> MovingSplats:
        """At a frame."""
        rows = np.arange(N_MOVING)
        is_straight = rows % 2 == 0
        means = self._moving.means + np.float32(0.01 * frame) * np.array([1.0, 0.5, -0.2], np.float32)
        swing = 0.3 * np.sin(0.9 * frame + rows)[:, None] * np.array([0.0, 1.0, 0.0])
        means = np.where(is_straight[:, None], means, self._moving.means + swing).astype(np.float32)
        is_there = is_straight | ((frame + rows) % 7 < 5)
        chosen = np.random.default_rng(frame).permutation(np.flatnonzero(is_there))
        return MovingSplats(replace(self._moving, means=means)[chosen], rows[chosen] - 50)

    def frame(self, frame: int) -> Splats:
        """All of a frame."""
        return joined(self.still(frame // STRETCH_FRAMES), self.moving(frame).splats)

    def stretches(self) -> Iterator[SequenceStretch]:
        """All of them."""
        for number in range(N_STRETCHES):
            yield SequenceStretch(number * STRETCH_FRAMES, STRETCH_FRAMES, self.still(number), self.moving)
