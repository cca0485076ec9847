"""Which cameras to keep out of training where a capture does not say: those that others surround."""

from __future__ import annotations

import numpy as np

from engine.camera.rig import CameraRig

LEAST_CAMERAS = 6
"""Rigs of fewer cameras need all of them for training."""
CAMERAS_PER_HELD_OUT = 12
N_NEIGHBOURS = 4


def suggested_holdout(rig: CameraRig) -> tuple[str, ...]:
    """Names of cameras to measure with, in the order of the rig: one, and one more for every further dozen.

    Each is one whose neighbours are near and look the same way, so that what it sees is seen without it, too; and they
    lie apart from each other. None in a rig of few cameras.
    """
    n_cameras = len(rig)
    if n_cameras < LEAST_CAMERAS:
        return ()
    distances = np.linalg.norm(rig.centers[:, None] - rig.centers[None], axis=-1)  # [C, C]
    angles = np.arccos(np.clip(rig.forwards @ rig.forwards.T, -1.0, 1.0))  # [C, C]
    scale = np.median(distances[~np.eye(n_cameras, dtype=bool)]) or 1.0
    apart = distances / scale + angles
    np.fill_diagonal(apart, np.inf)
    lonely = np.sort(apart, axis=1)[:, :N_NEIGHBOURS].mean(axis=1)  # [C], small where neighbours are near
    balance = _balance(rig, np.argsort(apart, axis=1)[:, :N_NEIGHBOURS])
    chosen: list[int] = []
    for _ in range(1 + (n_cameras - 1) // CAMERAS_PER_HELD_OUT):
        cost = lonely + balance
        if chosen:  # far from those that were chosen already: their neighbourhoods must not be emptied
            cost = cost - np.minimum(apart[:, chosen].min(axis=1), 1.0)
            cost[chosen] = np.inf
        chosen.append(int(np.argmin(np.round(cost, 6))))
    return tuple(rig.names[row] for row in sorted(chosen))


def _balance(rig: CameraRig, neighbours: np.ndarray) -> np.ndarray:
    """How far each camera lies off the middle of its neighbours, in spacings: small in the midst of others. [C]"""
    centers = rig.centers
    middles = centers[neighbours].mean(axis=1)
    spacing = np.linalg.norm(centers[neighbours] - centers[:, None], axis=-1).mean(axis=1)
    return np.linalg.norm(middles - centers, axis=1) / np.maximum(spacing, 1e-12)
