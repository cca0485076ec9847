"""Frames of made scenes, of which some Gaussians move."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from engine.export.splats import Splats
from tests.engine.export.scenes import chance_splats


def moving_frames(n_frames: int, *, n: int = 60, n_moving: int = 20) -> list[Splats]:
    """The last ones move a little from frame to frame."""
    splats, frames = chance_splats(n), []
    for frame in range(n_frames):
        means = splats.means.copy()
        means[n - n_moving :] += np.float32(0.01 * frame)
        frames.append(replace(splats, means=means))
    return frames


def values(splats: Splats) -> np.ndarray:
    """All columns, in an order that does not depend on that of the rows. [N, 14]"""
    columns = (splats.means, splats.quats, splats.scales, splats.opacities[:, None], splats.colors)
    rows = np.concatenate(columns, axis=1)
    return rows[np.lexsort(rows.T)]
