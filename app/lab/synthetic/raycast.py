"""Pictures and truth of the sample scene by ray casting triangles with Open3D. No Gaussian is involved.

A picture takes supersampling^2 rays per pixel, shades each hit (Lambert with an area lamp, ambient light, highlights
of glossy parts) in linear light, averages and encodes. Still parts are cast once per camera and set of present parts;
moving parts are cast per frame inside the rectangle they can cover, and win where they are nearer. Still parts cast
shadows; moving ones receive them but cast none, which keeps static pixels truly static.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from app.lab.synthetic.meshes import Mesh
from app.lab.synthetic.scene import LIGHT_POSITION, LIGHT_RADIUS, Part, SyntheticScene

AMBIENT = 0.42
"""Light that reaches a surface in any direction."""
LAMP = 0.85
"""Light of the lamp on a surface that faces it at LAMP_DISTANCE."""
LAMP_DISTANCE = 2.2
"""Scene units at which the lamp gives LAMP. It falls off gently, as in a room with bright walls."""
HIGHLIGHT_POWER = 60
"""Of the cosine between normal and half-way vector: normals within 9 degrees of it get half of the light or more."""
GAMMA = 2.2
"""Display encoding: encoded = linear ** (1 / GAMMA)."""


@dataclass(frozen=True, slots=True)
class Truth:
    """A camera's view at pixel centres.

    Attributes:
        depths: Camera z of the surface at the pixel centre, scene units. [H, W] float32
        part_indices: Row of SyntheticScene.parts at the pixel centre. [H, W] int32
        part_names: Names of those rows.
        is_moving: Whether the part there is one that moves. [H, W] bool
    """

    depths: np.ndarray
    part_indices: np.ndarray
    part_names: tuple[str, ...]
    is_moving: np.ndarray

    def mask(self, *names: str) -> np.ndarray:
        """Pixels whose centre shows one of these parts. [H, W] bool. Raises ValueError for an unknown name."""
        unknown = [name for name in names if name not in self.part_names]
        if unknown:
            raise ValueError(f"no part called {', '.join(unknown)}; there are {', '.join(self.part_names)}")
        rows = [self.part_names.index(name) for name in names]
        return np.isin(self.part_indices, rows)


@dataclass(frozen=True, slots=True)
class Surfaces:
    """The surfaces that a camera sees, pixel by pixel.

    Attributes:
        colors: Display-encoded, before a sensor clips them: above 1 where brighter than white. [H, W, 3] float64
        positions: World point seen by the middle sub-pixel, scene units. [H, W, 3] float64
    """

    colors: np.ndarray
    positions: np.ndarray


@dataclass(slots=True)
class _Samples:
    """One value per ray of a camera. [R, ...]; a ray is one sub-pixel."""

    depths: np.ndarray  # [R] camera z, infinite without a hit
    part_indices: np.ndarray  # [R] int32, -1 without a hit
    light: np.ndarray  # [R, 3] linear


class SceneCamera:
    """Renders one camera of a scene. Owns still parts, cast once. Not safe to share between threads."""

    def __init__(self, scene: SyntheticScene, camera_index: int, *, supersampling: int = 3) -> None:
        self.scene = scene
        self.supersampling = supersampling
        self._world_to_camera = scene.rig.world_to_camera[camera_index]
        self._K = scene.rig.Ks[camera_index]
        self._size = tuple(int(value) for value in scene.rig.image_sizes[camera_index])
        self._rays = _camera_rays(self._world_to_camera, self._K, self._size, supersampling)
        self._standing_key: tuple[int, ...] | None = None
        self._standing: tuple[_Samples, _MeshCaster] | None = None

    def image(self, frame_index: int) -> np.ndarray:
        """The picture. [H, W, 3] uint8, display-encoded"""
        colors = self._colors(self._cast(frame_index))
        return np.floor(np.clip(colors, 0, 1) * 255 + 0.5).astype(np.uint8)

    def surfaces(self, frame_index: int) -> Surfaces:
        """Colours that no sensor has clipped or rounded, and where in the room they are."""
        width, height = self._size
        n = self.supersampling
        samples = self._cast(frame_index)
        rays = self._rays.reshape(height, n, width, n, 6)[:, n // 2, :, n // 2]
        depths = samples.depths.reshape(height, n, width, n)[:, n // 2, :, n // 2, None]
        return Surfaces(self._colors(samples), rays[..., :3] + rays[..., 3:] * depths)

    def coverage(self, frame_index: int, *names: str) -> np.ndarray:
        """Share of each pixel that these parts cover. [H, W] float32"""
        width, height = self._size
        n = self.supersampling
        rows = [self.scene.part_index(name) for name in names]
        is_part = np.isin(self._cast(frame_index).part_indices, rows).reshape(height, n, width, n)
        return is_part.mean(axis=(1, 3), dtype=np.float32)

    def _colors(self, samples: _Samples) -> np.ndarray:
        """Mean light of each pixel, display-encoded. [H, W, 3]"""
        width, height = self._size
        n = self.supersampling
        return samples.light.reshape(height, n, width, n, 3).mean(axis=(1, 3)) ** (1 / GAMMA)

    def _cast(self, frame_index: int) -> _Samples:
        standing, caster = self._standing_samples(frame_index)
        samples = _Samples(standing.depths.copy(), standing.part_indices.copy(), standing.light.copy())
        for row, part in enumerate(self.scene.parts):
            pose = part.pose(frame_index) if part.is_moving else None
            if pose is None:
                continue
            rays = self._rows_that_may_hit(part.mesh.vertices @ pose[:3, :3].T + pose[:3, 3])
            hits = _MeshCaster([(row, part, pose)]).cast(self._rays[rays], lamp_rows=rays, shadow=caster, n=self._n)
            is_nearer = hits.depths < samples.depths[rays]
            nearer = rays[is_nearer]
            samples.depths[nearer] = hits.depths[is_nearer]
            samples.part_indices[nearer] = hits.part_indices[is_nearer]
            samples.light[nearer] = hits.light[is_nearer]
        return samples

    @property
    def _n(self) -> tuple[int, int]:
        return self.supersampling, self._size[0] * self.supersampling

    def _standing_samples(self, frame_index: int) -> tuple[_Samples, _MeshCaster]:
        present = [
            (row, part, pose)
            for row, part in enumerate(self.scene.parts)
            if not part.is_moving and (pose := part.pose(frame_index)) is not None
        ]
        key = tuple(row for row, _, _ in present)
        if self._standing is None or key != self._standing_key:
            caster = _MeshCaster(present)
            samples = caster.cast(self._rays, lamp_rows=np.arange(len(self._rays)), shadow=caster, n=self._n)
            self._standing_key, self._standing = key, (samples, caster)
        return self._standing

    def _rows_that_may_hit(self, vertices: np.ndarray) -> np.ndarray:
        """Rays inside the image rectangle around these world points. [R'] rows"""
        width, height = (value * self.supersampling for value in self._size)
        points = vertices @ self._world_to_camera[:3, :3].T + self._world_to_camera[:3, 3]
        if points[:, 2].min() < 0.05:  # too near for a projected rectangle
            return np.arange(width * height)
        pixels = (points @ self._K.T)[:, :2] / points[:, 2:] * self.supersampling
        low = np.clip(np.floor(pixels.min(0)) - 1, 0, [width, height]).astype(np.int64)
        high = np.clip(np.ceil(pixels.max(0)) + 1, 0, [width, height]).astype(np.int64)
        columns, rows = np.arange(low[0], high[0]), np.arange(low[1], high[1])
        return (rows[:, None] * width + columns[None, :]).reshape(-1)


def make_truth(scene: SyntheticScene, camera_index: int, frame_index: int) -> Truth:
    """Depth and object masks of one picture, from one ray through each pixel centre."""
    width, height = (int(value) for value in scene.rig.image_sizes[camera_index])
    present = [
        (row, part, pose) for row, part in enumerate(scene.parts) if (pose := part.pose(frame_index)) is not None
    ]
    rays = _camera_rays(scene.rig.world_to_camera[camera_index], scene.rig.Ks[camera_index], (width, height), 1)
    hits = _MeshCaster(present).hits(rays)
    part_indices = hits.part_indices.reshape(height, width)
    moving = [row for row, part in enumerate(scene.parts) if part.is_moving]
    return Truth(
        depths=hits.depths.reshape(height, width).astype(np.float32),
        part_indices=part_indices,
        part_names=tuple(part.name for part in scene.parts),
        is_moving=np.isin(part_indices, moving),
    )


@dataclass(frozen=True, slots=True)
class _Hits:
    depths: np.ndarray  # [R]
    part_indices: np.ndarray  # [R]
    points: np.ndarray  # [R, 3] world; meaningless without a hit
    normals: np.ndarray  # [R, 3] world


class _MeshCaster:
    """Parts of one moment in an Open3D ray-casting scene."""

    def __init__(self, present: Sequence[tuple[int, Part, np.ndarray]]) -> None:
        import open3d  # here, because it takes a second and only rendering needs it

        self._tensor: Any = open3d.core.Tensor
        self._scene: Any = open3d.t.geometry.RaycastingScene()
        self._parts = list(present)
        self._meshes: list[Mesh] = []
        for _, part, pose in self._parts:
            mesh = part.mesh.moved(pose)
            self._meshes.append(mesh)
            self._scene.add_triangles(
                self._tensor(mesh.vertices.astype(np.float32)),
                self._tensor(np.ascontiguousarray(mesh.triangles, dtype=np.uint32)),
            )

    def hits(self, rays: np.ndarray) -> _Hits:
        """First surface along each ray [R, 6] of origin and direction with camera z of 1."""
        found = self._scene.cast_rays(self._tensor(np.ascontiguousarray(rays, dtype=np.float32)))
        depths = found["t_hit"].numpy().astype(np.float64)
        geometry = found["geometry_ids"].numpy()
        triangle = found["primitive_ids"].numpy()
        u, v = found["primitive_uvs"].numpy().astype(np.float64).T
        weights = np.stack([1 - u - v, u, v], axis=-1)  # [R, 3]
        part_indices = np.full(len(rays), -1, dtype=np.int32)
        normals = np.zeros((len(rays), 3))
        for number, ((row, _, _), mesh) in enumerate(zip(self._parts, self._meshes, strict=True)):
            is_here = geometry == number
            part_indices[is_here] = row
            corners = mesh.corner_normals[triangle[is_here]]  # [P, 3, 3]
            normals[is_here] = np.einsum("pc,pcd->pd", weights[is_here], corners)
        normals /= np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-12)
        reach = np.where(np.isfinite(depths), depths, 0.0)[:, None]
        return _Hits(depths, part_indices, rays[:, :3] + rays[:, 3:] * reach, normals)

    def cast(self, rays: np.ndarray, *, lamp_rows: np.ndarray, shadow: _MeshCaster, n: tuple[int, int]) -> _Samples:
        """Shaded hits. Each sub-pixel row of a pixel looks at its own point of the lamp.

        Args:
            rays: [R, 6]
            lamp_rows: Position of each ray among all rays of the camera. [R]
            shadow: Casts the shadows.
            n: Supersampling, and sub-pixels per image row.
        """
        found = self.hits(rays)
        light = np.zeros((len(rays), 3))
        lamp = _lamp_points(lamp_rows, *n)
        for row, part, pose in self._parts:
            is_here = found.part_indices == row
            if not is_here.any():
                continue
            points, normals = found.points[is_here], found.normals[is_here]
            albedo = part.texture((points - pose[:3, 3]) @ pose[:3, :3], normals @ pose[:3, :3])
            shade = _shade(points, normals, lamp[is_here], shadow)
            light[is_here] = np.clip(albedo, 0, 1) ** GAMMA * shade[:, None]
            if part.gloss > 0:
                highlight = _highlight(points, normals, lamp[is_here], rays[is_here, :3], shadow)
                light[is_here] += part.gloss * highlight[:, None]
        return _Samples(found.depths, found.part_indices, light)

    def is_blocked(self, points: np.ndarray, towards: np.ndarray) -> np.ndarray:
        """Whether something lies between points and towards, both [P, 3]. [P] bool"""
        rays = np.concatenate([points, towards - points], axis=-1).astype(np.float32)
        return self._scene.test_occlusions(self._tensor(rays), tnear=1e-4, tfar=0.999).numpy()


