"""Triangle meshes of simple solids, with one normal per face corner. Geometry only: no texture, no motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True)
class Mesh:
    """Triangles in object space, scene units.

    Attributes:
        vertices: [V, 3] float64
        triangles: Vertex rows, counter-clockwise seen from outside. [F, 3] int64
        corner_normals: Unit normal at each corner; equal ones give flat shading. [F, 3, 3] float64
    """

    vertices: np.ndarray
    triangles: np.ndarray
    corner_normals: np.ndarray

    def moved(self, transform: np.ndarray) -> Mesh:
        """The mesh under a rigid map [4, 4]."""
        rotation, offset = transform[:3, :3], transform[:3, 3]
        return Mesh(self.vertices @ rotation.T + offset, self.triangles, self.corner_normals @ rotation.T)


def joined(meshes: list[Mesh]) -> Mesh:
    """Several meshes as one."""
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes[:-1])])
    return Mesh(
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate([mesh.triangles + start for mesh, start in zip(meshes, starts, strict=True)]),
        np.concatenate([mesh.corner_normals for mesh in meshes]),
    )


def box(size: tuple[float, float, float], *, is_inward: bool = False) -> Mesh:
    """An axis-aligned box around the origin; inward normals make it a room.

    Args:
        size: Full edge lengths, scene units.
    """
    half = np.array(size, dtype=np.float64) / 2
    vertices, normals = [], []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            u, v = np.eye(3)[(axis + 1) % 3], np.eye(3)[(axis + 2) % 3]
            normal = sign * np.eye(3)[axis]
            around = [(-1, -1), (1, -1), (1, 1), (-1, 1)] if sign > 0 else [(-1, -1), (-1, 1), (1, 1), (1, -1)]
            vertices += [(normal + a * u + b * v) * half for a, b in around]
            normals.append(normal)
    triangles = np.array([[4 * face, 4 * face + i, 4 * face + i + 1] for face in range(6) for i in (1, 2)])
    corner_normals = np.repeat(np.array(normals), 2, axis=0)[:, None, :].repeat(3, axis=1)
    if is_inward:
        triangles, corner_normals = triangles[:, ::-1], -corner_normals
    return Mesh(np.array(vertices), triangles, corner_normals)


def sphere(radius: float, *, n_around: int = 64) -> Mesh:
    """A sphere around the origin with smooth normals, from rings of quads."""
    angle = np.linspace(0.0, 2 * np.pi, n_around + 1)
    height = np.linspace(-np.pi / 2, np.pi / 2, n_around // 2 + 1)
    longitude, latitude = np.meshgrid(angle, height)
    normals = np.stack(
        [np.cos(latitude) * np.cos(longitude), np.cos(latitude) * np.sin(longitude), np.sin(latitude)], axis=-1
    )
    return _grid(normals * radius, normals)


def cylinder(radius: float, height: float, *, n_around: int = 64) -> Mesh:
    """An upright cylinder around the origin: smooth side, flat caps."""
    angle = np.linspace(0.0, 2 * np.pi, n_around + 1)
    ring = np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=-1)  # [n + 1, 3]
    up = np.array([0.0, 0.0, 1.0])
    low, high = ring * radius - up * height / 2, ring * radius + up * height / 2
    side = _grid(np.stack([low, high]), np.stack([ring, ring]))
    top = _grid(np.stack([high, np.broadcast_to(up * height / 2, high.shape)]), np.broadcast_to(up, (2, *ring.shape)))
    bottom = _grid(
        np.stack([np.broadcast_to(-up * height / 2, low.shape), low]), np.broadcast_to(-up, (2, *ring.shape))
    )
    return joined([side, top, bottom])


def torus(radius: float, tube_radius: float, *, n_around: int = 64, n_tube: int = 24) -> Mesh:
    """A ring around the z axis with smooth normals."""
    angle, tube = np.meshgrid(np.linspace(0, 2 * np.pi, n_around + 1), np.linspace(0, 2 * np.pi, n_tube + 1))
    outward = np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=-1)
    normals = outward * np.cos(tube)[..., None] + np.array([0.0, 0.0, 1.0]) * np.sin(tube)[..., None]
    return _grid(outward * radius + normals * tube_radius, normals)


def _grid(points: np.ndarray, normals: np.ndarray) -> Mesh:
    """Two triangles for each cell of a [rows, columns, 3] grid of points; outside is columns x rows."""
    n_rows, n_columns = points.shape[:2]
    index = np.arange(n_rows * n_columns).reshape(n_rows, n_columns)
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]
    triangles = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])
    return Mesh(points.reshape(-1, 3), triangles, normals.reshape(-1, 3)[triangles])
