"""Bundle adjustment: cameras and what they see together, so that points land where they were seen.

Robust (Cauchy) residuals in pixels, expectations for what pictures say little about (principal point, lens numbers),
lens numbers shared among cameras or not. Levenberg-Marquardt with points, or places of a rigid thing, eliminated;
deterministic.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol, Self, TypeVar

import numpy as np
from scipy import sparse

from engine.calibration.solving.cameras import (
    Cameras,
    distort,
    lens_jacobian,
    plane_jacobian,
    rotation_of,
    safe_depth,
    skew,
)

MIN_SCALE_PX = 0.25
"""No key point is found more exactly than this."""


@dataclass(frozen=True, slots=True)
class Expectations:
    """Standard deviations of what is expected without pictures.

    Attributes:
        principal: Of the principal point from the middle, as a share of the picture's width. 0 keeps it there.
        focal: Of ln(focal length) from that at the start, or from `focals` of `adjust`.
        aspect: Of ln(height divided by width of a pixel) from 0.
        lens: Of each number of the lens from 0.
        groups: A number per camera; those with the same number have one focal length, principal point and lens. None
            gives every camera its own.
        is_lens_kept: Whether focal lengths, principal points and lenses stay as they are at the start.
    """

    principal: float = 0.01
    focal: float = 0.5
    aspect: float = 0.003
    lens: float = 0.2
    groups: tuple[int, ...] | None = None
    is_lens_kept: bool = False


@dataclass(frozen=True, slots=True)
class Observations:
    """N sightings of M points.

    Attributes:
        cameras: Which camera. [N]
        points: Which point, 0..M-1. [N]
        pixels: Where. [N, 2]
    """

    cameras: np.ndarray
    points: np.ndarray
    pixels: np.ndarray

    def __len__(self) -> int:
        return len(self.cameras)

    def chosen(self, is_kept: np.ndarray) -> Observations:
        """The sightings of a mask, points numbered as before."""
        return Observations(self.cameras[is_kept], self.points[is_kept], self.pixels[is_kept])


def errors_px(cameras: Cameras, points: np.ndarray, seen: Observations) -> np.ndarray:
    """Distance of each sighting from where its point lands; infinite behind the camera. [N]"""
    pixels, depths = cameras.pixels(seen.cameras, points[seen.points])
    return np.where(depths > 1e-9, np.linalg.norm(pixels - seen.pixels, axis=-1), np.inf)


class Shape(Protocol):
    """What cameras see, as blocks of numbers that are sought."""

    @property
    def points(self) -> np.ndarray:
        """Points in the world. [M, 3]"""
        ...

    def owners(self, rows: np.ndarray) -> np.ndarray:
        """The block that each of these points belongs to. [N]"""
        ...

    def derivatives(self, by_points: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Derivatives of pixels [N, 2, 3] by these points as derivatives by the numbers of their block. [N, 2, D]"""
        ...

    def moved(self, step: np.ndarray) -> Self:
        """With a step [blocks, D] subtracted from the numbers."""
        ...


AnyShape = TypeVar("AnyShape", bound=Shape)


