"""Offsets by where things move: profiles of motion over the planes of each pair of cameras, compared over time."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from scipy import ndimage

from engine.camera.rig import CameraRig
from engine.synchronisation.correlating import PairCurve, correlate, overlaps
from engine.synchronisation.epipolar_profiles import plane_bins, profile
from engine.synchronisation.motion_pictures import MotionPictures

BLUR_BINS = 1.0
POWER = 0.25
"""Profiles are compared as this power of the motion in a plane: that something moves there says more than how much."""
MAX_PAIRS_PER_CAMERA = 12
"""Pairs of cameras that look the same way see the same side of what moves and say most; some far ones close loops."""
FAR_SHARE = 0.25


def chosen_pairs(rig: CameraRig) -> list[tuple[int, int]]:
    """Pairs to compare: for each camera those that look most alike, and some spread over the others."""
    n_cameras = len(rig)
    cosines = rig.forwards @ rig.forwards.T
    pairs = set()
    for camera in range(n_cameras):
        order = [int(other) for other in np.argsort(-cosines[camera]) if other != camera]
        n_near = round(MAX_PAIRS_PER_CAMERA * (1 - FAR_SHARE))
        far = order[n_near:]
        step = max(len(far) // max(MAX_PAIRS_PER_CAMERA - n_near, 1), 1)
        for other in order[:n_near] + far[::step]:
            pairs.add((min(camera, other), max(camera, other)))
    return sorted(pairs)


def epipolar_curves(
    motions: Sequence[MotionPictures],
    starts_frames: Sequence[float],
    rig: CameraRig,
    max_lag: int,
    *,
    after_pair: Callable[[int, int], None] = lambda done, n: None,
) -> list[PairCurve]:
    """The agreement of pairs for every offset between them.

    Args:
        motions: The motion in each camera, evenly in time.
        starts_frames: Frame of the camera at which its motion begins.
        rig: Cameras at any size of the same shape as the pictures.
        max_lag: Shift up to which signals are compared.
        after_pair: Called with pairs done and all pairs.
    """
    rig = rig.resized(np.array([motion.size for motion in motions]))
    curves = []
    pairs = chosen_pairs(rig)
    for done, (first, second) in enumerate(pairs):
        bins = plane_bins(rig, first, second)
        if bins is not None:
            total, lags, lengths = None, np.zeros(0), (0, 0)
            for channel in ("changes", "presence"):
                one = _signal(profile(getattr(motions[first], channel), bins[0], bins[2]))
                other = _signal(profile(getattr(motions[second], channel), bins[1], bins[2]))
                lags, scores = correlate(one, other, max_lag)
                lengths = (len(one), len(other))
                total = scores if total is None else total + scores
            if total is not None and len(lags):
                offsets = lags + starts_frames[second] - starts_frames[first]
                curves.append(PairCurve(first, second, offsets, total / 2, overlaps(*lengths, lags)))
        after_pair(done + 1, len(pairs))
    return curves


def _signal(moving: np.ndarray) -> np.ndarray:
    """A profile as it is compared. [T, B]"""
    return ndimage.gaussian_filter1d(moving, BLUR_BINS, axis=1).clip(0) ** POWER
