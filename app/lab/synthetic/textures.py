"""Procedural albedo: functions from object-space points and normals to display-encoded colours.

All patterns are soft-edged and coarse (features of several centimetres and more), because the cameras see a wall
with about two centimetres per pixel: finer detail would only alias. Everything is a fixed function of position.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

Texture = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""(points [P, 3], normals [P, 3]) in object space -> albedo [P, 3] in 0..1, display-encoded."""


def rgb(code: str) -> np.ndarray:
    """A colour from six hex digits. [3] in 0..1"""
    return np.array([int(code[i : i + 2], 16) for i in (0, 2, 4)]) / 255.0


def hashed(cells: np.ndarray, seed: int) -> np.ndarray:
    """A fixed number in 0..1 for each integer cell. cells is [..., D] of whole numbers."""
    state = np.full(cells.shape[:-1], (seed * 0x9E3779B9 + 0x7F4A7C15) & 0xFFFFFFFF, dtype=np.uint64)
    mask = np.uint64(0xFFFFFFFF)
    for axis in range(cells.shape[-1]):
        state = (state ^ cells[..., axis].astype(np.int64).astype(np.uint64)) & mask
        state = (state * np.uint64(0x85EBCA6B)) & mask
        state = ((state ^ (state >> np.uint64(13))) * np.uint64(0xC2B2AE35)) & mask
        state ^= state >> np.uint64(16)
    return state.astype(np.float64) / 0xFFFFFFFF


def noise(points: np.ndarray, seed: int) -> np.ndarray:
    """Smooth value noise in 0..1 with unit feature size, for points [..., D]. One number per point."""
    base = np.floor(points)
    weight = points - base
    weight = weight * weight * (3 - 2 * weight)
    total = np.zeros(points.shape[:-1])
    n_axes = points.shape[-1]
    for corner in range(1 << n_axes):
        offset = np.array([(corner >> axis) & 1 for axis in range(n_axes)], dtype=np.float64)
        share = np.prod(np.where(offset > 0, weight, 1 - weight), axis=-1)
        total += share * hashed(base + offset, seed)
    return total


def cloudy(points: np.ndarray, seed: int) -> np.ndarray:
    """Two octaves of noise in 0..1."""
    return (2 * noise(points, seed) + noise(points * 2.03, seed + 1)) / 3


def step(value: np.ndarray, edge: float, softness: float) -> np.ndarray:
    """0 below the edge, 1 above, with a soft ramp of this total width."""
    ramp = np.clip((value - edge) / softness + 0.5, 0.0, 1.0)
    return ramp * ramp * (3 - 2 * ramp)


def mix(a: np.ndarray, b: np.ndarray, share: np.ndarray) -> np.ndarray:
    """a where share is 0, b where it is 1."""
    return a + (b - a) * share[..., None]


