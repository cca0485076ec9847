"""Handles of boxes, spheres and movements: where they are, what a drag makes of them, snapping, and views that say
nothing."""

from __future__ import annotations

import math

import numpy as np
import pytest

from engine.camera.rotations import matrices_of
from engine.editing.actions import Transform
from engine.editing.edit import Box, Prism, Sphere
from engine.editing.volumes.prisms import widths_at
from ui.viewport.editing.handles import (
    Handle,
    HandleView,
    Thing,
    dragged,
    handle_under,
    handles_of,
    middle_of,
    place_of,
    ring_of,
    snap_step,
)

TURN = (math.cos(0.3), 0.0, 0.0, math.sin(0.3))
BOX = Box((0.1, -0.2, 0.3), (0.5, 0.4, 0.3), TURN)
SPHERE = Sphere((0.1, -0.2, 0.3), 0.5)
MOVEMENT = Transform((0.3, 0.0, 0.0), TURN, 1.5, (0.0, 0.1, 0.0))
PRISM = Prism(BOX.center, BOX.half_sizes, ((-1.0, -0.5), (1.0, -1.0), (0.2, 1.0)), TURN, 3.0)
THINGS: tuple[Thing, ...] = (BOX, SPHERE, PRISM, MOVEMENT)


def lens(yaw: float = 0.4, pitch: float = 0.3, distance: float = 4.0) -> HandleView:
    """Looks at the origin; 800 x 600 px."""
    cy, sy, cp, sp = math.cos(yaw), math.sin(yaw), math.cos(pitch), math.sin(pitch)
    about_y = np.array([[cy, 0.0, -sy], [0.0, 1.0, 0.0], [sy, 0.0, cy]])
    about_x = np.array([[1.0, 0.0, 0.0], [0.0, cp, sp], [0.0, -sp, cp]])
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = about_x @ about_y, (0.0, 0.0, distance)
    K = np.array([[700.0, 0.0, 400.0], [0.0, 700.0, 300.0], [0.0, 0.0, 1.0]])
    return HandleView(matrix, K, 0.01)


def at(view: HandleView, place: np.ndarray) -> tuple[float, float]:
    """Where a place is seen, px."""
    x, y = view.pixels(np.asarray(place, np.float64)[None])[0][0]
    return float(x), float(y)


@pytest.mark.parametrize("thing", THINGS)
def test_each_handle_is_found_where_it_is_drawn(thing: Thing) -> None:
    view = lens()
    for handle in handles_of(thing):
        if handle.kind == "ring":
            points = [at(view, point) for point in ring_of(thing, handle, view)[:-1]]
            found = [handle_under(thing, view, *point, reach_px=10.0) for point in points]
            assert handle in found, "part of a ring may lie under another handle, not all of it"
        else:
            assert handle_under(thing, view, *at(view, place_of(thing, handle, view)), reach_px=1.0) == handle
    assert handle_under(thing, view, 5.0, 5.0, reach_px=10.0) is None
    assert len({handle.name for handle in handles_of(thing)}) == len(handles_of(thing))


