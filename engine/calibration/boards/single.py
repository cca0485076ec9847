"""One camera and a board: its lens, and how the board is held in each view."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from engine.calibration.boards.detection import BoardView
from engine.calibration.solving.bundle import Expectations, Observations, RigidPlaces, adjust, errors_px
from engine.calibration.solving.cameras import N_LENS, Cameras, with_lens
from engine.calibration.solving.mapping import focals_to_try

N_FIRST_VIEWS, MAX_VIEWS = 10, 40
"""For the first estimate of one camera's lens, from several focal lengths, and for the second."""
EXPECTED = Expectations(principal=0.03, focal=1.0, aspect=0.01, lens=0.5)
"""Weak: boards say nearly all of it. They keep lenses sane where a board fills the middle of the picture only."""
N_ITERATIONS = 20


@dataclass(frozen=True, slots=True)
class SingleCamera:
    """One camera at the origin, as its own views of the board have it.

    Attributes:
        camera: Its lens.
        error_px: Median over all views, each held as fits it best; infinite where many cannot be held.
        square_px: Mean square of what is not far off.
        n: Corners seen.
    """

    camera: Cameras
    error_px: float
    square_px: float
    n: int


def lens_of(views: Sequence[BoardView], corners: np.ndarray, size: tuple[int, int], lens: str) -> SingleCamera | None:
    """Focal length, principal point and lens of one camera.

    Args:
        views: Of this camera, at least three.
        corners: Of the board. [K, 3]
        size: Width and height of its pictures.
        lens: One of N_LENS.
    Returns:
        None where no focal length makes the views fit.
    """
    few = _unlike(views, N_FIRST_VIEWS)
    first: SingleCamera | None = None
    for focal in (*focals_to_try(lens), *(() if lens == "fisheye" else (2.5,))):
        found = _judged(_adjusted(few, corners, _at_origin(lens, focal * max(size), size), size), few, corners)
        if first is None or found.error_px < first.error_px:
            first = found
    if first is None or not np.isfinite(first.error_px):
        return None
    return refined(first, views, corners, size, lens)


def refined(
    found: SingleCamera, views: Sequence[BoardView], corners: np.ndarray, size: tuple[int, int], lens: str
) -> SingleCamera:
    """The same with more views, and another lens that begins with the same numbers."""
    camera, more = with_lens(found.camera, lens), _unlike(views, MAX_VIEWS)
    for _ in range(2):  # the second time with poses of the lens that was found
        camera = _adjusted(more, corners, camera, size)
    return _judged(camera, views, corners)


def pose_of(
    view: BoardView, corners: np.ndarray, cameras: Cameras, row: int = 0
) -> tuple[np.ndarray, np.ndarray] | None:
    """From the board to a camera: rotation [3, 3] and translation [3], by the plane of the board."""
    plane = cameras.plane(row, view.pixels)
    if not np.isfinite(plane).all() or np.abs(plane).max() > 50:
        return None
    seen = corners[view.corners]
    is_found, turn, shift = cv2.solvePnP(seen, plane, np.eye(3), None, flags=cv2.SOLVEPNP_IPPE)
    if not is_found:
        return None
    turn, shift = cv2.solvePnPRefineLM(seen, plane, np.eye(3), None, turn, shift)
    rotation, translation = cv2.Rodrigues(turn)[0], shift.reshape(3)
    if not (np.isfinite(rotation).all() and np.isfinite(translation).all()) or translation[2] <= 0:
        return None
    return rotation, translation


def _at_origin(lens: str, focal: float, size: tuple[int, int]) -> Cameras:
    return Cameras(
        lens,
        np.eye(3)[None],
        np.zeros((1, 3)),
        np.array([focal]),
        np.ones(1),
        np.array([size]) / 2.0,
        np.zeros((1, N_LENS[lens])),
    )


def _adjusted(views, corners, camera: Cameras, size) -> Cameras:
    held = [(view, place) for view in views if (place := pose_of(view, corners, camera)) is not None]
    if len(held) < 3:
        return camera
    shape = RigidPlaces(corners, *(np.array([place[part] for _, place in held]) for part in (0, 1)))
    seen = sightings([(0, number, view) for number, (view, _) in enumerate(held)], len(corners))
    middles, widths = np.array([size]) / 2.0, np.array([float(size[0])])
    found, _ = adjust(camera, shape, seen, middles=middles, widths=widths, expect=EXPECTED, n_iterations=N_ITERATIONS)
    return replace(found, rotations=camera.rotations, translations=camera.translations)


def _judged(camera: Cameras, views: Sequence[BoardView], corners: np.ndarray) -> SingleCamera:
    errors = []
    for view in views:
        place = pose_of(view, corners, camera)
        if place is None:
            errors.append(np.full(len(view.corners), np.inf))
            continue
        points = corners[view.corners] @ place[0].T + place[1]
        rows = np.arange(len(points))
        errors.append(errors_px(camera, points, Observations(rows * 0, rows, view.pixels)))
    of_all = np.concatenate(errors)
    error = float(np.median(of_all))
    return SingleCamera(camera, error, float(np.mean(np.minimum(of_all, 3 * error) ** 2)), len(of_all))


def sightings(views: Sequence[tuple[int, int, BoardView]], n_corners: int) -> Observations:
    """Sightings of camera, place and view."""
    return Observations(
        np.concatenate([np.full(len(view.corners), camera) for camera, _, view in views]),
        np.concatenate([place * n_corners + view.corners for _, place, view in views]),
        np.concatenate([view.pixels for _, _, view in views]),
    )


def _unlike(views: Sequence[BoardView], n: int) -> list[BoardView]:
    """At most n views, each as different from those chosen before as can be: in place and size."""
    if len(views) <= n:
        return list(views)
    table = np.array([[*view.pixels.mean(0), *(2 * view.pixels.std(0))] for view in views])
    chosen = [int(np.argmax([len(view.corners) for view in views]))]
    nearest = np.linalg.norm(table - table[chosen[0]], axis=-1)
    while len(chosen) < n:
        chosen.append(int(nearest.argmax()))
        nearest = np.minimum(nearest, np.linalg.norm(table - table[chosen[-1]], axis=-1))
    return [views[row] for row in sorted(chosen)]