def _shade(points: np.ndarray, normals: np.ndarray, lamp: np.ndarray, shadow: _MeshCaster) -> np.ndarray:
    """Light on surfaces [P, 3] from the ambience and one lamp point each. [P]"""
    to_lamp = lamp - points
    distance = np.linalg.norm(to_lamp, axis=-1)
    facing = np.maximum((normals * to_lamp).sum(-1) / np.maximum(distance, 1e-9), 0.0)
    is_blocked = shadow.is_blocked(points + 2e-3 * normals, lamp)
    ambient = AMBIENT * (0.9 + 0.1 * normals[:, 2])
    return ambient + LAMP * np.where(is_blocked, 0.0, facing) * (LAMP_DISTANCE / (LAMP_DISTANCE * 0.4 + 0.6 * distance))


def _highlight(
    points: np.ndarray, normals: np.ndarray, lamp: np.ndarray, eyes: np.ndarray, shadow: _MeshCaster
) -> np.ndarray:
    """Share of the lamp that a glossy surface reflects towards each eye, after Blinn and Phong. [P] in 0..1"""
    to_lamp, to_eye = (away / np.linalg.norm(away, axis=-1, keepdims=True) for away in (lamp - points, eyes - points))
    halfway = to_lamp + to_eye
    cosine = (normals * halfway).sum(-1) / np.maximum(np.linalg.norm(halfway, axis=-1), 1e-9)
    is_lit = ((normals * to_lamp).sum(-1) > 0) & ~shadow.is_blocked(points + 2e-3 * normals, lamp)
    return np.where(is_lit, np.maximum(cosine, 0.0) ** HIGHLIGHT_POWER, 0.0)