def floor_tiles(points: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Large tiles of changing tint with soft joints, and a round rug with rings in the middle."""
    plane = points[:, :2]
    tile = np.floor(plane / 0.5)
    is_odd = (tile.sum(-1) % 2 != 0).astype(np.float64)
    color = mix(rgb("b89a74"), rgb("86664a"), is_odd) * (0.86 + 0.28 * hashed(tile, 3))[:, None]
    inside = np.abs(plane / 0.5 - tile - 0.5).max(-1)
    color = mix(color, rgb("4c4038"), step(inside, 0.47, 0.05))
    color = color * (0.84 + 0.32 * cloudy(plane * 5.0, 5))[:, None]

    radius = np.hypot(plane[:, 0], plane[:, 1])
    angle = np.arctan2(plane[:, 1], plane[:, 0])
    petals = step(np.sin(angle * 8) * np.sin(radius * 12.0), 0.0, 0.5)
    rug = mix(rgb("7d2f38"), rgb("d9a45a"), petals)
    rug = mix(rug, rgb("24405e"), step(radius, 0.95, 0.03) * step(-radius, -1.12, 0.03))
    rug = mix(rug, rgb("e6dcc4"), step(radius, 1.12, 0.03))
    rug = rug * (0.88 + 0.24 * cloudy(plane * 7.0, 9))[:, None]
    return mix(color, rug, step(-radius, -1.25, 0.02))


def room(points: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Floor, plain ceiling and four walls with wainscot, paint of different colours and two pictures each.

    Points are in room space: the floor at z = 0, x and y from the middle.
    """
    color = np.empty_like(points)
    is_floor, is_ceiling = normals[:, 2] > 0.5, normals[:, 2] < -0.5
    color[is_floor] = floor_tiles(points[is_floor], normals[is_floor])
    color[is_ceiling] = rgb("dcd8ce") * (0.96 + 0.06 * noise(points[is_ceiling, :2] * 0.8, 17))[:, None]
    paints = {(0, 1): "8fa6a0", (0, -1): "c2a27f", (1, 1): "a9adbd", (1, -1): "b5b88c"}
    for (axis, sign), paint in paints.items():
        is_wall = normals[:, axis] * sign > 0.5
        along = points[is_wall, 1 - axis] * (sign if axis == 1 else -sign)
        color[is_wall] = _wall(along, points[is_wall, 2], rgb(paint), seed=31 + 7 * (2 * axis + (sign > 0)))
    return color


def bare_room(points: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Floor, ceiling and walls in one plain paint each: nothing to match but edges and shadows."""
    color = np.empty_like(points)
    for axis, sign, paint in ((0, 1, "8fa6a0"), (0, -1, "c2a27f"), (1, 1, "a9adbd"), (1, -1, "b5b88c")):
        color[normals[:, axis] * sign > 0.5] = rgb(paint)
    color[normals[:, 2] > 0.5] = rgb("9a8468")
    color[normals[:, 2] < -0.5] = rgb("dcd8ce")
    return color


def meadow(points: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Grass and bare earth in patches."""
    grass = mix(rgb("5b7a38"), rgb("93a257"), cloudy(points[:, :2] * 4.0, 111))
    earth = rgb("8a6f4e") * (0.8 + 0.4 * cloudy(points[:, :2] * 6.0, 113))[:, None]
    return mix(grass, earth, step(noise(points[:, :2] * 0.9, 117), 0.6, 0.2))


def sky(points: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Blue that grows paler towards the horizon. Points are around the middle of the sky."""
    return mix(rgb("e6eef4"), rgb("a8c8ee"), np.clip(points[:, 2] / 25.0, 0, 1) ** 0.5)


def _wall(along: np.ndarray, height: np.ndarray, paint: np.ndarray, *, seed: int) -> np.ndarray:
    """One wall: `along` from -3 to 3 and `height` from 0 up, scene units. [P, 3]"""
    plane = np.stack([along, height], axis=-1)
    color = paint * (0.84 + 0.3 * cloudy(plane * 2.2, seed))[:, None]
    band = step(np.sin(along * 7.0 + 1.2 * np.sin(height * 2.0 + seed)), 0.55, 0.5) * step(along, 0.6, 0.3)
    color = mix(color, paint * 0.72, 0.8 * band)  # broad stripes on one side only: the other side stays bare

    panel = np.floor(along / 0.6)
    wood = mix(rgb("6e4a32"), rgb("94683f"), hashed(panel[:, None], seed + 3))
    wood = wood * (0.82 + 0.36 * cloudy(plane * np.array([9.0, 1.6]), seed + 4))[:, None]
    wood = mix(wood, rgb("3d2a1e"), step(np.abs(along / 0.6 - panel - 0.5), 0.45, 0.05))
    color = mix(color, wood, step(-height, -0.85, 0.02))
    color = mix(color, rgb("efe6d4"), step(-np.abs(height - 0.87), -0.04, 0.02))

    for centre, half_width, picture in ((-1.45, 0.62, _picture_sun), (1.25, 0.55, _picture_cells)):
        u, v = (along - centre) / half_width, (height - 1.65) / 0.48
        reach = np.maximum(np.abs(u), np.abs(v))
        color = mix(color, rgb("2b2420"), step(-reach, -1.0, 0.04))
        color = mix(color, picture(u, v, seed), step(-reach, -0.88, 0.04))
    return color


def _picture_sun(u: np.ndarray, v: np.ndarray, seed: int) -> np.ndarray:
    """A landscape: sky gradient, sun, two ridges. u and v in -1..1."""
    sky = mix(rgb("f0b070"), rgb("4a78a8"), np.clip((v + 0.6) / 1.5, 0, 1))
    sun = rgb("fff0b0") if seed % 2 else rgb("e04830")
    color = mix(sky, sun, step(-np.hypot(u - 0.3, v - 0.35), -0.27, 0.06))
    for level, tint, shift in ((0.05, "5a7a58", 0.0), (-0.35, "2f4a3c", 2.0)):
        ridge = level + 0.28 * np.sin(u * 3.1 + shift + seed) + 0.1 * np.sin(u * 8.0 + seed)
        color = mix(color, rgb(tint), step(ridge - v, 0.0, 0.06))
    return color


def _picture_cells(u: np.ndarray, v: np.ndarray, seed: int) -> np.ndarray:
    """Coloured patches with discs. u and v in -1..1."""
    palette = np.stack([rgb(code) for code in ("c8443c", "e8b23c", "3c6e9c", "e9e2d0", "4a8c5c", "6a4a80")])
    cell = np.floor(np.stack([u, v], -1) * 2.0)
    color = palette[(hashed(cell, seed) * 5.999).astype(np.int64)]
    disc = palette[(hashed(cell, seed + 1) * 5.999).astype(np.int64)]
    centre = (np.stack([u, v], -1) * 2.0 - cell - 0.5) * np.array([0.62, 0.48])
    return mix(color, disc, step(-np.hypot(centre[:, 0], centre[:, 1]), -0.15, 0.03))


def spiral(points: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Barber-pole bands round the z axis, for the pillar."""
    angle = np.arctan2(points[:, 1], points[:, 0])
    bands = step(np.sin(2 * angle + points[:, 2] * 9.0), 0.0, 0.35)
    color = mix(rgb("b5573a"), rgb("e2d3b0"), bands)
    color = mix(color, rgb("3b5a64"), step(-np.abs(np.abs(points[:, 2]) - 0.62), -0.07, 0.02))
    return color * (0.84 + 0.3 * cloudy(points * 7.0, 71))[:, None]


def planks(points: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """A wooden crate of half edge 0.28: boards, a darker frame and dark gaps."""
    u, v = face_coordinates(points, normals, 0.28)
    board = np.floor((v + 1) * 2.0)
    key = np.concatenate([board[:, None], np.round(normals)], axis=-1)
    wood = mix(rgb("a8763e"), rgb("d0a468"), hashed(key, 81)) * (0.8 + 0.4 * cloudy(points * 8.0, 83))[:, None]
    wood = mix(wood, rgb("4a3018"), step(np.abs((v + 1) * 2.0 - board - 0.5), 0.44, 0.08))
    frame = step(np.maximum(np.abs(u), np.abs(v)), 0.78, 0.05) + step(-np.abs(u - v), -0.16, 0.06)
    return mix(wood, rgb("6b4422") * 1.05, np.clip(frame, 0, 1))


def marble(points: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Pale stone with broad dark veins, for the plinth."""
    warp = cloudy(points * 3.0, 91) * 5.0
    veins = np.abs(np.sin(points @ np.array([5.0, 3.0, 6.0]) + warp))
    return mix(rgb("4f5b5a"), rgb("d9d6cc"), step(veins, 0.3, 0.5)) * (0.92 + 0.14 * noise(points * 9.0, 93))[:, None]


def sculpture(points: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Clearly different colours in each direction round the z axis, so that a rotation shows."""
    angle = np.arctan2(points[:, 1], points[:, 0])
    palette = np.stack([rgb(code) for code in ("d9483b", "f0c23c", "2e7f8c", "f1ead8", "47568f", "7fae4e")])
    sector = (angle / (2 * np.pi) + 0.5) * 6
    here = np.floor(sector).astype(np.int64) % 6
    color = mix(palette[here - 1], palette[here], step(sector - np.floor(sector), 0.06, 0.12))
    rings = step(np.sin(points[:, 2] * 32.0), 0.25, 0.6)
    color = mix(color, color * 0.62, 0.7 * rings)
    return color * (0.88 + 0.22 * cloudy(points * 10.0, 97))[:, None]


def beach_ball(points: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Six coloured segments and white caps on a sphere."""
    palette = np.stack([rgb(code) for code in ("e8402c", "f6e9d2", "2468b4", "f2bd2e", "f4efe2", "2f9a58")])
    sector = (np.arctan2(points[:, 1], points[:, 0]) / (2 * np.pi) + 0.5) * 6
    here = np.floor(sector).astype(np.int64) % 6
    color = mix(palette[here - 1], palette[here], step(sector - np.floor(sector), 0.04, 0.08))
    return mix(color, rgb("fbf7ee"), step(np.abs(normals[:, 2]), 0.9, 0.05))


def gift(points: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """A parcel of half edge 0.24: dots on blue paper, a broad ribbon over the middle of each face."""
    u, v = face_coordinates(points, normals, 0.24)
    cell = np.stack([u, v], -1) * 1.9
    centre = cell - np.floor(cell) - 0.5
    paper = mix(rgb("1f5f9e"), rgb("f3efe4"), step(-np.hypot(centre[:, 0], centre[:, 1]), -0.27, 0.1))
    ribbon = step(-np.abs(u), -0.2, 0.06) + step(-np.abs(v), -0.2, 0.06)
    paper = mix(paper, rgb("e2a81e"), np.clip(ribbon, 0, 1))
    return paper * (0.9 + 0.2 * cloudy(points * 8.0, 101))[:, None]


def face_coordinates(points: np.ndarray, normals: np.ndarray, half: float) -> tuple[np.ndarray, np.ndarray]:
    """Position on the face of a cube of this half edge, each in -1..1; v is upright on the sides."""
    axis = np.abs(normals).argmax(-1)
    u = np.where(axis == 0, points[:, 1], points[:, 0]) / half
    v = np.where(axis == 2, points[:, 1], points[:, 2]) / half
    return u, v
