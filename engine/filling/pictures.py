"""The pictures that holes are found in: what a camera sees of the scene before and after something is taken away."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
import torch

from engine.backends.backend import Backend
from engine.editing.selection.seen_from import SeenFrom
from engine.filling.masks import labelled
from engine.images.image_filters import dilate
from engine.model.host_array import host_array
from engine.raster.gaussians import Gaussians
from engine.raster.rasterize import rasterize

MIN_SHARE = 0.3
"""A pixel shows what is taken away where so much of it is made of it."""
HALF = 0.5
"""A pixel with less coverage shows a hole."""
COVERED = 0.8
"""A pixel with more coverage shows a surface, whose depth and colour can be relied on."""
DEPTH_TOLERANCE = 0.03
"""Surfaces whose depths differ by less than this share are the same."""
MIN_HOLE_PX = 4
"""Smaller holes are noise of the training, as they are everywhere."""
RING_PX = 3
"""Width of what counts as the surroundings of a hole."""
SURROUNDED = 0.7
"""Share of its surroundings that show a surface: else it is a part of something that is dark, or was hardly trained."""

_AROUND: Any = np.ones((3, 3), np.uint8)
"""Depths are uncertain by a pixel where one thing ends before another."""


@dataclass(frozen=True, slots=True, eq=False)
class DepthPicture:
    """A picture of Gaussians.

    Attributes:
        image: [H, W, 3] float32
        alpha: Coverage. [H, W] float32
        depth: 0 where there is nothing. [H, W] float32
    """

    image: np.ndarray
    alpha: np.ndarray
    depth: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class Taken:
    """A camera's view of a moment.

    Attributes:
        view: Of the camera.
        before: Everything.
        after: What stands still, without what is taken away.
        is_open: Pixels that showed what is taken away. [H, W] bool
        is_still: Those of them that showed the part of it that stands still. [H, W] bool
    """

    view: SeenFrom
    before: DepthPicture
    after: DepthPicture
    is_open: np.ndarray
    is_still: np.ndarray


def draw(gaussians: Gaussians, view: SeenFrom, backend: Backend) -> DepthPicture:
    """Draw Gaussians over black."""
    found = rasterize(
        gaussians,
        gaussians.means.new_tensor(view.world_to_camera)[None],
        gaussians.means.new_tensor(view.K)[None],
        view.width,
        view.height,
        backend=backend,
        near_plane=view.near,
        want_depth=True,
    )
    depth = found.expected_depth
    assert depth is not None
    return DepthPicture(host_array(found.image[0]), host_array(found.alpha[0, ..., 0]), host_array(depth[0, ..., 0]))


def taken_away(before: Gaussians, is_gone: np.ndarray, n_still: int, view: SeenFrom, backend: Backend) -> Taken:
    """What a camera sees when some of the Gaussians are taken away.

    Args:
        before: All of a moment, those that stand still first.
        is_gone: [N] bool
        n_still: So many stand still.
        view: Of the camera.
        backend: Draws.
    """
    gone = torch.from_numpy(is_gone).to(before.means.device)
    is_still = torch.arange(len(gone), device=gone.device) < n_still
    marks = torch.stack([gone, gone & is_still, gone], dim=1).to(before.colors)
    shares = draw(replace(before, colors=marks), view, backend).image
    after = draw(before[is_still & ~gone], view, backend)
    return Taken(view, draw(before, view, backend), after, shares[..., 0] > MIN_SHARE, shares[..., 1] > MIN_SHARE)


def points_at(view: SeenFrom, depth: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """The points that pixels of a mask show, in the order of rows. depth: [H, W]; mask: [H, W] bool; [n, 3] float64"""
    ys, xs = mask.nonzero()
    pixels = np.stack([xs + 0.5, ys + 0.5, np.ones(len(xs))], axis=1)
    in_camera = pixels @ np.linalg.inv(view.K).T * depth[mask][:, None]
    rotation, shift = view.world_to_camera[:3, :3], view.world_to_camera[:3, 3]
    return (in_camera - shift) @ rotation


def pixels_of(view: SeenFrom, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Where points [n, 3] appear.

    Returns:
        Rows and columns of their pixels [n] int64 each, inside the picture; and their depth [n], NaN for points outside
        of the picture.
    """
    in_camera = points @ view.world_to_camera[:3, :3].T + view.world_to_camera[:3, 3]
    depth = in_camera[:, 2]
    is_ahead = depth > view.near
    flat = in_camera @ view.K.T
    x, y = (np.where(is_ahead, flat[:, i] / np.where(is_ahead, depth, 1.0), -1.0) for i in (0, 1))
    is_inside = is_ahead & (x >= 0) & (y >= 0) & (x < view.width) & (y < view.height)
    rows, columns = (np.where(is_inside, value, 0.0).astype(np.int64) for value in (y, x))
    return rows, columns, np.where(is_inside, depth, np.nan)


def seen_by_any(points: np.ndarray, pictures: Sequence[Taken]) -> np.ndarray:
    """Which points [n, 3] some camera sees while nothing is taken away: nothing stands before them. [n] bool"""
    found = np.zeros(len(points), bool)
    for one in pictures:
        rows, columns, depth = pixels_of(one.view, points)
        drawn = one.before
        front = cv2.dilate(np.where(drawn.alpha < HALF, np.float32(np.inf), drawn.depth), _AROUND)[rows, columns]
        found |= depth * (1.0 - DEPTH_TOLERANCE) <= front  # NaN compares as False
    return found


def holes_of(pictures: Sequence[Taken]) -> list[np.ndarray]:
    """Pixels of each picture in which something that always stood still is taken away, and that now show nothing, or a
    surface that no camera ever saw. [H, W] bool

    What is behind something that moves was seen at other moments and trained; what shows nothing there is dark, as is
    what is around it.
    """
    always: dict[int, np.ndarray] = {}
    for one in pictures:
        always[id(one.view)] = always.get(id(one.view), True) & one.is_still
    return [_surrounded(_holes_of(one, always[id(one.view)], pictures), one.after.alpha) for one in pictures]


def _holes_of(one: Taken, is_always: np.ndarray, pictures: Sequence[Taken]) -> np.ndarray:
    is_hole = is_always & (one.after.alpha < HALF)
    is_asked = is_always & ~is_hole
    points = points_at(one.view, one.after.depth.astype(np.float64), is_asked)
    is_hole[is_asked] = ~seen_by_any(points, pictures)
    return is_hole


def _surrounded(is_hole: np.ndarray, alpha: np.ndarray) -> np.ndarray:
    """Holes large enough, most of whose surroundings show a surface. [H, W] bool"""
    parts, n = labelled(is_hole)
    kept = np.zeros(n + 1, bool)
    for number in range(1, n + 1):
        ys, xs = (parts == number).nonzero()
        rows, columns = (slice(max(int(v.min()) - RING_PX, 0), int(v.max()) + 1 + RING_PX) for v in (ys, xs))
        is_part = parts[rows, columns] == number
        is_ring = dilate(is_part, RING_PX) & ~is_hole[rows, columns]
        is_large = is_part.sum() >= MIN_HOLE_PX and is_ring.any()
        kept[number] = is_large and (alpha[rows, columns][is_ring] >= COVERED).mean() >= SURROUNDED
    return kept[parts]