@dataclass(frozen=True, slots=True)
class FreePoints:
    """Points that may lie anywhere, each for itself. points: [M, 3]"""

    points: np.ndarray

    def owners(self, rows: np.ndarray) -> np.ndarray:
        """Each is its own block."""
        return rows

    def derivatives(self, by_points: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """As they are."""
        return by_points

    def moved(self, step: np.ndarray) -> FreePoints:
        """step: [M, 3]"""
        return FreePoints(self.points - step)


@dataclass(frozen=True, slots=True)
class RigidPlaces:
    """One thing of known shape in several places.

    Attributes:
        corners: Its points. [K, 3]
        rotations, translations: From it to the world. [B, 3, 3], [B, 3]
    """

    corners: np.ndarray
    rotations: np.ndarray
    translations: np.ndarray

    @property
    def points(self) -> np.ndarray:
        """Its points in all places, place after place. [B K, 3]"""
        return (self.corners @ self.rotations.transpose(0, 2, 1) + self.translations[:, None]).reshape(-1, 3)

    def owners(self, rows: np.ndarray) -> np.ndarray:
        """The place of each point."""
        return rows // len(self.corners)

    def derivatives(self, by_points: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """By turning it about its own origin, and by moving it. [N, 2, 6]"""
        turned = np.einsum("nij,nj->ni", self.rotations[self.owners(rows)], self.corners[rows % len(self.corners)])
        return np.concatenate([by_points @ -skew(turned), by_points], axis=-1)

    def moved(self, step: np.ndarray) -> RigidPlaces:
        """step: [B, 6]"""
        return replace(
            self, rotations=rotation_of(-step[:, :3]) @ self.rotations, translations=self.translations - step[:, 3:]
        )


def adjust(
    cameras: Cameras,
    shape: AnyShape,
    seen: Observations,
    *,
    middles: np.ndarray,
    widths: np.ndarray,
    expect: Expectations,
    focals: np.ndarray | None = None,
    n_iterations: int = 30,
) -> tuple[Cameras, AnyShape]:
    """Cameras and what they see with the least robust error.

    Args:
        cameras: The start.
        shape: The start of what they see.
        seen: Every free point is seen at least twice, every place at least once.
        middles, widths: Of the pictures, px. [C, 2], [C]
        expect: Expectations about the lenses.
        focals: Focal lengths that are expected, px; None expects those of the start. [C]
    Returns:
        Cameras and shape.
    """
    n_cameras, n_params = len(cameras), 10 + cameras.lens_params.shape[1]
    share = _sharing(n_cameras, n_params, expect.groups, is_lens_kept=expect.is_lens_kept)
    start_focals = np.log(cameras.focals if focals is None else focals)
    stiffness = _stiffness(n_params, widths, expect)
    owners = shape.owners(seen.points)
    damping = 1e-4
    residuals, scale = _residuals(cameras, shape.points, seen), 0.0
    for _ in range(n_iterations):
        lengths = np.linalg.norm(residuals, axis=-1)
        scale = max(1.5 * float(np.median(lengths)), MIN_SCALE_PX)
        weights = 1.0 / (1.0 + (lengths / scale) ** 2)
        J_cameras, J_points = _jacobians(cameras, shape.points, seen)
        J_shape = shape.derivatives(J_points, seen.points)
        root = np.sqrt(weights)[:, None]
        A, B, target = J_cameras * root[..., None], J_shape * root[..., None], residuals * root
        expected = _expected(cameras, start_focals, middles, n_params)
        system = _System(A, B, target, seen.cameras, owners, n_cameras, share)
        system.expect(scale**2 * stiffness, expected)
        before = _cost(residuals, expected, stiffness, scale)
        for _ in range(6):
            step = system.step(damping)
            moved = _moved(cameras, step[0].reshape(n_cameras, n_params))
            moved_shape = shape.moved(step[1])
            new_residuals = _residuals(moved, moved_shape.points, seen)
            after = _cost(new_residuals, _expected(moved, start_focals, middles, n_params), stiffness, scale)
            if after < before:
                break
            damping = min(damping * 10, 1e6)
        else:
            break
        cameras, shape, residuals = moved, moved_shape, new_residuals
        damping = max(damping / 5, 1e-9)
        if before - after < 1e-6 * before:
            break
    return cameras, shape


def _residuals(cameras: Cameras, points: np.ndarray, seen: Observations) -> np.ndarray:
    pixels, depths = cameras.pixels(seen.cameras, points[seen.points])
    residuals = np.clip(pixels - seen.pixels, -1e4, 1e4)
    return np.where((depths > 1e-9)[:, None], residuals, 1e3)


def _cost(residuals: np.ndarray, expected: np.ndarray, stiffness: np.ndarray, scale: float) -> float:
    robust = scale**2 * np.log1p((residuals**2).sum(-1) / scale**2).sum()
    return float(robust + scale**2 * (stiffness * expected**2).sum())


def _stiffness(n_params: int, widths: np.ndarray, expect: Expectations) -> np.ndarray:
    """One over the square of each expectation's deviation. [C, P]"""
    stiffness = np.zeros((len(widths), n_params))
    stiffness[:, 6] = expect.focal**-2
    stiffness[:, 7] = expect.aspect**-2
    stiffness[:, 8:10] = (1.0 / np.maximum(expect.principal * widths, 1e-6) ** 2)[:, None]
    stiffness[:, 10:] = expect.lens**-2
    return stiffness


def _expected(cameras: Cameras, start_focals: np.ndarray, middles: np.ndarray, n_params: int) -> np.ndarray:
    """How far each number is from what is expected of it. [C, P]"""
    off = np.zeros((len(cameras), n_params))
    off[:, 6] = np.log(cameras.focals) - start_focals
    off[:, 7] = np.log(cameras.aspects)
    off[:, 8:10] = cameras.principal - middles
    off[:, 10:] = cameras.lens_params
    return off


def _sharing(n_cameras: int, n_params: int, groups: tuple[int, ...] | None, *, is_lens_kept: bool) -> sparse.csr_matrix:
    """Maps the numbers that are sought to all numbers of all cameras. [C P, Q]"""
    if is_lens_kept:
        is_pose = np.tile(np.arange(n_params) < 6, n_cameras)
        return sparse.csr_matrix(np.eye(n_cameras * n_params)[:, is_pose])
    if groups is None:
        return sparse.csr_matrix(sparse.identity(n_cameras * n_params))
    n_lens = n_params - 6
    rows = np.arange(n_cameras * n_params)
    camera, param = np.divmod(rows, n_params)
    group = np.asarray(groups)[camera]
    columns = np.where(param < 6, camera * 6 + param, n_cameras * 6 + group * n_lens + param - 6)
    n_columns = n_cameras * 6 + (max(groups) + 1) * n_lens
    return sparse.csr_matrix((np.ones(len(rows)), (rows, columns)), shape=(len(rows), n_columns))


def _jacobians(cameras: Cameras, points: np.ndarray, seen: Observations) -> tuple[np.ndarray, np.ndarray]:
    """Derivatives of pixels by rotation, translation, ln focal, ln aspect, principal point, lens; and by points."""
    rows, n_lens = seen.cameras, cameras.lens_params.shape[1]
    rotations, params = cameras.rotations[rows], cameras.lens_params[rows]
    turned = np.einsum("nij,nj->ni", rotations, points[seen.points])
    inside = turned + cameras.translations[rows]
    depth = safe_depth(inside[:, 2])
    plane = inside[:, :2] / depth[:, None]
    to_plane = np.zeros((len(rows), 2, 3))
    to_plane[:, 0, 0] = to_plane[:, 1, 1] = 1 / depth
    to_plane[:, :, 2] = -plane / depth[:, None]
    focals = cameras.focals_xy[rows, :, None]
    by_inside = focals * plane_jacobian(cameras.lens, plane, params) @ to_plane
    J = np.zeros((len(rows), 2, 10 + n_lens))
    J[:, :, :3] = by_inside @ -skew(turned)
    J[:, :, 3:6] = by_inside
    J[:, :, 6] = focals[..., 0] * distort(cameras.lens, plane, params)
    J[:, 1, 7] = J[:, 1, 6]
    J[:, :, 8:10] = np.eye(2)
    J[:, :, 10:] = focals * lens_jacobian(cameras.lens, plane, params)
    return J, by_inside @ rotations


def _sums(values: np.ndarray, groups: np.ndarray, n_groups: int) -> np.ndarray:
    """Sums of values [N, K] over their groups. [n_groups, K]"""
    return np.stack([np.bincount(groups, column, minlength=n_groups) for column in values.T], axis=-1)


class _System:
    """The normal equations of one iteration, by blocks: cameras [C P], what they see [M, D], and what joins them.

    Args:
        A, B: Derivatives of weighted residuals by cameras and by blocks of what they see. [N, 2, P], [N, 2, D]
        target: Weighted residuals. [N, 2]
        cameras, owners: Camera and block of each. [N]
        n_cameras: C
        share: Maps what is sought to all numbers of all cameras.
    """

    def __init__(self, A, B, target, cameras: np.ndarray, owners: np.ndarray, n_cameras: int, share) -> None:
        n_params, n_block = A.shape[2], B.shape[2]
        n_blocks = int(owners.max()) + 1
        self._share, self._size = share, n_cameras * n_params
        self._H, self._g = np.zeros((self._size, self._size)), np.zeros(self._size)
        for camera in range(n_cameras):
            rows = np.flatnonzero(cameras == camera)
            place = slice(camera * n_params, (camera + 1) * n_params)
            of_camera = A[rows].reshape(-1, n_params)
            self._H[place, place] = of_camera.T @ of_camera
            self._g[place] = of_camera.T @ target[rows].reshape(-1)
        squares = np.einsum("nki,nkj->nij", B, B).reshape(-1, n_block**2)
        self._V = _sums(squares, owners, n_blocks).reshape(-1, n_block, n_block)
        self._g_blocks = _sums(np.einsum("nki,nk->ni", B, target), owners, n_blocks)
        rows = cameras[:, None, None] * n_params + np.arange(n_params)[:, None]
        columns = owners[:, None, None] * n_block + np.arange(n_block)
        joints = np.einsum("nki,nkj->nij", A, B)
        places = (np.broadcast_to(place, joints.shape).reshape(-1) for place in (rows, columns))
        shape = (self._size, n_block * n_blocks)
        self._joints = sparse.csr_matrix((joints.reshape(-1), tuple(places)), shape=shape)

    def expect(self, stiffness: np.ndarray, expected: np.ndarray) -> None:
        """Add what is expected of cameras: both [C, P]."""
        self._H[np.diag_indices(self._size)] += stiffness.reshape(-1)
        self._g += (stiffness * expected).reshape(-1)

    def step(self, damping: float) -> tuple[np.ndarray, np.ndarray]:
        """The step to subtract from the numbers of the cameras [C P] and from the blocks [M, D]."""
        n_blocks, n_block = self._g_blocks.shape
        diagonal = np.maximum(np.einsum("mii->mi", self._V), 1e-9)
        inverse = np.linalg.inv(self._V + damping * diagonal[:, :, None] * np.eye(n_block))
        blocks = (inverse, np.arange(n_blocks), np.arange(n_blocks + 1))
        weighted = self._joints @ sparse.bsr_matrix(blocks, shape=(n_block * n_blocks, n_block * n_blocks))
        H = self._H - (weighted @ self._joints.T).toarray()
        g = self._g - weighted @ self._g_blocks.reshape(-1)
        reduced = self._share.T @ (self._share.T @ H.T).T
        size = 1 / np.sqrt(np.maximum((self._share.T @ (self._share.T @ self._H).T).diagonal(), 1e-12))
        scaled = reduced * size[:, None] * size + max(damping, 1e-9) * np.eye(len(size))
        sought = size * np.linalg.solve(scaled, size * (self._share.T @ g))
        cameras_step = self._share @ sought
        blocks_right = self._g_blocks - (self._joints.T @ cameras_step).reshape(n_blocks, n_block)
        return cameras_step, np.einsum("mij,mj->mi", inverse, blocks_right)


def _moved(cameras: Cameras, step: np.ndarray) -> Cameras:
    return replace(
        cameras,
        rotations=rotation_of(-step[:, :3]) @ cameras.rotations,
        translations=cameras.translations - step[:, 3:6],
        focals=cameras.focals * np.exp(np.clip(-step[:, 6], -0.5, 0.5)),
        aspects=cameras.aspects * np.exp(np.clip(-step[:, 7], -0.1, 0.1)),
        principal=cameras.principal - step[:, 8:10],
        lens_params=cameras.lens_params - step[:, 10:],
    )