@pytest.mark.parametrize("thing", THINGS)
def test_what_is_behind_the_eye_is_not_found(thing: Thing) -> None:
    view = lens(distance=-4.0)
    for handle in handles_of(thing):
        x, y = at(view, middle_of(thing) if handle.kind == "ring" else place_of(thing, handle, view))
        assert handle_under(thing, view, x, y, reach_px=10.0) is None


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_face_follows_the_pointer_and_the_opposite_one_stays(axis: int, sign: int) -> None:
    view, handle = lens(), Handle("face", axis, sign)
    direction = matrices_of(np.array(TURN))[:, axis]
    start, wanted = place_of(BOX, handle, view), place_of(BOX, handle, view) + sign * 0.2 * direction
    after = dragged(BOX, handle, view, at(view, start), at(view, wanted))
    assert isinstance(after, Box)
    np.testing.assert_allclose(place_of(after, handle, view), wanted, atol=1e-9)
    other = Handle("face", axis, -sign)
    np.testing.assert_allclose(place_of(after, other, view), place_of(BOX, other, view), atol=1e-9)
    whole = dragged(BOX, handle, view, at(view, start), at(view, wanted), is_whole=True)
    assert isinstance(whole, Box)
    assert whole.half_sizes == BOX.half_sizes
    np.testing.assert_allclose(middle_of(whole), middle_of(BOX) + sign * 0.2 * direction, atol=1e-9)


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_side_of_a_prism_follows_the_pointer_and_its_ends_cut_the_same_pyramid(axis: int, sign: int) -> None:
    view, handle = lens(), Handle("face", axis, sign)
    direction = matrices_of(np.array(TURN))[:, axis]
    start, wanted = place_of(PRISM, handle, view), place_of(PRISM, handle, view) + sign * 0.2 * direction
    after = dragged(PRISM, handle, view, at(view, start), at(view, wanted))
    assert isinstance(after, Prism)
    np.testing.assert_allclose(place_of(after, handle, view), wanted, atol=1e-9)
    assert (after.outline, after.quat) == (PRISM.outline, PRISM.quat)
    if axis == 2:  # the end that stays is as large as before
        other = np.array([-float(sign)])
        before_size = PRISM.half_sizes[0] * widths_at(PRISM, other)
        assert after.half_sizes[0] * widths_at(after, other) == pytest.approx(before_size)
    else:
        assert after.apex == PRISM.apex


def test_an_end_of_a_prism_never_goes_beyond_where_its_sides_meet() -> None:
    view, handle = lens(), Handle("face", 2, -1)
    start = place_of(PRISM, handle, view)
    far = at(view, start - 0.8 * matrices_of(np.array(TURN))[:, 2])
    assert dragged(PRISM, handle, view, at(view, start), far) == PRISM


def test_a_face_never_goes_through_the_other_one() -> None:
    view, handle = lens(), Handle("face", 0, 1)
    start = place_of(BOX, handle, view)
    far = at(view, start - 3.0 * matrices_of(np.array(TURN))[:, 0])
    after = dragged(BOX, handle, view, at(view, start), far)
    assert isinstance(after, Box)
    assert 0.0 < after.half_sizes[0] < 0.01


def test_a_radius_follows_the_pointer() -> None:
    view, handle = lens(), Handle("radius", 1, -1)
    start = place_of(SPHERE, handle, view)
    after = dragged(SPHERE, handle, view, at(view, start), at(view, np.subtract(start, (0.0, 0.25, 0.0))))
    assert isinstance(after, Sphere)
    assert after.radius == pytest.approx(0.75)
    assert after.center == SPHERE.center


@pytest.mark.parametrize("thing", THINGS)
def test_the_middle_follows_the_pointer_at_its_depth(thing: Thing) -> None:
    view, handle = lens(), Handle("center")
    start = at(view, middle_of(thing))
    stop = (start[0] + 70.0, start[1] - 40.0)
    after = dragged(thing, handle, view, start, stop)
    assert at(view, middle_of(after)) == pytest.approx(stop, abs=1e-6)
    depths = [(view.world_to_camera[:3, :3] @ middle_of(one))[2] for one in (thing, after)]
    assert depths[0] == pytest.approx(depths[1])


def test_an_arrow_moves_along_its_axis_alone() -> None:
    view, handle = lens(), Handle("arrow", 2)
    start = place_of(MOVEMENT, handle, view)
    after = dragged(MOVEMENT, handle, view, at(view, start), at(view, np.add(start, (0.0, 0.0, 0.4))))
    assert isinstance(after, Transform)
    np.testing.assert_allclose(after.translation, [0.3, 0.0, 0.4], atol=1e-9)
    assert (after.quat, after.scale, after.pivot) == (MOVEMENT.quat, MOVEMENT.scale, MOVEMENT.pivot)


