"""Arithmetic of moving about: what stays where it is seen, where moves end, and that nothing ever tips over."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.playback.frame_decoder import ShownFrame
from app.playback.modes.arrays import AnchorArrays, GaussianArrays, Picture
from app.playback.modes.view_modes import ShownAs
from app.playback.render import RenderRequest, RenderView, render
from app.playback.views.orbit_view import FLAT_REACH, OrbitView
from app.playback.views.pointing import pixel_ray, point_beside, seen_point
from app.playback.views.scene_axes import AXIS_VIEWS, UP_AXES, axis_rotation, rig_radius, scene_axes, view_from
from app.playback.views.view_angles import angles_of, rotation_of
from app.playback.views.view_motion import EASE_S, LONGEST_STEP_S
from app.playback.views.view_place import ViewPlace
from engine.backends.table import backend_called
from engine.camera.rig import CameraRig
from tests.app.playback.test_orbit_view import make_rig, project
from tests.app.playback.test_pointing import gaussians as gaussians_at

WIDTH, HEIGHT = 640, 480
PX = st.floats(-300.0, 300.0)
ANGLE = st.floats(-3.0, 3.0)
POINT = st.tuples(*[st.floats(-0.7, 0.7)] * 3).map(np.array)


def make_view(*, is_orthographic: bool = False, roll: float = 0.0) -> OrbitView:
    view = OrbitView(make_rig())
    view.K(WIDTH, HEIGHT)
    view.is_orthographic, view.roll = is_orthographic, roll
    return view


def tilted_rig() -> CameraRig:
    """A rig whose cameras lean to a side, each by another angle."""
    rig = make_rig()
    poses = rig.world_to_camera.copy()
    for i, pose in enumerate(poses):
        cos, sin = math.cos(0.1 * (i - 2)), math.sin(0.1 * (i - 2))
        pose[:3] = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]]) @ pose[:3]
    return CameraRig(rig.names, poses, rig.Ks, rig.image_sizes)


def assert_rigid(matrix: np.ndarray) -> None:
    rotation = matrix[:3, :3]
    assert np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-9)
    assert np.linalg.det(rotation) == pytest.approx(1.0, abs=1e-9)


# ---- what stays where it is seen -----------------------------------------------------------------------------------


@given(POINT, PX, PX, ANGLE, st.booleans())
def test_orbiting_about_a_point_keeps_its_pixel(point, dx, dy, roll, is_orthographic):
    view = make_view(is_orthographic=is_orthographic, roll=roll)
    before, turned = project(view, point, WIDTH, HEIGHT), view.rotation
    view.orbit(dx, dy, point)
    assert np.allclose(project(view, point, WIDTH, HEIGHT), before, atol=1e-5)
    if abs(dx) > 1.0:
        assert not np.allclose(view.rotation, turned)


@given(POINT, st.floats(0.3, 3.0), st.booleans())
def test_moving_towards_a_point_keeps_its_pixel(point, factor, is_orthographic):
    view = make_view(is_orthographic=is_orthographic)
    before, distance = project(view, point, WIDTH, HEIGHT), view.distance
    view.dolly(factor, point)
    # without perspective exact only up to how far away the eye is
    assert np.allclose(project(view, point, WIDTH, HEIGHT), before, atol=0.05 if is_orthographic else 1e-5)
    assert view.distance == pytest.approx(factor * distance)


@given(POINT, st.booleans())
def test_taking_a_pivot_changes_nothing_that_is_seen_and_panning_then_follows_the_pointer(point, is_orthographic):
    view = make_view(is_orthographic=is_orthographic)
    pose, before = view.shown_pose, project(view, point, WIDTH, HEIGHT)
    view.take_pivot(point)
    for other in (point, np.array([0.3, -0.2, 0.4])):
        view_before = make_view(is_orthographic=is_orthographic)
        expected = project(view_before, other, WIDTH, HEIGHT)
        assert np.allclose(project(view, other, WIDTH, HEIGHT), expected, atol=1e-2 if is_orthographic else 1e-6)
    assert np.allclose(view.rotation, pose.rotation)
    view.pan(21.0, -13.0)
    # without perspective exact only up to how far away the eye is
    assert np.allclose(project(view, point, WIDTH, HEIGHT) - before, [21.0, -13.0], atol=0.05)


@given(PX, PX, ANGLE)
def test_looking_around_stays_on_the_spot(dx, dy, roll):
    view = make_view(roll=roll)
    eye = view.eye
    view.look_around(dx, dy)
    assert np.allclose(view.eye, eye)
    assert_rigid(view.world_to_camera())


def test_looking_to_the_right_brings_in_what_is_on_the_right():
    view = make_view()
    right, down, forward = view.rotation
    view.look_around(10.0, 0.0)
    assert view.forward @ right > 0.0
    view = make_view()
    view.look_around(0.0, 10.0)
    assert view.forward @ down > 0.0
    assert view.forward @ forward > 0.99


def test_flying_takes_the_pivot_along_and_goes_where_it_says():
    view = make_view()
    right, _, forward = view.rotation
    eye, pivot = view.eye, view.pivot
    view.fly(0.1, 0.2, 0.3)
    moved = 0.1 * right + 0.2 * view.up + 0.3 * forward
    assert np.allclose(view.eye - eye, moved)
    assert np.allclose(view.pivot - pivot, moved)
    flat = make_view(is_orthographic=True)
    distance = flat.distance
    flat.fly(0.0, 0.0, 0.3)
    assert flat.distance < distance, "without perspective, ahead means larger"


def test_another_lens_looks_from_the_same_place():
    view = make_view()
    eye = view.eye
    view.set_fov(0.5)
    assert np.allclose(view.eye, eye)
    assert view.fov_y == 0.5
    view.set_fov(1e9)
    assert view.fov_y < math.pi


# ---- turning ---------------------------------------------------------------------------------------------------------


@given(st.sampled_from(sorted(UP_AXES)), st.floats(-3.1, 3.1), st.floats(-1.5, 1.5), ANGLE)
def test_angles_and_rotations_are_the_same_thing(name, yaw, pitch, roll):
    up = make_view().up if UP_AXES[name] is None else np.array(UP_AXES[name])
    rotation = rotation_of(up, yaw, pitch, roll)
    assert_rigid(rotation)
    assert np.allclose(rotation_of(up, *angles_of(up, rotation)), rotation, atol=1e-6)


@given(
    st.lists(st.tuples(st.sampled_from(["orbit", "look_around", "lean", "axis", "up", "flat"]), PX, PX), max_size=10)
)
def test_nothing_ever_tips_over(moves):
    view = make_view()
    for name, dx, dy in moves:
        if name == "lean":
            view.lean(0.01 * dx)
        elif name == "axis":
            view.look_along(AXIS_VIEWS[int(abs(dx)) % len(AXIS_VIEWS)])
        elif name == "up":
            view.set_up_axis(sorted(UP_AXES)[int(abs(dx)) % len(UP_AXES)])
        elif name == "flat":
            view.set_orthographic(dx > 0)
        else:
            getattr(view, name)(dx, dy)
        assert_rigid(view.world_to_camera())
    view.stand_upright()
    assert view.rotation[0] @ view.up == pytest.approx(0.0, abs=1e-9), "the horizon is level"


@pytest.mark.parametrize("name", AXIS_VIEWS)
@pytest.mark.parametrize("up", sorted(UP_AXES))
def test_axis_views_look_along_an_axis_at_the_pivot(up, name):
    view = make_view()
    view.set_up_axis(up)
    pivot = view.pivot.copy()
    view.look_along(name)
    axes = scene_axes(view.up)
    assert np.abs(axes @ view.forward).max() == pytest.approx(1.0)
    assert np.allclose(project(view, pivot, WIDTH, HEIGHT), [WIDTH / 2, HEIGHT / 2])
    if name not in ("top", "bottom"):
        assert -view.rotation[1] @ view.up == pytest.approx(1.0), "up is up"
    assert np.allclose(view.rotation, axis_rotation(view.up, name))


def test_opposite_views_look_the_other_way_and_each_end_of_an_axis_has_its_view():
    up = np.array([0.0, 0.0, 1.0])
    for name, other in (("front", "back"), ("right", "left"), ("top", "bottom")):
        assert np.allclose(axis_rotation(up, name)[2], -axis_rotation(up, other)[2])
    ends = {view_from(up, axis, sign) for axis in range(3) for sign in (1, -1)}
    assert ends == set(AXIS_VIEWS)
    assert view_from(up, 2, 1) == "top"
    assert np.allclose(axis_rotation(up, "front")[2], [0.0, 1.0, 0.0]), "as in Blender"
    assert np.allclose(scene_axes(up), np.eye(3))
    with pytest.raises(ValueError, match="views along an axis"):
        axis_rotation(up, "sideways")


def test_up_can_be_chosen_and_given_back_to_the_cameras():
    view = make_view()
    own, forward, pivot = view.up, view.forward, view.pivot
    view.set_up_axis("+x")
    assert np.array_equal(view.up, [1.0, 0.0, 0.0])
    assert np.allclose(view.forward, forward)
    assert np.array_equal(view.pivot, pivot)
    view.set_up_axis("rig")
    assert np.array_equal(view.up, own)
    with pytest.raises(ValueError, match="up can be"):
        view.set_up_axis("z")


@given(st.sampled_from([math.nan, math.inf, -math.inf]))
def test_numbers_that_are_none_change_nothing(bad):
    view = make_view()
    before = (view.world_to_camera(), view.K(WIDTH, HEIGHT))
    point = np.array([0.0, bad, 0.0])
    view.orbit(bad, 1.0)
    view.orbit(0.0, 0.0, point)
    view.look_around(1.0, bad)
    view.lean(bad)
    view.pan(bad, 0.0)
    view.dolly(bad)
    view.dolly(1.0, point)
    view.fly(0.0, bad, 0.0)
    view.set_fov(bad)
    view.take_pivot(point)
    view.frame(point, 1.0)
    view.frame(np.zeros(3), bad)
    view.focus_on(point)
    assert np.allclose(view.world_to_camera(), before[0])
    assert np.allclose(view.K(WIDTH, HEIGHT), before[1])


# ---- framing ---------------------------------------------------------------------------------------------------------


@given(POINT, st.floats(0.05, 2.0), st.sampled_from([(640, 480), (300, 700)]), st.booleans())
def test_what_is_framed_is_seen_whole_and_fills_the_picture(center, radius, size, is_orthographic):
    view = make_view(is_orthographic=is_orthographic)
    view.K(*size)
    view.frame(center, radius)
    right, down, _ = view.rotation
    middle = project(view, center, *size)
    assert np.allclose(middle, np.array(size) / 2, atol=1e-6)
    rim = [project(view, center + sign * radius * axis, *size) for axis in (right, down) for sign in (1, -1)]
    away = np.abs(np.array(rim) - middle).max()
    assert 0.6 * min(size) / 2 < away < min(size) / 2


def test_focusing_brings_a_point_into_the_middle_at_its_size():
    view = make_view()
    point, rotation = np.array([0.4, 0.1, -0.3]), view.rotation
    depth = float((point - view.eye) @ view.forward)
    view.focus_on(point)
    assert np.allclose(project(view, point, WIDTH, HEIGHT), [WIDTH / 2, HEIGHT / 2])
    assert float((point - view.eye) @ view.forward) == pytest.approx(depth)
    assert np.allclose(view.rotation, rotation)


# ---- cameras ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("camera", range(6))
def test_leaving_a_camera_keeps_its_pose_even_if_it_leans(camera):
    rig = tilted_rig()
    view = OrbitView(rig)
    view.look(camera)
    view.look(None)
    assert np.allclose(view.world_to_camera(), rig.world_to_camera[camera], atol=1e-9)
    view.stand_upright()
    assert view.roll == 0.0


# ---- eased moves -----------------------------------------------------------------------------------------------------


def jumps():
    """Every kind of jump, by name."""
    return {
        "home": lambda view: view.home(),
        "camera": lambda view: view.look(2),
        "leave": lambda view: (view.look(3), view.look(None)),
        "axis": lambda view: view.look_along("left"),
        "pole": lambda view: view.look_along("top"),
        "frame": lambda view: view.frame(np.array([0.1, 0.2, 0.3]), 0.5),
        "focus": lambda view: view.focus_on(np.array([0.1, 0.2, 0.3])),
        "flat": lambda view: view.set_orthographic(True),
        "up": lambda view: view.set_up_axis("-y"),
        "place": lambda view: ViewPlace.of(make_view(roll=0.4)).show(view),
    }


@pytest.mark.parametrize("name", jumps())
def test_a_jump_is_shown_from_where_one_is_and_ends_exactly_where_it_goes(name):
    view, at_once = make_view(), make_view()
    for moved in (view, at_once):
        moved.orbit(170.0, 40.0)
        moved.pan(30.0, 10.0)
    start = view.world_to_camera(), view.K(WIDTH, HEIGHT)
    view.is_eased = True
    jumps()[name](view)
    jumps()[name](at_once)
    assert view.advance(5.0), "however long the window slept before"
    assert np.allclose(view.world_to_camera(), start[0], atol=1e-9)
    assert np.allclose(view.K(WIDTH, HEIGHT), start[1])
    seen = []
    while view.advance(0.021):
        matrix = view.world_to_camera()
        assert_rigid(matrix)
        assert np.isfinite(view.K(WIDTH, HEIGHT)).all()
        seen.append(matrix)
    assert len(seen) == int(EASE_S / 0.021)
    assert np.array_equal(view.world_to_camera(), at_once.world_to_camera())
    assert np.array_equal(view.K(WIDTH, HEIGHT), at_once.K(WIDTH, HEIGHT))
    assert not view.is_moving


def test_input_ends_a_move_where_it_has_come_to():
    view = make_view()
    view.is_eased = True
    view.look_along("left")
    view.advance(0.0)
    view.advance(0.07)
    on_the_way = view.world_to_camera()
    view.orbit(0.0, 0.0)
    assert not view.is_moving
    assert np.allclose(view.world_to_camera(), on_the_way, atol=1e-9)
    view.look(2)
    view.advance(0.0)
    view.advance(0.07)
    on_the_way = view.world_to_camera()
    view.dolly(1.0)
    assert view.look_through is None
    assert np.allclose(view.world_to_camera(), on_the_way, atol=1e-9)


def test_a_slow_frame_does_not_swallow_a_move():
    view = make_view()
    view.is_eased = True
    view.look_along("left")
    view.advance(0.0)
    assert LONGEST_STEP_S < EASE_S
    assert view.advance(10.0)


def test_without_easing_there_is_nothing_to_wait_for():
    view = make_view()
    view.look_along("left")
    assert not view.is_moving
    assert not view.advance(0.1)


# ---- without perspective ---------------------------------------------------------------------------------------------


def drawn(view: OrbitView, gaussians: GaussianArrays, mode: str = "color") -> Picture:
    """The rasterizer's picture, 64 x 48."""
    anchors = AnchorArrays(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.float32), key="none")
    look = RenderView.of(view, 64, 48, shown_as=ShownAs(mode))
    return render(
        RenderRequest((0, "", 0, "", "", look.shown_as, 0), look, ShownFrame(gaussians, anchors)), backend_called("cpu")
    )


