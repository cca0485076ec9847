"""The cloud of all frames of a clip on a small scene with a known truth: a textured wall and a board before it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, map_coordinates

from engine.camera.rig import CameraRig
from engine.cloud.kept_results import Arrays, do_now
from engine.cloud.stereo.frames_cloud import FRAME_SPACING_PX, FramesCloud, build_frames_cloud, merged_frames
from engine.errors import PreparationError

pytestmark = pytest.mark.slow

WIDTH, HEIGHT, FOCAL_PX = 64, 48, 64.0
WALL_Z, BOARD_Z, BOARD_HALF = 4.0, 2.6, 0.45
BOARD_X = (-0.6, 0.6)
"""Where the middle of the board is in either frame."""
SPACING = 0.1
TEXELS = 45.0
"""Of a texture, per scene unit."""
TOLERANCE = 0.04
"""Share of depth: one pixel of disparity between outer cameras is 1 % to 2 %."""


def make_rig() -> CameraRig:
    """Five cameras in two rows that look at a point between board and wall."""
    poses = []
    for x, y in ((-0.5, -0.25), (-0.25, 0.25), (0.0, -0.25), (0.25, 0.25), (0.5, -0.25)):
        center = np.array([x, y, 0.0])
        forward = np.array([0.0, 0.0, 3.2]) - center
        forward /= np.linalg.norm(forward)
        right = np.cross([0.0, 1.0, 0.0], forward)
        right /= np.linalg.norm(right)
        rotation = np.stack([right, np.cross(forward, right), forward])
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = rotation, -rotation @ center
        poses.append(pose)
    K = np.array([[FOCAL_PX, 0.0, WIDTH / 2], [0.0, FOCAL_PX, HEIGHT / 2], [0.0, 0.0, 1.0]])
    n = len(poses)
    names = tuple(f"cam{row}" for row in range(n))
    return CameraRig(names, np.stack(poses), np.repeat(K[None], n, axis=0), np.tile([[WIDTH, HEIGHT]], (n, 1)))


def texture(seed: int) -> np.ndarray:
    """A random picture whose blobs are about three pixels of a camera wide. [256, 256, 3]"""
    noise = np.random.default_rng(seed).normal(size=(256, 256, 3))
    smooth = gaussian_filter(noise, (2.5, 2.5, 0), mode="wrap")
    return np.clip(128 + 45 * smooth / smooth.std(), 20, 235)


WALL, BOARD = texture(1), texture(2)


def draw(rig: CameraRig, row: int, board_x: float) -> np.ndarray:
    """One picture, four samples a pixel. [H, W, 3] uint8"""
    pixels = np.stack(np.meshgrid(np.arange(0.25, WIDTH, 0.5), np.arange(0.25, HEIGHT, 0.5)), axis=-1)
    rays = np.concatenate([(pixels - [WIDTH / 2, HEIGHT / 2]) / FOCAL_PX, np.ones((*pixels.shape[:2], 1))], axis=-1)
    rays = rays @ rig.world_to_camera[row, :3, :3]
    center = rig.centers[row]

    def look(surface: np.ndarray, z: float, x_offset: float) -> tuple[np.ndarray, np.ndarray]:
        points = center + rays * ((z - center[2]) / rays[..., 2:])
        places = np.stack([points[..., 1], points[..., 0] - x_offset]) * TEXELS + 128
        picture = np.stack([map_coordinates(surface[..., c], places, order=1, mode="wrap") for c in range(3)], axis=-1)
        return picture, (np.abs(points[..., :2] - [x_offset, 0.0]) < BOARD_HALF).all(-1)

    wall, _ = look(WALL, WALL_Z, 0.0)
    board, is_board = look(BOARD, BOARD_Z, board_x)
    fine = np.where(is_board[..., None], board, wall)
    return fine.reshape(HEIGHT, 2, WIDTH, 2, 3).mean((1, 3)).round().astype(np.uint8)


RIG = make_rig()
PICTURES = np.stack([[draw(RIG, row, x) for x in BOARD_X] for row in range(len(RIG))])
"""[C, M, H, W, 3]"""


KEPT: dict[str, Arrays] = {}


def keep_first(name: str, work: Callable[[], Arrays]) -> Arrays:
    """Depth maps of the first frame are made once for all tests. A `Keep`."""
    if "points" in name:
        return work()
    if name not in KEPT:
        KEPT[name] = work()
    return KEPT[name]


def build(**changed: object) -> FramesCloud:
    """The cloud of both frames, but for some arguments."""
    arguments = {"max_points": 20_000, "spacing": SPACING, "color": "off", "keep": keep_first} | changed
    arguments.setdefault("report", lambda line: None)
    frames = arguments.pop("frames", lambda row, frame_in_clip: PICTURES[row, frame_in_clip])
    n_frames, rig = arguments.pop("n_frames", 2), arguments.pop("rig", RIG)
    return build_frames_cloud(frames, n_frames, rig, **arguments)  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def cloud() -> FramesCloud:
    return build()


def near_board(points: np.ndarray, board_x: float) -> np.ndarray:
    """Points on the board at this place. bool [P]"""
    is_inside = np.abs(points[:, 0] - board_x) < BOARD_HALF
    return is_inside & (np.abs(points[:, 1]) < BOARD_HALF) & (np.abs(points[:, 2] / BOARD_Z - 1) < TOLERANCE)


def near_wall(points: np.ndarray) -> np.ndarray:
    """Points on the wall. bool [P]"""
    return np.abs(points[:, 2] / WALL_Z - 1) < TOLERANCE


def parts(cloud: FramesCloud) -> list[np.ndarray]:
    """The points that each frame added."""
    return np.split(cloud.points, np.cumsum(cloud.n_of_frames)[:-1])


def same(first: FramesCloud, second: FramesCloud) -> bool:
    names = ("points", "colors", "gains", "spacing", "n_of_frames")
    return all(np.array_equal(getattr(first, name), getattr(second, name)) for name in names)


def test_points_lie_on_the_surfaces(cloud: FramesCloud) -> None:
    first, second = parts(cloud)
    assert np.mean(near_wall(first) | near_board(first, BOARD_X[0])) > 0.9
    assert np.mean(near_wall(second) | near_board(second, BOARD_X[1])) > 0.8
    assert len(first) > 500


def test_what_moved_has_points_at_both_places(cloud: FramesCloud) -> None:
    first, second = parts(cloud)
    n_wanted = 0.4 * (2 * BOARD_HALF / cloud.spacing) ** 2
    assert near_board(first, BOARD_X[0]).sum() > n_wanted
    assert near_board(second, BOARD_X[1]).sum() > n_wanted
    assert near_board(first, BOARD_X[1]).sum() < 0.05 * n_wanted
    assert near_board(second, BOARD_X[0]).sum() < 0.05 * n_wanted


def test_the_wall_that_the_board_uncovers_is_added(cloud: FramesCloud) -> None:
    second = parts(cloud)[1]
    behind = near_wall(second) & (np.abs(second[:, 0] - BOARD_X[0] * WALL_Z / BOARD_Z) < BOARD_HALF)
    assert behind.sum() > 20


def test_shapes_types_and_report(cloud: FramesCloud) -> None:
    assert cloud.points.shape == cloud.colors.shape == (cloud.n_of_frames.sum(), 3)
    assert cloud.points.dtype == cloud.colors.dtype == cloud.gains.dtype == np.float32
    assert cloud.n_of_frames.dtype == np.int64
    assert np.isfinite(cloud.points).all()
    assert cloud.colors.min() >= 0
    assert cloud.colors.max() <= 1
    assert np.array_equal(cloud.gains, np.ones((len(RIG), 3)))
    lines: list[str] = []
    build(report=lines.append)
    assert [line.split(":")[0] for line in lines if line.startswith("Frame")] == ["Frame 0", "Frame 1", "Frames merged"]


def test_colors_are_those_of_the_surfaces(cloud: FramesCloud) -> None:
    first = parts(cloud)[0]
    is_board = near_board(first, BOARD_X[0])
    places = np.stack([first[is_board, 1], first[is_board, 0] - BOARD_X[0]]) * TEXELS + 128
    true = np.stack([map_coordinates(BOARD[..., c], places, order=1) for c in range(3)], axis=-1) / 255
    assert np.median(np.abs(cloud.colors[: len(first)][is_board] - true)) < 0.06


def test_first_frame_is_kept_and_later_ones_fill_empty_voxels() -> None:
    points = np.array(
        [[0.1, 0.1, 0.1], [1.2, 0.1, 0.1], [0.2, 0.3, 0.1], [0.9, 0.9, 0.9], [2.5, 0.5, 0.5], [2.6, 0.5, 0.5]]
    )
    frame_of = np.array([0, 0, 1, 1, 1, 2])
    merged, colors, n_of_frames = merged_frames(points, 10 * points, frame_of, 4, 1.0)
    assert np.allclose(merged, [[0.1, 0.1, 0.1], [1.2, 0.1, 0.1], [2.5, 0.5, 0.5]])
    assert np.allclose(colors, 10 * merged)
    assert n_of_frames.tolist() == [2, 1, 0, 0]


def test_every_voxel_has_one_point(cloud: FramesCloud) -> None:
    first = build(n_frames=1, spacing=cloud.spacing)
    assert np.array_equal(first.points, parts(cloud)[0])
    cells = np.floor(cloud.points.astype(np.float64) / cloud.spacing).astype(int)
    assert len(np.unique(cells, axis=0)) > 0.99 * len(cells)  # a float32 may lie on the other side of an edge


def test_spacing_is_used_as_given(cloud: FramesCloud) -> None:
    assert cloud.spacing == SPACING
    wide = build(spacing=3.1 * SPACING, max_points=8)
    assert wide.spacing == 3.1 * SPACING
    assert 8 < len(wide.points) < 0.3 * len(cloud.points)


def test_the_limit_is_met_by_larger_voxels() -> None:
    free = build(spacing=None)
    assert free.spacing == pytest.approx(FRAME_SPACING_PX * WALL_Z / FOCAL_PX, rel=0.1)
    few = build(spacing=None, max_points=len(free.points) // 2)
    assert 0.3 * len(free.points) < len(few.points) <= len(free.points) // 2
    assert few.spacing > free.spacing


def test_given_gains_are_kept_and_taken_out_of_colors(cloud: FramesCloud) -> None:
    gains = np.full((len(RIG), 3), 1.25)
    dark = build(gains=gains)
    assert np.array_equal(dark.gains, gains.astype(np.float32))
    assert np.array_equal(dark.points, cloud.points)
    assert np.median(cloud.colors / np.maximum(dark.colors, 1e-3)) == pytest.approx(1.25, abs=0.02)


def test_sparse_points_are_asked_for_once_in_the_first_frame() -> None:
    asked: list[np.ndarray] = []

    def find_sparse(pictures: np.ndarray, is_valid: np.ndarray | None) -> np.ndarray:
        asked.append(pictures)
        return np.zeros((0, 3))

    build(find_sparse=find_sparse, n_frames=1)
    assert len(asked) == 1
    assert np.array_equal(asked[0], PICTURES[:, 0])


def test_pixels_that_do_not_count_make_no_points(cloud: FramesCloud) -> None:
    is_valid = np.ones((len(RIG), HEIGHT, WIDTH), dtype=bool)
    is_valid[:, :, : WIDTH // 2] = False
    half = build(valid_in=lambda frame_in_clip: is_valid, keep=do_now)
    is_left = [(each.points[:, 0] < -0.8).sum() for each in (half, cloud)]
    assert is_left[0] < 0.3 * is_left[1]
    assert len(half.points) > 100


def keeper(kept: dict[str, Arrays], refuse_from: str = "") -> Callable[[str, Callable[[], Arrays]], Arrays]:
    """A `Keep` that remembers, and breaks down before a certain piece."""

    def keep(name: str, work: Callable[[], Arrays]) -> Arrays:
        if name not in kept:
            if refuse_from and name == refuse_from:
                raise KeyboardInterrupt
            kept[name] = work()
        return kept[name]

    return keep


def test_same_bits_again_and_after_going_on(cloud: FramesCloud) -> None:
    assert same(build(keep=do_now), cloud)
    kept: dict[str, Arrays] = {}
    with pytest.raises(KeyboardInterrupt):
        build(keep=keeper(kept, "frames: points of frame 1"))
    assert "frames: points of frame 0" in kept
    assert same(build(keep=keeper(kept)), cloud)
    names = set(kept)
    assert same(build(keep=keeper(kept)), cloud)
    assert set(kept) == names


def test_bad_input_is_refused() -> None:
    with pytest.raises(PreparationError, match="1 camera"):
        build(rig=RIG.subset([0]))
    with pytest.raises(PreparationError, match="without frames"):
        build(n_frames=0)
    nothing = np.zeros((len(RIG), HEIGHT, WIDTH), dtype=bool)
    with pytest.raises(PreparationError, match="No surface"):
        build(valid_in=lambda frame_in_clip: nothing, keep=do_now)
    with pytest.raises(ValueError, match="max_points"):
        build(max_points=7)
