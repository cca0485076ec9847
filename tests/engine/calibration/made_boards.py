"""Boards that move in front of known cameras: what the cameras see of them, as sightings and as pictures."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from app.lab.synthetic.rigs import looking_at
from app.lab.synthetic.writing import write_video
from engine.calibration.boards.board import Board, charuco_board
from engine.calibration.boards.detection import BoardView
from engine.calibration.solving.cameras import Cameras, rotation_of

SIZE = (960, 720)
BOARD = Board(7, 5, 0.06, 0.045, "4X4_50")
PX_PER_SQUARE = 96
MARGIN = 0.5
"""Of white around a printed board, in squares."""
BACKGROUND, NOISE_LEVELS = 110, 3.0
MAX_TILT = 0.3
"""Least cosine between a board and a ray at which its markers are read."""


def ring(
    n_cameras: int,
    *,
    lens: Sequence[float] = (-0.12, 0.03, 0.001, -0.0005),
    size: tuple[int, int] = SIZE,
    seed: int = 0,
) -> Cameras:
    """Cameras around a place of 1.6 m radius, each with another lens; half of them face the other half."""
    generator = np.random.default_rng(seed)
    angles = 2 * np.pi * np.arange(n_cameras) / n_cameras
    centers = np.stack([1.6 * np.cos(angles), 1.6 * np.sin(angles), 1.3 + 0.4 * (np.arange(n_cameras) % 2)], axis=-1)
    poses = np.array([looking_at(center, np.array([0, 0, 0.9])) for center in centers])
    return Cameras(
        "opencv",
        poses[:, :3, :3],
        poses[:, :3, 3],
        760 / SIZE[0] * size[0] * generator.uniform(0.95, 1.05, n_cameras),
        np.exp(generator.normal(0, 0.002, n_cameras)),
        np.array(size) / 2 + generator.normal(0, 6 / SIZE[0] * size[0], (n_cameras, 2)),
        np.tile(lens, (n_cameras, 1)) * generator.uniform(0.8, 1.2, (n_cameras, 1)),
    )


def held_boards(
    n_moments: int, *, board: Board = BOARD, late: float = 0.0, reach: float = 0.35
) -> tuple[np.ndarray, np.ndarray]:
    """A board that somebody carries around and shows to all sides: rotations and translations to the world.

    Args:
        n_moments: In which it is turned around two times and a half.
        board: Which.
        late: In moments.
        reach: How far it is carried from the middle, m.
    Returns:
        [B, 3, 3], [B, 3]
    """
    turn = 2 * np.pi * 2.5 * (np.arange(n_moments) - late) / (n_moments - 1)
    outward = np.stack([np.cos(turn), np.sin(turn), 0.35 + 0.5 * np.sin(1.7 * turn)], axis=-1)
    outward /= np.linalg.norm(outward, axis=-1, keepdims=True)
    rotations = []
    for face in outward:
        x = np.cross([0, 0, 1.0], face)
        x /= np.linalg.norm(x)
        rotations.append(np.stack([x, -np.cross(face, x), -face], axis=-1))
    tilts = rotation_of(0.4 * np.sin(turn[:, None] * [1.9, 1.3, 2.3] + np.arange(3.0)))
    ways = np.stack([np.cos(1.3 * turn), np.sin(0.7 * turn), np.sin(1.1 * turn)], axis=-1)
    middles = [0, 0, 0.9] + reach * ways
    turned = tilts @ np.array(rotations)
    middle = board.corners.mean(0)
    return turned, middles - turned @ middle


def views_of(
    cameras: Cameras, rotations: np.ndarray, translations: np.ndarray, *, noise_px: float = 0.08, seed: int = 2
) -> list[dict[int, BoardView]]:
    """What cameras see of the front of a board, with noise; views that are cut off by the picture's edge in part."""
    generator = np.random.default_rng(seed)
    moments: list[dict[int, BoardView]] = []
    for rotation, translation in zip(rotations, translations, strict=True):
        points, moment = BOARD.corners @ rotation.T + translation, {}
        for row in range(len(cameras)):
            pixels, depths = cameras.pixels(np.full(len(points), row), points)
            to_camera = cameras.centers[row] - points.mean(0)
            is_front = -rotation[:, 2] @ to_camera > MAX_TILT * np.linalg.norm(to_camera)
            is_seen = (depths > 0.1) & (pixels > 4).all(1) & (pixels < np.array(SIZE) - 4).all(1)
            if is_front and is_seen.sum() >= 8:
                rows = np.flatnonzero(is_seen)
                moment[row] = BoardView(rows, pixels[rows] + generator.normal(0, noise_px, (len(rows), 2)))
        moments.append(moment)
    return moments