def true_orthographic(view: OrbitView, points: np.ndarray, width: int, height: int) -> np.ndarray:
    """Where points are seen without any perspective. [N, 2]"""
    px_per_unit = height / (2.0 * view.distance * math.tan(view.fov_y / 2.0))
    return px_per_unit * (points - view.pivot) @ view.rotation[:2].T + np.array([width, height]) / 2


@settings(max_examples=30)
@given(st.integers(0, 10_000), ANGLE, st.floats(-1.4, 1.4))
def test_an_orthographic_view_is_off_by_less_than_a_tenth_of_a_pixel(seed, yaw, pitch):
    size = (1280, 720)
    view = make_view(is_orthographic=True)
    view.yaw, view.pitch = yaw, pitch
    # The numbers that the rasterizers are given are float32; so is their arithmetic.
    matrix, K = view.world_to_camera().astype(np.float32), view.K(*size).astype(np.float32)
    depths = np.random.default_rng(seed).uniform(-1.0, 1.0, (4000, 1)) * view.radius
    right, down, forward = view.rotation
    half = view.distance * math.tan(view.fov_y / 2)
    across = np.random.default_rng(seed + 1).uniform(-half, half, (4000, 2)) * [size[0] / size[1], 1.0]
    points = view.pivot + depths * forward + across[:, :1] * right + across[:, 1:] * down
    seen = points.astype(np.float32) @ matrix[:3, :3].T + matrix[:3, 3]
    pixels = seen[:, :2] / seen[:, 2:] * K[[0, 1], [0, 1]] + K[:2, 2]
    assert np.abs(pixels - true_orthographic(view, points, *size)).max() < 0.1
    reach = max(view.distance, FLAT_REACH * view.radius)
    is_sure = np.abs(depths[:, 0] + reach) > 2e-3 * view.radius  # steps of float32 from so far away
    assert np.array_equal(seen[is_sure, 2] > view.near, depths[is_sure, 0] > -reach)


