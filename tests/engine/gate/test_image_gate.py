"""The gate from the pictures: walls of known light, seen by a few cameras, with noise."""

from collections.abc import Callable

import numpy as np
import pytest

from engine.camera.projection import pixel_rays
from engine.camera.rig import CameraRig
from engine.errors import ProjectError
from engine.gate.image_gate import GateTable, measure_gate
from engine.gate.reasons import ALONE, CHANGES, LIGHT, NEAR_MOTION, ONE_VIEW, STILL, UNSEEN
from engine.gate.regions import GateRegion, marked, parse_region

WIDTH, HEIGHT, FOCAL, DEPTH = 64, 48, 50.0, 4.0
N_CAMERAS, N_FRAMES, SPACING = 4, 6, 0.16
X, Y = np.meshgrid(np.arange(-1.0, 1.01, SPACING), np.arange(-0.8, 0.81, SPACING))
POINTS = np.stack([X.ravel(), Y.ravel(), np.full(X.size, DEPTH)], axis=1)
NOTHING = np.zeros((0, 3))
Light = Callable[[int, int, np.ndarray, np.ndarray], np.ndarray]
"""Camera, frame, x and y on the wall -> factor of the three channels. [..., 3] or [..., 1]"""


def cameras() -> CameraRig:
    poses = np.stack([np.eye(4)] * N_CAMERAS)
    poses[:, 0, 3] = -np.linspace(-0.6, 0.6, N_CAMERAS)
    K = np.array([[FOCAL, 0.0, WIDTH / 2], [0.0, FOCAL, HEIGHT / 2], [0.0, 0.0, 1.0]])
    sizes = np.full((N_CAMERAS, 2), (WIDTH, HEIGHT), dtype=np.int64)
    return CameraRig(tuple("abcd"), poses, np.stack([K] * N_CAMERAS), sizes)


