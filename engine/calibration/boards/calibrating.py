"""From videos of a board to calibrated cameras in metres, in the process that calibrates."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from engine.calibration.boards.board import Board
from engine.calibration.boards.filmed import board_views, frames_to_look_at
from engine.calibration.boards.solution import REACH_PX, BoardSolution, solve_boards
from engine.calibration.calibrated import CalibratedRig, Calibration, MissingCamera
from engine.calibration.finishing import lenses, matrices, medians, poses
from engine.calibration.options import WHAT_TO_FILM, CalibrationOptions
from engine.calibration.solving.bundle import RigidPlaces
from engine.calibration.solving.cameras import Cameras
from engine.calibration.solving.world import find_up, upright
from engine.calibration.videos import PlainVideo, common_length
from engine.camera.rig import CameraRig
from engine.errors import PreparationError

CONTRADICTS = 3.0
"""A camera whose corners miss by so many times what they miss alone, and by CONTRADICTS_PX, does not fit the others."""
CONTRADICTS_PX = 1.0
"""At a width of 1,000 pixels."""
MIN_OFFSET, MIN_MOTION_PX = 0.1, 0.5
"""In frames, and in pixels per frame: where a board moves less unevenly, nothing about time is said."""
MAX_DOUBTFUL = 0.5
FLAT_DEG, STILL_SHARE, MIN_STILL = 20.0, 0.02, 3
"""A board lies on the floor if it is level within FLAT_DEG, and lies in one place, within a share of how far cameras
are away, in at least so many moments."""


@dataclass(frozen=True, slots=True)
class BoardProgress:
    """Where progress goes: both are called with shares. looked: Of a camera, since the last call; solved: Of all."""

    looked: Callable[[float], None]
    solved: Callable[[float], None]


def calibrate_by_board(
    videos: list[PlainVideo], board: Board, options: CalibrationOptions, progress: BoardProgress
) -> Calibration:
    """All of it.

    Raises:
        CaptureError: Frames cannot be decoded.
        PreparationError: No two cameras could be placed; says why.
    """
    frames = frames_to_look_at(common_length(videos))
    views = board_views(videos, board, frames, progress.looked)
    sizes = np.array([video.size for video in videos], dtype=np.int64)
    solution = solve_boards(views, board.corners, sizes, options.lens, progress.solved)
    if isinstance(solution, str):
        said = re.sub(r"\{(\d+)\}", lambda found: videos[int(found[1])].name, solution)
        raise PreparationError(f"No two cameras could be placed: {said}.", hint=WHAT_TO_FILM)
    return _finished(solution, videos, np.array(frames), sizes, options)


def _finished(
    solution: BoardSolution,
    videos: list[PlainVideo],
    frames: np.ndarray,
    sizes: np.ndarray,
    options: CalibrationOptions,
) -> Calibration:
    rows, names = solution.rows, [videos[row].name for row in solution.rows]
    n = len(rows)
    reach_px = REACH_PX * sizes[rows].max(1) / 1000
    is_near = solution.errors <= reach_px[solution.seen.cameras]
    errors_px = medians(solution.errors, solution.seen.cameras, n)
    doubts = _doubts(solution, frames, sizes[rows], errors_px)
    up, origin, up_from = _up(solution.cameras, solution.places, options.up)
    cameras, points = upright(solution.cameras, solution.places.points, up, origin, 1.0)
    n_seen = np.bincount(solution.seen.cameras, minlength=n)
    n_points = len(points)
    near = solution.seen.chosen(is_near)
    is_seen = np.bincount(near.points, minlength=n_points) > 0
    means = np.bincount(near.points, solution.errors[is_near], minlength=n_points)
    means /= np.maximum(np.bincount(near.points, minlength=n_points), 1)
    found = CalibratedRig(
        rig=CameraRig(tuple(names), poses(cameras), matrices(cameras, np.ones((n, 1))), sizes[rows]),
        lenses=lenses(cameras),
        points=points[is_seen],
        point_errors_px=means[is_seen],
        camera_errors_px=errors_px,
        n_sightings=np.bincount(near.cameras, minlength=n),
        explained_shares=np.bincount(near.cameras, minlength=n) / np.maximum(n_seen, 1),
        doubts=tuple(doubts),
        is_metric=True,
        up=up_from,
        board_frames=solution.n_views[rows],
    )
    absent = [row for row in range(len(videos)) if row not in set(rows.tolist())]
    missing = tuple(_missing(row, solution, videos) for row in absent)
    n_doubtful = sum(map(bool, doubts))
    failure = ""
    if n - n_doubtful < 2 or n_doubtful > MAX_DOUBTFUL * n:
        failure = f"{n_doubtful} of {n} cameras contradict each other about the board, so none of them can be trusted."
    return Calibration(found, missing, (), failure)


def _doubts(solution: BoardSolution, frames: np.ndarray, sizes: np.ndarray, errors_px: np.ndarray) -> list[str]:
    """Why each camera cannot be trusted; empty where nothing speaks against it."""
    doubts = []
    least = CONTRADICTS_PX * sizes.max(1) / 1000
    for row, (error, own) in enumerate(zip(errors_px, solution.own_errors_px, strict=True)):
        if error <= max(CONTRADICTS * own, least[row]):
            doubts.append("")
            continue
        late = _frames_late(solution, frames, row)
        said = (
            f"its pictures seem to come {'late' if late > 0 else 'early'}; synchronise the videos"
            if abs(late) >= MIN_OFFSET
            else "it moved, or its frames were not taken at the same time as those of the others"
        )
        doubts.append(f"the board lies {error:.1f} px from where the others see it, {own:.1f} px alone: {said}")
    return doubts


def _frames_late(solution: BoardSolution, frames: np.ndarray, row: int) -> float:
    """Frames by which a camera shows the board later than others do, by boards that move; 0 where none does.

    A camera that is late shows where the board was: its sightings lie behind by the way it goes in that time. What is
    common to all of them says nothing, since it has turned the camera. Too little by half and more, since the camera's
    own sightings have pulled the board.
    """
    seen, n_corners = solution.seen, len(solution.places.corners)
    place_of = {int(frames[moment]): place for place, moment in enumerate(solution.moments)}
    rows = np.flatnonzero(seen.cameras == row)
    place = seen.points[rows] // n_corners
    frame = frames[solution.moments[place]]
    following = np.array([place_of.get(int(one) + 1, -1) for one in frame])
    previous = np.array([place_of.get(int(one) - 1, -1) for one in frame])
    ahead, behind = np.where(following >= 0, following, place), np.where(previous >= 0, previous, place)
    span = (following >= 0).astype(int) + (previous >= 0)
    rows, ahead, behind, span = (values[span > 0] for values in (rows, ahead, behind, span))
    if not len(rows):
        return 0.0
    points, corner, camera = solution.places.points, seen.points[rows] % n_corners, np.full(len(rows), row)
    at = [solution.cameras.pixels(camera, points[place * n_corners + corner])[0] for place in (ahead, behind)]
    motion = (at[0] - at[1]) / span[:, None]
    off = seen.pixels[rows] - solution.cameras.pixels(camera, points[seen.points[rows]])[0]
    is_near = np.linalg.norm(off, axis=-1) < 10 * np.median(np.linalg.norm(off, axis=-1))
    off, motion = (values[is_near] - np.median(values[is_near], axis=0) for values in (off, motion))
    squares = float((motion**2).sum())
    if squares < len(motion) * MIN_MOTION_PX**2:
        return 0.0
    return -float((off * motion).sum()) / squares


def _up(cameras: Cameras, places: RigidPlaces, way: str) -> tuple[np.ndarray, np.ndarray, str]:
    """Up, a point at height 0, and their source: a board that lies on the floor, else the cameras."""
    up, middle, _ = find_up(cameras, places.points, "cameras")
    if way != "floor":
        return up, middle, "cameras"
    normals = -places.rotations[:, :, 2]  # out of the printed side
    middles = places.points.reshape(len(normals), -1, 3).mean(1)
    heights = middles @ up
    tolerance = STILL_SHARE * float(np.median(np.linalg.norm(cameras.centers - middle, axis=-1)))
    is_level = normals @ up > np.cos(np.radians(FLAT_DEG))
    for lowest in np.argsort(heights):
        if not is_level[lowest]:
            continue
        is_same = is_level & (np.linalg.norm(middles - middles[lowest], axis=-1) < tolerance)
        if is_same.sum() >= MIN_STILL and heights[lowest] <= heights.min() + 3 * tolerance:
            normal = np.median(normals[is_same], axis=0)
            normal /= np.linalg.norm(normal)
            on_floor = np.median(middles[is_same], axis=0)
            return normal, middle - ((middle - on_floor) @ normal) * normal, "board"
    return up, middle, "cameras"


def _missing(row: int, solution: BoardSolution, videos: list[PlainVideo]) -> MissingCamera:
    reason = solution.unusable.get(row, "")
    common = solution.n_common[row].copy()
    nearest, n = int(common.argmax()), int(common.max())
    if not reason:
        reason = (
            f"the board was found in {solution.n_views[row]} pictures of it, but not at the same time as in those of "
            "another camera, or in fewer than 4 of them"
            if not n
            else f"it shares the board with {videos[nearest].name} only, and not with the others"
        )
    return MissingCamera(videos[row].name, reason, videos[nearest].name if n else "", n)