def test_the_size_of_what_is_at_the_pivot_stays_when_perspective_goes():
    view = make_view()
    beside = view.pivot + 0.1 * view.rotation[0]
    before = project(view, beside, WIDTH, HEIGHT)
    view.set_orthographic(True)
    assert np.allclose(project(view, beside, WIDTH, HEIGHT), before, atol=1e-6)


def test_pictures_without_perspective_are_sorted_by_depth():
    """Thin sheets one behind the other, much closer together than float32 tells apart from far away."""
    view = make_view(is_orthographic=True)
    n = 40
    rng = np.random.default_rng(3)
    order = rng.permutation(n)
    depths = 1e-4 * view.radius * np.arange(n)[order]
    gaussians = gaussians_at(
        view.pivot + depths[:, None] * view.forward,
        scales=0.05,
        opacities=0.9,
    )
    gaussians.colors[:] = np.stack([np.arange(n)[order] / n, np.zeros(n), np.ones(n)], axis=1)
    image = drawn(view, gaussians).image
    red, _, blue = image[24, 32].astype(float) / 255.0
    left = 0.1 ** np.arange(n) * 0.9  # what each sheet adds, nearest first
    assert red == pytest.approx(float((left * np.arange(n) / n).sum()), abs=0.02)
    assert blue > 0.95


