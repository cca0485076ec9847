"""Early stop: a few training pictures that are not trained on, and when what they say no longer rises.

Their mean PSNR is looked at every so many steps. Once it has stalled, the phase does not end at once, because the
learning rates would not have fallen: it goes to its end in a fifth of the steps done, over which they do
(`PhaseOptimizer.finish_within`). Held-out cameras are never looked at for this.
"""

from __future__ import annotations

import math

import numpy as np

MEASURE_EVERY = 150
"""Steps between two looks."""
MIN_RISE_DB = 0.02
FINISH_SHARE = 0.2
"""Steps of the end that is left after a stall, as a share of those done."""
_SHARE, _FEWEST = 0.02, 4


def held_in_items(n_cameras: int, n_frames: int, seed: int) -> list[int]:
    """Pictures that are kept out of training: 2 % of all, four at least, but never more than half.

    Spread evenly over cameras and frames: no camera comes twice before all have come once, likewise frames.

    Args:
        n_cameras, n_frames: Training cameras, and frames of the clip.
        seed: Chooses which.
    Returns:
        Picture numbers, camera_row * n_frames + frame_in_clip, rising.
    """
    n_pictures = n_cameras * n_frames
    wanted = min(max(_FEWEST, math.ceil(_SHARE * n_pictures)), n_pictures // 2)
    rng = np.random.default_rng((seed, n_cameras, n_frames))
    cameras, frames = rng.permutation(n_cameras), rng.permutation(n_frames)
    chosen: list[int] = []
    for turn in range(n_pictures):  # one frame further every time all cameras were used, so that no pair comes twice
        if len(chosen) == wanted:
            break
        shift = turn // math.lcm(n_cameras, n_frames)
        chosen.append(int(cameras[(turn + shift) % n_cameras]) * n_frames + int(frames[turn % n_frames]))
    return sorted(chosen)


class Patience:
    """Says when a figure has stalled: its best has not risen by MIN_RISE_DB over `patience` looks.

    Args:
        patience: Looks without a rise until then.
    """

    def __init__(self, patience: int) -> None:
        self._patience = patience
        self.best = -math.inf
        self.n_without = 0
        self.is_stalled = False

    def saw(self, psnr: float) -> bool:
        """Take one more figure, dB. Whether this is the one at which it stalled; true once."""
        if self.is_stalled:
            return False
        if psnr > self.best + MIN_RISE_DB:
            self.best, self.n_without = psnr, 0
        else:
            self.n_without += 1
        self.is_stalled = self.n_without >= self._patience
        return self.is_stalled

    def state(self) -> dict:
        """JSON-able state, to go on exactly here."""
        best = self.best if math.isfinite(self.best) else None
        return {"best": best, "n_without": self.n_without, "is_stalled": self.is_stalled}

    def restore(self, state: dict) -> None:
        """Inverse of `state`."""
        self.best = -math.inf if state["best"] is None else float(state["best"])
        self.n_without, self.is_stalled = int(state["n_without"]), bool(state["is_stalled"])


def steps_to_finish(steps_done: int, n_steps: int) -> int:
    """Steps that are left of a phase after a stall: a share of those done, at least one, never more than there were."""
    return max(min(math.ceil(FINISH_SHARE * steps_done), n_steps - steps_done), min(1, n_steps - steps_done))