def film_board(folder: Path, cameras: Cameras, board: Board, size: tuple[int, int], n_frames: int) -> None:
    """Videos cam0.mp4 and so on of a board that is carried through the scene."""
    places = list(zip(*held_boards(n_frames, board=board, reach=0.5), strict=True))
    for row in range(len(cameras)):
        pictures = BoardPictures(cameras, row, board, size)
        frames = (pictures.picture(*place, seed=number) for number, place in enumerate(places))
        write_video(folder / f"cam{row}.mp4", frames, fps=30, crf=16)


class BoardPictures:
    """Pictures of one camera.

    Args:
        cameras: Known ones.
        row: Which of them.
        board: The printed board.
        size: Of the pictures.
    """

    def __init__(self, cameras: Cameras, row: int, board: Board = BOARD, size: tuple[int, int] = SIZE) -> None:
        self._cameras, self._row, self._board, self._size = cameras, row, board, size
        width, height = size
        x, y = np.meshgrid((np.arange(2 * width) + 0.5) / 2, (np.arange(2 * height) + 0.5) / 2)
        plane = cameras.plane(row, np.stack([x.reshape(-1), y.reshape(-1)], axis=-1))
        self._rays = np.concatenate([plane, np.ones((len(plane), 1))], axis=1).reshape(2 * height, 2 * width, 3)
        size = (board.columns * PX_PER_SQUARE, board.rows * PX_PER_SQUARE)
        printed = charuco_board(board).generateImage(size)
        margin = round(MARGIN * PX_PER_SQUARE)
        self._printed = np.pad(printed, margin, constant_values=255)

    def picture(self, rotation: np.ndarray, translation: np.ndarray, *, seed: int = 0) -> np.ndarray:
        """The board in front of grey, blurred a little, with noise. [H, W, 3] uint8"""
        turn = self._cameras.rotations[self._row] @ rotation
        shift = self._cameras.rotations[self._row] @ translation + self._cameras.translations[self._row]
        width, height = self._size
        coarse = np.full((height, width), BACKGROUND, dtype=np.float32)
        x0, y0, x1, y1 = self._box(turn, shift)
        if x1 > x0 and y1 > y0 and turn[:, 2] @ shift > 0:
            rays = self._rays[2 * y0 : 2 * y1, 2 * x0 : 2 * x1]
            on_board = rays @ np.linalg.inv(np.column_stack([turn[:, 0], turn[:, 1], shift])).T
            scale = PX_PER_SQUARE / self._board.square_m
            places = on_board[..., :2] / on_board[..., 2:] * scale + MARGIN * PX_PER_SQUARE - 0.5
            grid = np.clip(places, -1e4, 1e4).astype(np.float32)
            fine = cv2.remap(
                self._printed,
                grid[..., 0],
                grid[..., 1],
                cv2.INTER_AREA,
                borderMode=cv2.BORDER_CONSTANT,
                borderValue=(BACKGROUND,),
            )
            coarse[y0:y1, x0:x1] = fine.reshape(y1 - y0, 2, x1 - x0, 2).mean((1, 3))
        blurred = 20 + 0.8 * cv2.GaussianBlur(coarse, (0, 0), 0.7)
        noisy = blurred + NOISE_LEVELS * np.random.default_rng(seed).standard_normal(coarse.shape, dtype=np.float32)
        return np.repeat(np.clip(noisy, 0, 255).astype(np.uint8)[..., None], 3, axis=-1)

    def _box(self, turn: np.ndarray, shift: np.ndarray) -> tuple[int, int, int, int]:
        """Left, top, right and bottom of what the board can cover; all of the picture where it is behind in part."""
        width, height = self._size
        across, along = np.meshgrid(
            *(np.linspace(-MARGIN, n + MARGIN, 9) for n in (self._board.columns, self._board.rows))
        )
        sheet = np.stack([across.reshape(-1), along.reshape(-1), np.zeros(81)], axis=-1) * self._board.square_m
        at_camera = sheet @ turn.T + shift
        if at_camera[:, 2].min() < 0.05:
            return 0, 0, width, height
        world = (at_camera - self._cameras.translations[self._row]) @ self._cameras.rotations[self._row]
        pixels, _ = self._cameras.pixels(np.full(81, self._row), world)
        low, high = np.floor(pixels.min(0)).astype(int) - 4, np.ceil(pixels.max(0)).astype(int) + 4
        return max(low[0], 0), max(low[1], 0), min(high[0], width), min(high[1], height)