def test_depths_and_normals_without_perspective_are_those_of_the_scene_and_not_of_how_it_is_drawn():
    """A floor that rises by the slope of 0.2 across the picture."""
    view = make_view(is_orthographic=True)
    right, down, forward = view.rotation
    across = view.distance * math.tan(view.fov_y / 2) * np.linspace(-1.5, 1.5, 90)
    u, v = (axis.reshape(-1, 1) for axis in np.meshgrid(across, across))
    floor = gaussians_at(view.pivot + u * right + v * down + 0.2 * u * forward, scales=0.03, opacities=0.99)
    values = drawn(view, floor, "depth").values
    assert values is not None
    columns = (np.arange(64) + 0.5 - 32) * 2 * view.distance * math.tan(view.fov_y / 2) / 48
    assert np.allclose(values[24], view.distance + 0.2 * columns, atol=0.02 * view.distance)
    normal = (right * 0.2 - forward) / math.hypot(0.2, 1.0)
    shown = drawn(view, floor, "normals").image[10:38, 16:48].reshape(-1, 3).mean(0) / 255.0
    expected = 0.5 + 0.5 * (view.rotation @ normal) * [1.0, 1.0, -1.0]
    assert np.allclose(shown, expected, atol=0.03)


def test_what_lies_before_an_orthographic_view_is_cut_off_and_picking_agrees():
    view = make_view(is_orthographic=True)
    at = np.array([0.2, 0.1, -0.1])
    wall = at - (max(view.distance, view.radius) + 0.5) * view.forward
    gaussians = gaussians_at(np.stack([at, wall]), scales=0.05, opacities=0.99)
    matrix, K = view.world_to_camera(), view.K(WIDTH, HEIGHT)
    pixel = project(view, at, WIDTH, HEIGHT)
    found = seen_point(gaussians, *pixel_ray(matrix, K, pixel[0], pixel[1], start=view.near))
    assert found is not None
    assert np.linalg.norm(found - at) < 1e-3 * view.radius
    beside = point_beside(matrix, K, pixel[0], pixel[1], view.pivot)
    assert np.allclose(project(view, beside, WIDTH, HEIGHT), pixel, atol=1e-6)
    assert (beside - view.pivot) @ view.forward == pytest.approx(0.0, abs=1e-9)


def test_zooming_without_perspective_is_another_picture():
    view = make_view(is_orthographic=True)
    before = view.look_key
    view.dolly(0.9)
    assert view.look_key != before, "although the camera stands where it was"


def test_the_radius_of_the_scene_is_that_of_the_rig():
    rig = make_rig()
    assert OrbitView(rig).radius == rig_radius(rig)
    assert OrbitView().radius > 0