def _lamp_points(rows: np.ndarray, supersampling: int, rays_per_row: int) -> np.ndarray:
    """A point of the lamp disc for each sub-pixel; a whole pixel looks at supersampling^2 of them, spread evenly."""
    n_points = supersampling * supersampling
    which = (rows // rays_per_row % supersampling) * supersampling + rows % rays_per_row % supersampling
    radius = LIGHT_RADIUS * np.sqrt((np.arange(n_points) + 0.5) / n_points) if n_points > 1 else np.zeros(1)
    angle = np.arange(n_points) * np.pi * (3 - np.sqrt(5))  # golden angle: even cover of the disc
    disc = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.zeros(n_points)], axis=-1)
    return LIGHT_POSITION + disc[which]


def _camera_rays(world_to_camera: np.ndarray, K: np.ndarray, size: tuple[int, ...], supersampling: int) -> np.ndarray:
    """Rays through all sub-pixel centres, row by row; the direction has camera z of 1, so hit distance is depth.

    Returns:
        Origin and direction in world space. [H * n * W * n, 6] float64
    """
    width, height = size[0] * supersampling, size[1] * supersampling
    columns = (np.arange(width) + 0.5) / supersampling
    rows = (np.arange(height) + 0.5) / supersampling
    x = np.broadcast_to((columns - K[0, 2]) / K[0, 0], (height, width))
    y = np.broadcast_to(((rows - K[1, 2]) / K[1, 1])[:, None], (height, width))
    directions = np.stack([x, y, np.ones_like(x)], axis=-1).reshape(-1, 3) @ world_to_camera[:3, :3]
    origin = -world_to_camera[:3, :3].T @ world_to_camera[:3, 3]
    return np.concatenate([np.broadcast_to(origin, directions.shape), directions], axis=-1)
