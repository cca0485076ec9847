"""Selecting in a real window over a real session: what is dragged is what is selected, and it shows."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from pyglet.window import key, mouse

from app.session.projects.project_commands import OpenCapture
from app.session.session import Session
from app.session.showing.look_commands import ShowViews, ToggleOverlay
from app.session.training.train_commands import TrainNextClip
from engine.camera.rotations import matrices_of
from engine.editing.edit import Box, Prism, Sphere
from engine.editing.selection.volumes import in_volume
from tests.app.fakes import write_capture
from tests.ui.pilot import CTRL, SHIFT, Pilot
from tests.ui.real_session import draw_until, make_session, poll
from ui.panels.state import EDIT, Rect
from ui.shell.screenshot import read_window
from ui.style.colors import YELLOW
from ui.viewport.editing.select_tool import GROWTH, SelectTool
from ui.viewport.hud_text import RENDERED

pytestmark = [pytest.mark.gl, pytest.mark.slow]
ALT = key.LALT


@pytest.fixture
def window(tmp_path: Path, open_pilot: Callable[..., Pilot]) -> Iterator[Pilot]:
    """A trained project in a window that shows frame 0, with the panel Selection in front and no marks."""
    session = make_session(tmp_path)
    session.dispatch(OpenCapture(write_capture(tmp_path / "ring")))
    poll(session, lambda: session.capture is not None)
    session.dispatch(TrainNextClip())
    poll(session, lambda: session.clip_states[0].state == "trained")
    for name in ("show_frusta", "show_inherited", "show_residual"):
        if getattr(session.overlays, name):
            session.dispatch(ToggleOverlay(name))
    pilot = open_pilot(session)
    pilot.studio.frame.ui.wanted_panel = EDIT

    def is_shown() -> bool:
        scene = pilot.studio.frame.viewport.scene
        return scene.shows == RENDERED and not scene.shown.is_on_its_way and session.selection.can_select

    draw_until(pilot, is_shown, "the picture")
    pilot.draw(3)
    yield pilot
    session.close()


def tool(pilot: Pilot) -> SelectTool:
    return pilot.studio.frame.ui.selecting


def pixels(pilot: Pilot) -> np.ndarray:
    """Where every Gaussian of the shown frame is seen, window coordinates; NaN behind the camera. [N, 2]"""
    session, area = pilot.session, pilot.rects["viewport.rendered"]
    gaussians = session.shown_gaussians()
    view, size = session.view, (round(area.width), round(area.height))
    seen = gaussians.means @ view.world_to_camera()[:3, :3].T + view.world_to_camera()[:3, 3]
    projected = (view.K(*size) @ seen.T).T
    at = projected[:, :2] / projected[:, 2:]
    at[seen[:, 2] <= gaussians.near_plane] = np.nan
    return at + np.array([area.x0, area.y0])


def chosen(pilot: Pilot) -> np.ndarray:
    """Which Gaussians of the shown frame are selected, once they were found. [N] bool"""
    session: Session = pilot.session
    draw_until(pilot, lambda: not session.selection.is_busy, "the selection")
    gaussians = session.shown_gaussians()
    assert gaussians is not None
    return session.selected(gaussians)


def drag_along(pilot: Pilot, points: np.ndarray) -> None:
    """Press at the first point, go through the others, release."""
    pilot.move(*points[0])
    pilot.press()
    for x, y in points[1:]:
        pilot.x, pilot.y = x, y
        pilot._send("on_mouse_drag", *pilot._at(), 1, 1, mouse.LEFT, 0)
        pilot.draw()
    pilot.release()


def is_sure(at: np.ndarray, is_in: np.ndarray, distances_px: np.ndarray) -> np.ndarray:
    """Those that lie clearly on one side of the border, by more than a pixel."""
    return np.isfinite(at).all(axis=1) & (distances_px > 1.5) | ~np.isfinite(at).all(axis=1) & ~is_in


def assert_chosen(pilot: Pilot, is_in: np.ndarray, border_px: np.ndarray, at: np.ndarray) -> None:
    sure = is_sure(at, is_in, border_px)
    found = chosen(pilot)
    assert is_in[sure].any()
    assert not is_in[sure].all()
    np.testing.assert_array_equal(found[sure], is_in[sure])


def middle_rect(pilot: Pilot, share: float = 0.12) -> Rect:
    area = pilot.rects["viewport.rendered"]
    x, y = area.center
    return Rect(x - share * area.width, y - share * area.height, x + share * area.width, y + 1.5 * share * area.height)


def in_rect(at: np.ndarray, rect: Rect) -> tuple[np.ndarray, np.ndarray]:
    """Whether points lie in a rectangle, and how far from its border."""
    off = np.stack([at[:, 0] - rect.x0, rect.x1 - at[:, 0], at[:, 1] - rect.y0, rect.y1 - at[:, 1]], axis=1)
    with np.errstate(invalid="ignore"):
        return np.asarray((off > 0.0).all(axis=1)), np.abs(off).min(axis=1)


def yellow(pilot: Pilot, rect: Rect) -> int:
    """Pixels in the colour of what is selected."""
    image = read_window(pilot.studio.ctx, 1280, 800).astype(int)
    inside = image[int(rect.y0) : int(rect.y1), int(rect.x0) : int(rect.x1)]
    return int((np.abs(inside - 255 * np.array(YELLOW[:3])).max(axis=2) < 40).sum())


def test_a_rectangle_that_is_dragged_selects_what_lies_in_it_and_that_shows(window: Pilot) -> None:
    rect, at = middle_rect(window), pixels(window)
    before = yellow(window, rect)
    pose = window.session.view.world_to_camera()
    window.key(key.R)
    window.drag((rect.x0, rect.y0), (rect.x1, rect.y1))
    assert_chosen(window, *in_rect(at, rect), at)
    assert np.array_equal(window.session.view.world_to_camera(), pose)  # the drag did not turn the view
    scene = window.studio.frame.viewport.scene
    draw_until(window, lambda: scene.selection.is_share_shown, "the marks of what is selected")
    window.draw()
    assert yellow(window, rect) > before + 50
    window.key(key.A, modifiers=(CTRL, SHIFT))
    assert not chosen(window).any()
    window.draw()
    assert yellow(window, rect) <= before


def test_shift_adds_ctrl_subtracts_and_both_intersect(window: Pilot) -> None:
    area, at = window.rects["viewport.rendered"], pixels(window)
    x, y = area.center
    first, second = Rect(x - 90, y - 60, x + 20, y + 70), Rect(x - 30, y - 60, x + 90, y + 70)
    in_first, in_second = in_rect(at, first)[0], in_rect(at, second)[0]
    border = np.minimum(in_rect(at, first)[1], in_rect(at, second)[1])
    window.key(key.R)
    for modifiers, truth in (
        ((SHIFT,), in_first | in_second),
        ((CTRL,), in_first & ~in_second),
        ((ALT,), in_first & ~in_second),
        ((CTRL, SHIFT), in_first & in_second),
        ((), in_second),
    ):
        window.drag((first.x0, first.y0), (first.x1, first.y1))
        chosen(window)
        for modifier in modifiers:
            window._send("on_key_press", modifier, 0)
        window.drag((second.x0, second.y0), (second.x1, second.y1))
        for modifier in modifiers:
            window._send("on_key_release", modifier, 0)
        assert_chosen(window, truth, border, at)


def test_a_lasso_selects_what_it_goes_around(window: Pilot) -> None:
    at, (x, y) = pixels(window), window.rects["viewport.rendered"].center
    window.key(key.R, modifiers=(SHIFT,))
    angles = np.linspace(0.0, 2.0 * np.pi, 120)
    drag_along(window, np.stack([x + 80 * np.cos(angles), y + 80 * np.sin(angles)], axis=1))
    away = np.hypot(*(at - [x, y]).T)
    assert_chosen(window, away < 80, np.abs(away - 80) - 1.0, at)


def test_a_brush_selects_what_it_paints_over_and_brackets_change_its_size(window: Pilot) -> None:
    at, (x, y) = pixels(window), window.rects["viewport.rendered"].center
    window.key(key.R, modifiers=(CTRL,))
    size, camera = tool(window).brush_px, window.session.view.look_through
    window.key(key.BRACKETRIGHT)
    assert tool(window).brush_px > size
    window.key(key.BRACKETLEFT)
    assert tool(window).brush_px == pytest.approx(size)
    window.move(x, y)
    window._send("on_key_press", CTRL, 0)
    window.wheel(2.0)
    window._send("on_key_release", CTRL, 0)
    radius = tool(window).brush_px
    assert radius > 1.2 * size
    assert window.session.view.look_through == camera  # the brackets did not go to another camera
    drag_along(window, np.array([[x - 60, y], [x - 20, y], [x + 20, y], [x + 60, y]]))
    away = np.hypot(np.maximum(np.abs(at[:, 0] - x) - 60, 0.0), at[:, 1] - y)
    assert_chosen(window, away < radius, np.abs(away - radius), at)


def place_of_an_anchor(pilot: Pilot) -> tuple[float, float]:
    """Where the mark of an anchor is seen; marks are shown from now on."""
    pilot.session.dispatch(ToggleOverlay("show_inherited"))
    pilot.draw(3)
    x, y = pixels(pilot)[4]
    return float(x), float(y)


def test_a_sphere_begins_on_what_is_seen_and_grows_with_the_drag(window: Pilot) -> None:
    gaussians, (x, y) = window.session.shown_gaussians(), place_of_an_anchor(window)
    window.key(key.R, modifiers=(CTRL, SHIFT))
    window.drag((x, y), (x + 45, y))
    found, sphere = chosen(window), tool(window).volume
    assert isinstance(sphere, Sphere)
    assert np.linalg.norm(gaussians.means[4] - np.array(sphere.center)) < 1e-3
    away = np.linalg.norm(gaussians.means - np.array(sphere.center), axis=1)
    np.testing.assert_array_equal(found, away <= sphere.radius)
    assert 1 < found.sum() < len(found)
    view, area = window.session.view, window.rects["viewport.rendered"]
    depth = (view.world_to_camera() @ [*sphere.center, 1.0])[2]
    focal = view.K(round(area.width), round(area.height))[0, 0]
    assert sphere.radius * focal / depth == pytest.approx(45.0, abs=1.0)


def test_a_prism_goes_around_what_the_loop_goes_around_and_has_handles(window: Pilot) -> None:
    gaussians, at = window.session.shown_gaussians(), pixels(window)
    x, y = window.rects["viewport.rendered"].center
    window.key(key.R, modifiers=(ALT, SHIFT))
    angles = np.linspace(0.0, 2.0 * np.pi, 120)
    drag_along(window, np.stack([x + 80 * np.cos(angles), y + 80 * np.sin(angles)], axis=1))
    found, prism = chosen(window), tool(window).volume
    assert isinstance(prism, Prism)
    np.testing.assert_array_equal(found, in_volume(prism, gaussians.means))
    is_under = np.hypot(*(at - [x, y]).T) < 79
    assert not (found & (np.hypot(*(at - [x, y]).T) > 81)).any()
    assert found[is_under].mean() > 0.9, "but for the nearest and farthest"
    window.draw(2)
    assert "handle.face +z" in window.rects


def test_a_box_stands_where_it_is_drawn_and_the_wheel_changes_its_height(window: Pilot) -> None:
    gaussians, (x, y) = window.session.shown_gaussians(), place_of_an_anchor(window)
    window.key(key.R, modifiers=(ALT,))
    window.drag((x, y), (x + 60, y - 40))
    chosen(window)
    box = tool(window).volume
    assert isinstance(box, Box)
    np.testing.assert_array_equal(chosen(window), in_volume(box, gaussians.means))
    up = matrices_of(np.array(box.quat))[:, 1]
    assert up == pytest.approx(np.asarray(window.session.view.up), abs=1e-6)
    corner = np.abs(matrices_of(np.array(box.quat)).T @ (gaussians.means[4] - np.array(box.center)))
    assert corner[[0, 2]] == pytest.approx(np.array(box.half_sizes)[[0, 2]], rel=1e-3)
    window._send("on_key_press", CTRL, 0)
    window.wheel(3.0)
    window._send("on_key_release", CTRL, 0)
    higher = tool(window).volume
    assert isinstance(higher, Box)
    assert higher.half_sizes[1] == pytest.approx(GROWTH**3 * box.half_sizes[1])
    np.testing.assert_array_equal(chosen(window), in_volume(higher, gaussians.means))


def test_a_click_means_the_anchor_there(window: Pilot) -> None:
    x, y = place_of_an_anchor(window)
    window.key(key.R)
    window.move(x, y)
    window.press()
    window.release()
    assert np.flatnonzero(chosen(window)).tolist() == [4]


def test_escape_ends_the_drag_then_the_tool(window: Pilot) -> None:
    rect = middle_rect(window)
    window.key(key.R)
    window.move(rect.x0, rect.y0)
    window.press()
    window.x, window.y = rect.x1, rect.y1
    window._send("on_mouse_drag", *window._at(), 9, 9, mouse.LEFT, 0)
    window.draw()
    assert tool(window).is_dragging
    window.key(key.ESCAPE)
    assert not tool(window).is_dragging
    assert tool(window).kind == "rectangle"
    window.release()
    assert not chosen(window).any()
    window.key(key.ESCAPE)
    assert tool(window).kind is None
    pose = window.session.view.world_to_camera()
    window.drag((rect.x0, rect.y0), (rect.x1, rect.y1))
    assert not np.array_equal(window.session.view.world_to_camera(), pose)  # the pointer leads the view again
    assert not chosen(window).any()


def test_all_none_invert_and_the_one_before_by_keyboard(window: Pilot) -> None:
    window.key(key.A, modifiers=(CTRL,))
    assert chosen(window).all()
    window.key(key.I, modifiers=(CTRL,))
    assert not chosen(window).any()
    window.key(key.Z, modifiers=(ALT,))
    assert chosen(window).all()
    window.key(key.Y)
    assert tool(window).kind == "flood"


def test_of_two_views_each_selects_in_its_own_picture(window: Pilot) -> None:
    window.session.dispatch(ShowViews(2))
    window.draw(6)
    views = window.session.views
    views.activate(1)
    window.session.view.orbit(140.0, 30.0)
    views.activate(0)
    window.draw(4)
    window.key(key.R)
    area = window.rects["viewport.view1"]
    x, y = area.center
    rect = Rect(x - 0.2 * area.width, y - 0.3 * area.height, x + 0.15 * area.width, y + 0.1 * area.height)
    window.drag((rect.x0, rect.y0), (rect.x1, rect.y1))
    assert views.active_index == 1
    window.draw(2)
    at = pixels(window)
    assert_chosen(window, *in_rect(at, rect), at)