@pytest.mark.parametrize("pitch", [0.2, 0.9, -0.6])
@pytest.mark.parametrize("yaw", [0.4, 2.0, -1.3])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_ring_turns_about_its_axis_as_far_as_the_pointer_goes(axis: int, yaw: float, pitch: float) -> None:
    """Where the ring is seen from the edge, the turn is about right, and in the right direction."""
    view, handle = lens(yaw, pitch), Handle("ring", axis)
    ring = ring_of(BOX, handle, view)
    first, last = 5, 9  # a quarter of a quarter turn
    after = dragged(BOX, handle, view, at(view, ring[first]), at(view, ring[last]))
    assert isinstance(after, Box)
    turned = matrices_of(np.array(after.quat)) @ matrices_of(np.array(BOX.quat)).T
    normal = matrices_of(np.array(BOX.quat))[:, axis]
    np.testing.assert_allclose(turned @ normal, normal, atol=1e-9)
    angle = math.atan2(
        0.5
        * float(
            np.array([turned[2, 1] - turned[1, 2], turned[0, 2] - turned[2, 0], turned[1, 0] - turned[0, 1]]) @ normal
        ),
        0.5 * (np.trace(turned) - 1.0),
    )
    wanted = 2.0 * math.pi * (last - first) / (len(ring) - 1)
    sight = middle_of(BOX) - view_eye(view)
    is_open = abs(normal @ sight) / np.linalg.norm(sight) > 0.3
    assert angle == pytest.approx(wanted, abs=1e-6) if is_open else angle > 0.0


def view_eye(view: HandleView) -> np.ndarray:
    return -view.world_to_camera[:3, :3].T @ view.world_to_camera[:3, 3]


def test_scaling_goes_by_the_distance_from_the_middle() -> None:
    view, handle = lens(), Handle("scale")
    middle, start = np.array(at(view, middle_of(MOVEMENT))), np.array(at(view, place_of(MOVEMENT, handle, view)))
    stop = middle + 2.0 * (start - middle)
    after = dragged(MOVEMENT, handle, view, (start[0], start[1]), (stop[0], stop[1]))
    assert isinstance(after, Transform)
    assert after.scale == pytest.approx(3.0)
    assert dragged(SPHERE, handle, view, (0.0, 0.0), (9.0, 9.0)) == SPHERE


def test_with_a_step_sizes_places_angles_and_factors_are_round() -> None:
    view = lens()
    face, center = Handle("face", 0, 1), Handle("center")
    start = place_of(BOX, face, view)
    after = dragged(BOX, face, view, at(view, start), at(view, start + 0.137), step=0.1)
    assert isinstance(after, Box)
    assert 20 * after.half_sizes[0] == pytest.approx(round(20 * after.half_sizes[0]))
    moved = dragged(MOVEMENT, center, view, (400.0, 300.0), (433.0, 281.0), step=0.05)
    assert isinstance(moved, Transform)
    np.testing.assert_allclose(
        np.array(moved.translation) / 0.05, np.round(np.array(moved.translation) / 0.05), atol=1e-9
    )
    ring = ring_of(MOVEMENT, Handle("ring", 1), view)
    turned = dragged(MOVEMENT, Handle("ring", 1), view, at(view, ring[0]), at(view, ring[9]), step=0.05)
    assert isinstance(turned, Transform)
    relative = matrices_of(np.array(turned.quat)) @ matrices_of(np.array(MOVEMENT.quat)).T
    angle = math.degrees(math.acos(0.5 * (np.trace(relative) - 1.0)))
    assert angle % 15.0 == pytest.approx(0.0, abs=1e-6) or angle % 15.0 == pytest.approx(15.0, abs=1e-6)


def test_a_drag_that_means_nothing_changes_nothing() -> None:
    """One looks along the axis, or the numbers are such as no edit may have."""
    along = lens(0.0, 0.0)
    box = Box((0.0, 0.0, 0.0), (0.5, 0.5, 0.5))
    assert dragged(box, Handle("face", 2, 1), along, (400.0, 300.0), (410.0, 300.0)) == box
    assert dragged(box, Handle("center"), along, (400.0, 300.0), (math.nan, 300.0)) == box
    assert dragged(MOVEMENT, Handle("center"), along, (400.0, 300.0), (1e300, 300.0)) == MOVEMENT


@pytest.mark.parametrize(("size", "step"), [(1.0, 0.02), (3.0, 0.05), (50.0, 1.0), (0.007, 0.0001)])
def test_steps_suit_the_size_of_the_scene(size: float, step: float) -> None:
    assert snap_step(size) == pytest.approx(step)
