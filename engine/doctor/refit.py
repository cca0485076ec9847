"""The change of one camera's calibration that would make it fit its neighbours, and its certainty.

Only the matches of that camera are looked at, and its neighbours stay as they are. The cost is robust, so that one
neighbour that is wrong itself, or some wrong matches, do not pull a good camera along.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.optimize import least_squares

from engine.camera.rig import CameraRig
from engine.doctor.epipolar import fundamental_matrices, sampson_px
from engine.features.matching import PairMatches

Model = Literal["focal", "rotation", "rotation and focal", "pose", "pose and focal"]
COLUMNS: dict[Model, tuple[int, ...]] = {
    "focal": (6,),
    "rotation": (0, 1, 2),
    "rotation and focal": (0, 1, 2, 6),
    "pose": (0, 1, 2, 3, 4, 5),
    "pose and focal": (0, 1, 2, 3, 4, 5, 6),
}
"""Numbers that a model changes: turn (3, radians), place (3, shares of the rig's extent), ln(focal). Simple first."""
SOFT_PX = 1.0
"""Errors beyond this weigh less and less (Cauchy)."""
ENOUGH = 0.9
"""The simplest model that takes away this share of what the best one does is the one that is named."""
NOISE_PX = 0.35
"""Key points of a good calibration miss by about this."""


@dataclass(frozen=True, slots=True)
class CameraMatches:
    """The matches of one camera with its partners. pixels [M, 2] in it, other_pixels [M, 2], partners [M] rows."""

    camera: int
    pixels: np.ndarray
    other_pixels: np.ndarray
    partners: np.ndarray

    def __len__(self) -> int:
        return len(self.partners)


@dataclass(frozen=True, slots=True)
class Refit:
    """A change of one camera.

    Attributes:
        camera: Row of the rig.
        model: The simplest change that does what can be done.
        change: Turn (3, radians), place (3, shares of the rig's extent), ln(focal length). [7]
        sigmas: Standard deviations of them; 0 of what stays. [7]
        cost, cost_left: Robust cost with the calibration as it is, and after the change.
        before_px, after_px: Median error likewise.
        n_matches, n_partners: Matches and partners it rests on.
    """

    camera: int
    model: Model
    change: np.ndarray
    sigmas: np.ndarray
    cost: float
    cost_left: float
    before_px: float
    after_px: float
    n_matches: int
    n_partners: int

    @property
    def turn_deg(self) -> float:
        """By how much it turns."""
        return float(np.degrees(np.linalg.norm(self.change[:3])))

    @property
    def turn_sigma_deg(self) -> float:
        """Standard deviation of that."""
        return float(np.degrees(np.linalg.norm(self.sigmas[:3])))

    @property
    def focal_share(self) -> float:
        """By how much of itself the focal length changes."""
        return float(np.expm1(self.change[6]))

    @property
    def shift_share(self) -> float:
        """How far it moves, as a share of the rig's extent."""
        return float(np.linalg.norm(self.change[3:6]))


def matches_of(camera: int, pairs: Sequence[PairMatches], left_out: Collection[int] = ()) -> CameraMatches:
    """The matches of one camera with partners that are not left out."""
    here, there, partners = [np.zeros((0, 2))], [np.zeros((0, 2))], [np.zeros(0, dtype=np.int64)]
    for pair in pairs:
        if camera not in (pair.first, pair.second):
            continue
        is_first = pair.first == camera
        partner = pair.second if is_first else pair.first
        if partner in left_out:
            continue
        here.append(pair.pixels if is_first else pair.other_pixels)
        there.append(pair.other_pixels if is_first else pair.pixels)
        partners.append(np.full(len(pair), partner))
    return CameraMatches(camera, np.concatenate(here), np.concatenate(there), np.concatenate(partners))


def median_px(rig: CameraRig, matches: CameraMatches) -> float:
    """By how much the matches of a camera usually miss, px; NaN without any."""
    return float(np.median(np.abs(_errors(rig, matches, np.zeros(7), 1.0)))) if len(matches) else float("nan")


def _errors(rig: CameraRig, matches: CameraMatches, change: np.ndarray, extent: float) -> np.ndarray:
    """Signed errors after a change. [M]"""
    rows, of_match = np.unique(matches.partners, return_inverse=True)
    K, pose = changed(rig, matches.camera, change, extent)
    F = fundamental_matrices(K, pose, rig.Ks[rows], rig.world_to_camera[rows])
    return sampson_px(F[of_match], matches.pixels, matches.other_pixels)


def refit(rig: CameraRig, matches: CameraMatches, extent: float) -> Refit:
    """Find the change of a camera that fits its matches best.

    Args:
        rig: At the size of the matched pictures.
        extent: Largest distance between two cameras.
    """

    def errors(change: np.ndarray) -> np.ndarray:
        return _errors(rig, matches, change, extent)

    before = errors(np.zeros(7))
    cost = _cost(before)
    tried: list[tuple[float, Model, np.ndarray, np.ndarray, np.ndarray]] = []
    for model, columns in COLUMNS.items():
        if len(matches) < 3 * len(columns):
            continue

        def of_columns(values: np.ndarray, columns: tuple[int, ...] = columns) -> np.ndarray:
            change = np.zeros(7)
            change[list(columns)] = values
            return errors(change)

        found = least_squares(
            of_columns, np.zeros(len(columns)), loss="cauchy", f_scale=SOFT_PX, x_scale=0.01, max_nfev=60
        )
        change, sigmas = np.zeros(7), np.zeros(7)
        change[list(columns)] = found.x
        sigmas[list(columns)] = _sigmas(found.jac, found.fun)
        tried.append((_cost(found.fun), model, change, sigmas, found.fun))
    if not tried:
        tried.append((cost, "focal", np.zeros(7), np.zeros(7), before))
    enough = cost - ENOUGH * (cost - min(cost_left for cost_left, *_ in tried))
    cost_left, model, change, sigmas, after = next(one for one in tried if one[0] <= enough + 1e-9)
    return Refit(
        camera=matches.camera,
        model=model,
        change=change,
        sigmas=sigmas,
        cost=cost,
        cost_left=cost_left,
        before_px=float(np.median(np.abs(before))) if len(matches) else float("nan"),
        after_px=float(np.median(np.abs(after))) if len(matches) else float("nan"),
        n_matches=len(matches),
        n_partners=len(np.unique(matches.partners)),
    )


def changed(rig: CameraRig, camera: int, change: np.ndarray, extent: float) -> tuple[np.ndarray, np.ndarray]:
    """K [3, 3] and world_to_camera [4, 4] of a camera after a change [7]: turned about its own axes, then moved."""
    K = rig.Ks[camera].copy()
    K[:2, :2] *= np.exp(change[6])
    pose = rig.world_to_camera[camera].copy()
    turn = rotation_of(change[:3])
    center = -pose[:3, :3].T @ pose[:3, 3] + change[3:6] * extent
    pose[:3, :3] = turn @ pose[:3, :3]
    pose[:3, 3] = -pose[:3, :3] @ center
    return K, pose


def rotation_of(vector: np.ndarray) -> np.ndarray:
    """Rotation by a vector's length in radians about its direction. [3] to [3, 3]"""
    angle = float(np.linalg.norm(vector))
    if angle < 1e-12:
        return np.eye(3)
    x, y, z = vector / angle
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def _cost(errors: np.ndarray) -> float:
    return float((SOFT_PX**2 * np.log1p((errors / SOFT_PX) ** 2)).sum())


def _sigmas(jacobian: np.ndarray, errors: np.ndarray) -> np.ndarray:
    """Standard deviations of fitted numbers, from errors that count as noise. [parameters]"""
    noise = max(1.4826 * float(np.median(np.abs(errors))), NOISE_PX / 2)
    try:
        return noise * np.sqrt(np.diag(np.linalg.inv(jacobian.T @ jacobian)))
    except np.linalg.LinAlgError:
        return np.full(jacobian.shape[1], np.inf)
