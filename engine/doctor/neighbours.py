"""Which cameras stand next to which: pairs that probably see the same surfaces, and angles between them."""

from __future__ import annotations

import numpy as np

from engine.camera.rig import CameraRig

N_PARTNERS = 6
"""So many nearest cameras of each are compared with it."""
WIDEST_DEG = 75.0
"""Surfaces look different from farther apart; features do not match then."""


def apart_deg(rig: CameraRig) -> np.ndarray:
    """Angle between the places of every two cameras as seen from what the rig looks at. [C, C]"""
    rays = rig.centers - rig.focus_point()
    rays = rays / np.maximum(np.linalg.norm(rays, axis=1, keepdims=True), 1e-12)
    return np.degrees(np.arccos(np.clip(rays @ rays.T, -1.0, 1.0)))


def angles_deg(rig: CameraRig) -> np.ndarray:
    """Angle between every two cameras as seen from what the rig looks at; 180 where they look apart. [C, C]"""
    apart = apart_deg(rig)
    turned = np.degrees(np.arccos(np.clip(rig.forwards @ rig.forwards.T, -1.0, 1.0)))
    return np.where(turned > 90.0, 180.0, apart)


def neighbour_pairs(rig: CameraRig, n_partners: int = N_PARTNERS) -> list[tuple[int, int]]:
    """Pairs of a camera and each of its nearest ones, in order, each once; every camera has at least one."""
    angles = angles_deg(rig)
    np.fill_diagonal(angles, np.inf)
    pairs: set[tuple[int, int]] = set()
    for camera in range(len(rig)):
        nearest = np.argsort(angles[camera], kind="stable")[:n_partners]
        chosen = [int(other) for other in nearest if angles[camera, other] <= WIDEST_DEG] or [int(nearest[0])]
        pairs |= {(min(camera, other), max(camera, other)) for other in chosen if other != camera}
    return sorted(pairs)