def still(camera: int, frame: int, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return np.ones((*x.shape, 1))


def wall_pictures(light: Light, *, noise: float, is_flat: bool) -> tuple[np.ndarray, np.ndarray]:
    """Backgrounds [C, H, W, 3] and pictures [C, M, H, W, 3] of a wall under a light, uint8."""
    rng, rig = np.random.default_rng(3), cameras()
    rays = pixel_rays(rig.Ks[0], WIDTH, HEIGHT) * DEPTH
    backgrounds, pictures = [], []
    for camera in range(N_CAMERAS):
        x, y = rays[..., 0] - rig.world_to_camera[camera, 0, 3], rays[..., 1]
        waves = np.stack([np.sin(7 * x), np.sin(5 * y + 1), np.sin(4 * (x + y))], axis=-1)
        color = 120.0 + (0.0 if is_flat else 40.0) * waves
        frames = [color * light(camera, frame, x, y) for frame in range(N_FRAMES)]
        noisy = [frame + rng.normal(0.0, noise, frame.shape) for frame in (color, *frames)]
        pixels = np.clip(np.stack(noisy) + 0.5, 0, 255).astype(np.uint8)
        backgrounds.append(pixels[0])
        pictures.append(pixels[1:])
    return np.stack(backgrounds), np.stack(pictures)


def decide(
    light: Light,
    *,
    noise: float = 2.0,
    is_flat: bool = False,
    points: np.ndarray = POINTS,
    moving: np.ndarray = NOTHING,
) -> GateTable:
    backgrounds, pictures = wall_pictures(light, noise=noise, is_flat=is_flat)
    return measure_gate(
        lambda camera, frame: pictures[camera, frame],
        N_FRAMES,
        backgrounds,
        cameras(),
        points,
        spacing=SPACING,
        moving_points=moving,
        presence=np.ones((len(moving), N_FRAMES), dtype=bool),
        moving_spacing=SPACING,
    )


def in_spot(x: np.ndarray, y: np.ndarray, margin: float = 0.0) -> np.ndarray:
    return (np.abs(x) < 0.4 + margin) & (np.abs(y) < 0.35 + margin)


def lamp(camera: int, frame: int, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return np.where(in_spot(x, y) & (frame >= 2), 1.4, 1.0)[..., None]


def slow_shadow(camera: int, frame: int, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return (1.0 - 0.06 * frame * in_spot(x, y))[..., None]


@pytest.mark.parametrize("is_flat", [False, True], ids=["texture", "flat"])
@pytest.mark.parametrize("light", [lamp, slow_shadow])
def test_what_a_light_falls_on_is_dynamic_and_nothing_else(light, is_flat):
    table = decide(light, is_flat=is_flat)
    x, y = POINTS[:, 0], POINTS[:, 1]
    inside, outside = in_spot(x, y, -0.1), ~in_spot(x, y, 0.2)
    assert inside.sum() > 10
    assert outside.sum() > 50
    assert table.is_dynamic[inside].all()
    assert (table.reasons[inside] == LIGHT).all()
    assert (table.scores[inside] > 1.0).all()
    assert not table.is_dynamic[outside].any()
    assert (table.reasons[outside] == STILL).all()
    assert (table.scores[outside] < 1.0).all()


def test_another_colour_is_more_than_light():
    def painted(camera: int, frame: int, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.where((in_spot(x, y) & (frame % 2 == 1))[..., None], [1.5, 1.0, 0.6], [1.0, 1.0, 1.0])

    table = decide(painted)
    inside = in_spot(POINTS[:, 0], POINTS[:, 1], -0.1)
    assert table.is_dynamic[inside].all()
    assert (table.reasons[inside] == CHANGES).all()


@pytest.mark.parametrize("noise", [0.0, 2.0, 8.0])
def test_noise_alone_promotes_nothing(noise):
    table = decide(still, noise=noise)
    assert not table.is_dynamic.any()
    assert (table.reasons == STILL).mean() > 0.95


@pytest.mark.parametrize("n_drifting", [1, N_CAMERAS])
def test_exposure_drift_promotes_nothing(n_drifting):
    def drift(camera: int, frame: int, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        factors = 1.0 + 0.08 * frame * np.array([1.0, 0.9, 0.7]) * (camera < n_drifting)
        return np.broadcast_to(factors, (*x.shape, 3))

    assert not decide(drift).is_dynamic.any()


def test_drift_does_not_hide_a_lamp():
    def both(camera: int, frame: int, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return lamp(camera, frame, x, y) * (1.0 - 0.05 * frame * (camera == 1))

    inside = in_spot(POINTS[:, 0], POINTS[:, 1], -0.1)
    table = decide(both)
    assert table.is_dynamic[inside].all()
    assert not table.is_dynamic[~in_spot(POINTS[:, 0], POINTS[:, 1], 0.2)].any()


def test_one_camera_alone_is_not_believed():
    def seen_once(camera: int, frame: int, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return lamp(camera, frame, x, y) if camera == 2 else still(camera, frame, x, y)

    table = decide(seen_once)
    assert not table.is_dynamic.any()
    inside = in_spot(POINTS[:, 0], POINTS[:, 1], -0.1)
    assert (table.reasons[inside] == ONE_VIEW).all()


def test_two_of_four_cameras_that_disagree_are_not_believed():
    def opposite(camera: int, frame: int, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        light = lamp(camera, frame, x, y)
        return {0: light, 1: 1.0 / light}.get(camera, np.ones_like(light))

    assert not decide(opposite).is_dynamic.any()


def test_anchors_behind_others_or_out_of_sight_are_not_judged():
    behind = POINTS + np.array([0.0, 0.0, 2.0])
    aside = np.array([[50.0, 0.0, DEPTH], [0.0, 0.0, -1.0]])
    table = decide(lamp, points=np.concatenate([POINTS, behind, aside]))
    n = len(POINTS)
    central = np.flatnonzero((np.abs(behind[:, 0]) < 0.6) & (np.abs(behind[:, 1]) < 0.6))
    assert (table.reasons[n + central] == UNSEEN).all()
    assert (table.reasons[2 * n :] == UNSEEN).all()
    assert not table.is_dynamic[n + central].any()


def test_an_anchor_that_changes_alone_is_taken_for_chance():
    x, y = POINTS[:, 0], POINTS[:, 1]
    inside, outside = POINTS[in_spot(x, y, -0.2)], POINTS[~in_spot(x, y, 0.2)]
    for n, is_believed in ((1, False), (2, True)):
        table = decide(lamp, points=np.concatenate([outside, inside[:n]]))
        assert table.is_dynamic[len(outside) :].tolist() == [is_believed] * n
        assert (table.reasons[len(outside) :] == (LIGHT if is_believed else ALONE)).all()
        assert (table.scores[len(outside) :] > 1.0).all()


def test_anchors_near_motion_are_left_to_the_moving_ones():
    on_wall = POINTS[in_spot(POINTS[:, 0], POINTS[:, 1])]
    table = decide(lamp, moving=on_wall)
    inside = in_spot(POINTS[:, 0], POINTS[:, 1], -0.1)
    assert not table.is_dynamic.any()
    assert (table.reasons[inside] == NEAR_MOTION).all()


def test_what_moves_in_front_hides_the_wall():
    def dark_behind(camera: int, frame: int, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        # an object 2 in front of the cameras, 0.3 wide, throws its picture on other parts of the wall in each of them
        center = -cameras().world_to_camera[camera, 0, 3]
        middle = center + (0.0 - center) * DEPTH / 2.0
        return np.where((np.abs(x - middle) < 0.3) & (np.abs(y) < 0.3), 0.4, 1.0)[..., None]

    x, y = np.meshgrid(np.arange(-0.15, 0.16, 0.05), np.arange(-0.15, 0.16, 0.05))
    moving = np.stack([x.ravel(), y.ravel(), np.full(x.size, 2.0)], axis=1)
    backgrounds, pictures = wall_pictures(dark_behind, noise=2.0, is_flat=False)
    table = measure_gate(
        lambda camera, frame: pictures[camera, frame],
        N_FRAMES,
        backgrounds,
        cameras(),
        POINTS,
        spacing=SPACING,
        moving_points=moving,
        presence=np.ones((len(moving), N_FRAMES), dtype=bool),
        moving_spacing=0.05,
    )
    assert not table.is_dynamic.any()


def test_a_clip_of_one_frame_and_no_anchors_at_all():
    backgrounds, pictures = wall_pictures(lamp, noise=2.0, is_flat=False)

    def measured(points: np.ndarray) -> GateTable:
        return measure_gate(
            lambda camera, _: pictures[camera, -1],
            1,
            backgrounds,
            cameras(),
            points,
            spacing=SPACING,
            moving_points=NOTHING,
            presence=np.zeros((0, 1), dtype=bool),
            moving_spacing=1.0,
        )

    assert measured(POINTS).is_dynamic[in_spot(POINTS[:, 0], POINTS[:, 1], -0.1)].all()
    assert len(measured(NOTHING).is_dynamic) == 0


def test_the_summary_counts_reasons():
    text = decide(lamp).summary()
    assert "still" in text
    assert "lamp or shadow" in text


def test_regions_hold_points_and_travel_as_plain_values():
    box = parse_region({"treat": "static", "box": [[1, 1, 1], [-1, -1, -1]]})
    ball = parse_region({"treat": "dynamic", "sphere": [[0, 0, 0], 0.5]})
    points = np.array([[0.0, 0.0, 0.0], [0.9, 0.9, 0.9], [2.0, 0.0, 0.0]])
    assert box.contains(points).tolist() == [True, True, False]
    assert ball.contains(points).tolist() == [True, False, False]
    assert marked(points, [box, ball], "static").tolist() == [False, True, False]  # the later one overrules
    assert marked(points, [box, ball], "dynamic").tolist() == [True, False, False]
    assert [parse_region(region.as_dict()) for region in (box, ball)] == [box, ball]
    assert isinstance(box, GateRegion)


@pytest.mark.parametrize(
    "values",
    [
        None,
        {"treat": "moving", "box": [[0, 0, 0], [1, 1, 1]]},
        {"treat": "static"},
        {"treat": "static", "box": [[0, 0], [1, 1]]},
        {"treat": "static", "sphere": [[0, 0, 0], -1.0]},
        {"treat": "static", "sphere": [[0, 0, float("nan")], 1.0]},
        {"treat": "static", "box": [[0, 0, 0], [1, 1, 1]], "sphere": [[0, 0, 0], 1.0]},
    ],
)
def test_what_is_no_region_is_refused(values):
    with pytest.raises(ProjectError, match=r"not a region|not finite"):
        parse_region(values)
