"""Cameras while they are being found: rotations, translations, focal lengths, centres and lens numbers as arrays."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

N_LENS = {"pinhole": 0, "simple": 1, "opencv": 4, "fisheye": 4}
"""Numbers of each lens model that are sought: none; k1; k1 k2 p1 p2; k1 to k4 of OpenCV's fisheye lens."""
MAX_FISHEYE_ITERATIONS = 20


@dataclass(frozen=True, slots=True)
class Cameras:
    """Estimates of C cameras; pixels are those of the pictures that are matched, their centres at +0.5.

    Attributes:
        lens: One of N_LENS.
        rotations: World to camera. [C, 3, 3]
        translations: [C, 3]
        focals: Focal lengths along x, px. [C]
        aspects: Focal length along y divided by that along x; 1 for nearly all sensors. [C]
        principal: Principal points, px. [C, 2]
        lens_params: [C, N_LENS[lens]]
    """

    lens: str
    rotations: np.ndarray
    translations: np.ndarray
    focals: np.ndarray
    aspects: np.ndarray
    principal: np.ndarray
    lens_params: np.ndarray

    def __len__(self) -> int:
        return len(self.focals)

    @property
    def centers(self) -> np.ndarray:
        """Where they stand. [C, 3]"""
        return -np.einsum("cji,cj->ci", self.rotations, self.translations)

    @property
    def focals_xy(self) -> np.ndarray:
        """Focal lengths along x and y, px. [C, 2]"""
        return np.stack([self.focals, self.focals * self.aspects], axis=-1)

    def moved(self, scale: float, rotation: np.ndarray, shift: np.ndarray) -> Self:
        """The same cameras in another world: points there are scale * rotation @ point + shift."""
        rotations = self.rotations @ rotation.T
        return replace(self, rotations=rotations, translations=scale * self.translations - rotations @ shift)

    def pixels(self, rows: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Pixels [N, 2] and depths [N] of world points [N, 3], each in the camera of its row [N]."""
        inside = np.einsum("nij,nj->ni", self.rotations[rows], points) + self.translations[rows]
        plane = inside[:, :2] / safe_depth(inside[:, 2:])
        seen = distort(self.lens, plane, self.lens_params[rows])
        return seen * self.focals_xy[rows] + self.principal[rows], inside[:, 2]

    def plane(self, row: int, pixels: np.ndarray) -> np.ndarray:
        """Pixels [K, 2] of one camera on its plane at depth 1, without distortion. [K, 2]"""
        seen = (pixels - self.principal[row]) / self.focals_xy[row]
        return undistort(self.lens, seen, np.broadcast_to(self.lens_params[row], (len(seen), N_LENS[self.lens])))


def with_lens(cameras: Cameras, lens: str) -> Cameras:
    """The same cameras with the numbers of another lens model, those that both have taken over."""
    if cameras.lens == lens:
        return cameras
    params = np.zeros((len(cameras), N_LENS[lens]))
    n_both = min(params.shape[1], cameras.lens_params.shape[1])
    params[:, :n_both] = cameras.lens_params[:, :n_both]
    return replace(cameras, lens=lens, lens_params=params)


def safe_depth(depths: np.ndarray) -> np.ndarray:
    """Depths kept away from 0, with their sign."""
    return np.where(np.abs(depths) > 1e-9, depths, 1e-9)


def distort(lens: str, plane: np.ndarray, params: np.ndarray) -> np.ndarray:
    """Where a lens shows points of the plane at depth 1. plane [N, 2], params [N, N_LENS[lens]]; result [N, 2]"""
    if lens == "pinhole":
        return plane
    squares = (plane**2).sum(-1)
    if lens == "fisheye":
        radius = np.sqrt(squares)
        angle = np.arctan(radius)
        powers = angle[:, None] ** np.array([2.0, 4.0, 6.0, 8.0])
        bent = angle * (1 + (powers * params).sum(-1))
        return plane * np.where(radius > 1e-9, bent / np.maximum(radius, 1e-9), 1.0)[:, None]
    if lens == "simple":
        return plane * (1 + params[:, 0] * squares)[:, None]
    x, y = plane[:, 0], plane[:, 1]
    k1, k2, p1, p2 = params.T
    radial = 1 + k1 * squares + k2 * squares**2
    return np.stack(
        [
            x * radial + 2 * p1 * x * y + p2 * (squares + 2 * x * x),
            y * radial + p1 * (squares + 2 * y * y) + 2 * p2 * x * y,
        ],
        axis=-1,
    )


def undistort(lens: str, seen: np.ndarray, params: np.ndarray) -> np.ndarray:
    """The inverse of `distort`, by Newton steps. [N, 2]"""
    if lens == "pinhole":
        return seen
    plane = seen.copy()
    if lens == "fisheye":  # starts from the lens without numbers, which spreads wide angles far apart
        radius = np.linalg.norm(seen, axis=-1, keepdims=True)
        plane = seen * np.tan(np.minimum(radius, 1.5)) / np.maximum(radius, 1e-9)
    for _ in range(MAX_FISHEYE_ITERATIONS):
        off = distort(lens, plane, params) - seen
        jacobian = plane_jacobian(lens, plane, params)
        determinant = jacobian[:, 0, 0] * jacobian[:, 1, 1] - jacobian[:, 0, 1] * jacobian[:, 1, 0]
        determinant = np.where(np.abs(determinant) > 0.05, determinant, 0.05)  # beyond the turn of a strong lens
        step_x = (jacobian[:, 1, 1] * off[:, 0] - jacobian[:, 0, 1] * off[:, 1]) / determinant
        step_y = (jacobian[:, 0, 0] * off[:, 1] - jacobian[:, 1, 0] * off[:, 0]) / determinant
        plane = plane - np.clip(np.stack([step_x, step_y], axis=-1), -0.5, 0.5)
        if np.abs(off).max(initial=0.0) < 1e-10:
            break
    return plane


def plane_jacobian(lens: str, plane: np.ndarray, params: np.ndarray, step: float = 1e-6) -> np.ndarray:
    """Derivatives of `distort` along x and y of the plane, by central differences. [N, 2 of seen, 2 of plane]"""
    if lens == "pinhole":
        return np.broadcast_to(np.eye(2), (len(plane), 2, 2))
    columns = [
        (distort(lens, plane + offset, params) - distort(lens, plane - offset, params)) / (2 * step)
        for offset in (np.array([step, 0.0]), np.array([0.0, step]))
    ]
    return np.stack(columns, axis=-1)


def lens_jacobian(lens: str, plane: np.ndarray, params: np.ndarray, step: float = 1e-6) -> np.ndarray:
    """Derivatives of `distort` by the numbers of the lens. [N, 2, N_LENS[lens]]"""
    columns = []
    for i in range(N_LENS[lens]):
        offset = np.zeros(N_LENS[lens])
        offset[i] = step
        columns.append((distort(lens, plane, params + offset) - distort(lens, plane, params - offset)) / (2 * step))
    return np.stack(columns, axis=-1) if columns else np.zeros((len(plane), 2, 0))


def rotation_of(vectors: np.ndarray) -> np.ndarray:
    """Rotation matrices of rotation vectors [C, 3], radians. [C, 3, 3]"""
    angles = np.linalg.norm(vectors, axis=-1)[:, None, None]
    axes = skew(vectors) / np.maximum(angles, 1e-12)
    return np.eye(3) + np.sin(angles) * axes + (1 - np.cos(angles)) * (axes @ axes)


def skew(vectors: np.ndarray) -> np.ndarray:
    """Matrices [C, 3, 3] so that skew(v) @ p is v x p, of vectors [C, 3]."""
    x, y, z = vectors[..., 0], vectors[..., 1], vectors[..., 2]
    zero = np.zeros_like(x)
    return np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1).reshape(*x.shape, 3, 3)
