"""Editing in a real window over a real session, with pointer and keys: crop, move, scope, undo, toggle, and the project
opened again. What is edited is what is shown, in the frames of its scope and in no others.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from pyglet.window import key, mouse

from app.session.editing.edit_commands import AddEdit
from app.session.projects.project_commands import OpenCapture
from app.session.session import Session
from app.session.showing.look_commands import SetFrame
from app.session.training.train_commands import TrainNextClip
from engine.editing.actions import Delete, Hide, Transform
from engine.editing.edit import Box, Edit, Scope, Sphere
from engine.editing.selection.volumes import in_volume
from tests.app.fakes import write_capture
from tests.ui.pilot import CTRL, SHIFT, Pilot
from tests.ui.real_session import draw_until, make_session, poll
from ui.panels.state import EDIT, HISTORY
from ui.viewport.editing.edit_tool import EditTool

pytestmark = [pytest.mark.gl, pytest.mark.slow]
ALT = key.LALT


def open_window(folder: Path, open_pilot: Callable[..., Pilot]) -> Pilot:
    """The project of a folder, trained if it is not, in a window with the panel Edits in front."""
    session = make_session(folder)
    capture = folder / "ring"
    session.dispatch(OpenCapture(capture if capture.exists() else write_capture(capture)))
    poll(session, lambda: session.capture is not None)
    if session.clip_states[0].state != "trained":
        session.dispatch(TrainNextClip())
        poll(session, lambda: session.clip_states[0].state == "trained")
    session.overlays.show_frusta = session.overlays.show_residual = False
    session.overlays.show_inherited = True
    pilot = open_pilot(session, size=(1280, 1300))
    pilot.studio.frame.ui.wanted_panel = EDIT
    shown(pilot, 0)
    pilot.draw(3)
    return pilot


@pytest.fixture
def window(tmp_path: Path, open_pilot: Callable[..., Pilot]) -> Iterator[Pilot]:
    pilot = open_window(tmp_path, open_pilot)
    yield pilot
    pilot.session.close()


def shown(pilot: Pilot, frame_index: int) -> np.ndarray:
    """Centres of the Gaussians that are shown at a frame, once they are. [N, 3]"""
    session: Session = pilot.session
    session.dispatch(SetFrame(frame_index))
    pilot.draw()
    viewport = pilot.studio.frame.viewport

    def is_there() -> bool:
        is_drawn = viewport.shows_playhead(session) and not viewport.scene.shown.is_on_its_way
        return is_drawn and not session.selection.is_busy

    draw_until(pilot, is_there, f"frame {frame_index}")
    gaussians = session.shown_gaussians()
    assert gaussians is not None
    return gaussians.means


def tool(pilot: Pilot) -> EditTool:
    return pilot.studio.frame.ui.editing


def place(pilot: Pilot, point: np.ndarray) -> tuple[float, float]:
    """Where a point of the scene is seen, window coordinates."""
    area, view = pilot.rects["viewport.rendered"], pilot.session.view
    seen = view.world_to_camera() @ [*point, 1.0]
    x, y, _ = view.K(round(area.width), round(area.height)) @ (seen[:3] / seen[2])
    return float(x + area.x0), float(y + area.y0)


def draw_box(pilot: Pilot) -> Box:
    """Drag a box on an anchor, by the tool's key."""
    x, y = place(pilot, shown(pilot, pilot.session.timeline.frame_index)[4])
    pilot.key(key.R, modifiers=(ALT,))
    pilot.drag((x, y), (x - 70, y + 45))
    shown(pilot, pilot.session.timeline.frame_index)
    box = pilot.studio.frame.ui.selecting.volume
    assert isinstance(box, Box)
    return box


def pull(pilot: Pilot, handle: str, dx: float, dy: float) -> None:
    """Drag a handle."""
    x, y = pilot.rects[f"handle.{handle}"].center
    pilot.drag((x, y), (x + dx, y + dy))


def face(pilot: Pilot) -> str:
    """A face of the box whose handle lies free in the picture."""
    area = pilot.rects["viewport.rendered"]
    places = {name: np.array(rect.center) for name, rect in pilot.rects.items() if name.startswith("handle.")}
    for name, at in places.items():
        away = min(np.linalg.norm(at - other) for key, other in places.items() if key != name)
        if name.startswith("handle.face") and away > 20.0 and area.contains(*(at - 90)) and area.contains(*(at + 90)):
            return name.removeprefix("handle.")
    raise AssertionError(f"no handle lies free: {places}")


def outward(pilot: Pilot, handle: str, px: float) -> tuple[float, float]:
    """A way of so many pixels from the middle of the box through a handle."""
    at, middle = (np.array(pilot.rects[f"handle.{name}"].center) for name in (handle, "center"))
    way = px * (at - middle) / np.linalg.norm(at - middle)
    return float(way[0]), float(way[1])


def only(pilot: Pilot) -> Edit:
    (edit,) = pilot.session.edits.edits
    return edit


def test_box_crop_handles_invert_delete_with_scope_undo_toggle_and_open_again(
    tmp_path: Path, open_pilot: Callable[..., Pilot]
) -> None:
    window = open_window(tmp_path, open_pilot)
    session, everything = window.session, {frame: shown(window, frame) for frame in (0, 1)}
    shown(window, 0)
    draw_box(window)
    x, y, z = (float(value) for value in everything[0][4])
    drawn = window.studio.frame.ui.selecting.volume = Box((x, y, z), (0.5, 0.5, 0.5))  # as if it were typed
    window.draw(2)
    handle = face(window)
    pull(window, handle, *outward(window, handle, 50))
    box = window.studio.frame.ui.selecting.volume
    assert isinstance(box, Box)
    assert np.prod(box.half_sizes) > 1.1 * np.prod(drawn.half_sizes)
    shown(window, 0)
    inside = in_volume(box, everything[0])
    assert session.selection.n_gaussians == inside.sum() > 0, "what lies in the box is selected anew"
    window.key(key.I, modifiers=(CTRL,))
    window.studio.frame.ui.wanted_panel = EDIT
    window.draw(3)
    window.click("edits.scope frame")
    window.key(key.DELETE)
    assert only(window).target == box
    assert (only(window).action, only(window).is_inverted, only(window).scope) == (Delete(), True, Scope(0, 1))
    np.testing.assert_array_equal(shown(window, 0), everything[0][inside])
    np.testing.assert_array_equal(shown(window, 1), everything[1], "frame 1 is not in its scope")
    shown(window, 0)
    assert session.selection.n_gaussians == 0

    before = only(window)
    pull(window, handle, *outward(window, handle, -40))
    resized = only(window).target
    assert isinstance(resized, Box)
    assert resized != box
    np.testing.assert_array_equal(shown(window, 0), everything[0][in_volume(resized, everything[0])])
    assert len(session.history.past) == 2, "the drag is one step"
    assert session.history.undo.startswith("resize: delete all but box")
    window.key(key.Z, modifiers=(CTRL,))
    assert only(window) == before
    window.key(key.Z, modifiers=(CTRL,))
    assert session.edits.edits == ()
    np.testing.assert_array_equal(shown(window, 0), everything[0])
    for _ in range(2):
        window.key(key.Z, modifiers=(CTRL, SHIFT))
    assert only(window).target == resized

    window.draw(2)
    window.click(f"edits.on{before.edit_id}")
    np.testing.assert_array_equal(shown(window, 0), everything[0])
    window.click(f"edits.on{before.edit_id}")
    kept = session.edits.edits
    window.studio.close()
    session.close()
    again = open_window(tmp_path, open_pilot)
    assert again.session.edits.edits == kept
    np.testing.assert_array_equal(shown(again, 0), everything[0][in_volume(resized, everything[0])])
    again.session.close()


def test_escape_gives_back_what_is_dragged(window: Pilot) -> None:
    draw_box(window)
    window.key(key.H)
    before = only(window)
    handle = face(window)
    dx, dy = outward(window, handle, 10)
    x, y = window.rects[f"handle.{handle}"].center
    window.move(x, y)
    window.press()
    for step in range(1, 5):
        window.x, window.y = x + step * dx, y + step * dy
        window._send("on_mouse_drag", *window._at(), dx, -dy, mouse.LEFT, 0)
        window.draw()
    assert only(window) != before
    window.key(key.ESCAPE)
    assert only(window) == before
    assert tool(window).chosen == before.edit_id, "Escape was meant for the drag alone"
    window.x += 20
    window._send("on_mouse_drag", *window._at(), 20, 0, mouse.LEFT, 0)
    window.draw()
    window.release()
    assert only(window) == before
    window.key(key.ESCAPE)
    assert tool(window).chosen is None


def test_what_is_selected_moves_with_the_arrow_and_by_numbers(window: Pilot) -> None:
    session, everything = window.session, shown(window, 0)
    x, y = place(window, everything[4])
    window.key(key.R)
    window.drag((x - 40, y - 40), (x + 40, y + 40))
    shown(window, 0)
    gaussians = session.shown_gaussians()
    is_moved = session.selected(gaussians)
    assert 0 < is_moved.sum() < len(is_moved)
    window.key(key.ESCAPE)
    window.key(key.G, modifiers=(ALT,))
    action = only(window).action
    assert isinstance(action, Transform)
    np.testing.assert_allclose(action.pivot, np.median(everything[is_moved], axis=0), rtol=1e-5)
    pull(window, "arrow z", 0, -45)
    moved = only(window).action
    assert isinstance(moved, Transform)
    assert np.flatnonzero(moved.translation).tolist() == [2]
    np.testing.assert_allclose(shown(window, 0)[is_moved], everything[is_moved] + moved.translation, atol=1e-4)
    np.testing.assert_array_equal(shown(window, 0)[~is_moved], everything[~is_moved])
    pull(window, "ring y", 25, 25)
    assert session.history.undo.startswith(("rotate:", "move:", "scale:"))
    n_steps = len(session.history.past)
    window.draw(2)
    field = window.rects["edits.scale"]
    window.drag((field.x0 + 20, field.center[1]), (field.x0 + 90, field.center[1]))
    scaled = only(window).action
    assert isinstance(scaled, Transform)
    assert scaled.scale > moved.scale
    assert len(session.history.past) == n_steps + 1, "a drag over a field is one step"


def test_the_stack_is_reordered_by_keys_and_by_drags_and_later_edits_act_on_what_is_left(window: Pilot) -> None:
    session, everything = window.session, shown(window, 0)
    middle = np.median(everything, axis=0)
    x, y, z = (float(value) for value in middle)
    session.dispatch(AddEdit(Hide(), Sphere((x, y, z), 0.8), is_inverted=True))
    session.dispatch(AddEdit(Transform(translation=(0.5, 0.0, 0.0)), Sphere((x, y, z), 0.8)))
    n_inside = int((np.linalg.norm(everything - middle, axis=1) <= 0.8).sum())
    assert len(shown(window, 0)) == n_inside
    window.key(key.UP, modifiers=(ALT,))
    assert tool(window).chosen == 1
    window.key(key.UP, modifiers=(ALT, SHIFT))
    assert [edit.edit_id for edit in session.edits.edits] == [2, 1]
    assert len(shown(window, 0)) < n_inside, "what was moved out is hidden now"
    window.draw(2)
    window.drag(window.rects["edits.row1"].center, window.rects["edits.row2"].center, steps=6)
    assert [edit.edit_id for edit in session.edits.edits] == [1, 2]
    window.key(key.D, modifiers=(CTRL,))
    assert [edit.edit_id for edit in session.edits.edits] == [1, 3, 2]
    window.key(key.H, modifiers=(CTRL,))
    assert [edit.is_on for edit in session.edits.edits] == [False, True, True]
    window.key(key.DELETE, modifiers=(SHIFT,))
    assert [edit.edit_id for edit in session.edits.edits] == [3, 2]


def test_a_click_in_the_history_goes_to_that_step(window: Pilot) -> None:
    session = window.session
    for radius in (0.2, 0.3, 0.4):
        session.dispatch(AddEdit(Hide(), Sphere((0.0, 0.0, 0.0), radius)))
    window.studio.frame.ui.wanted_panel = HISTORY
    window.draw(4)
    window.click("history.step1")
    assert [edit.edit_id for edit in session.edits.edits] == [1]
    window.click("history.step3")
    assert len(session.edits.edits) == 3
    window.click("history.step0")
    assert session.edits.edits == ()
    assert len(session.history.future) == 3


def test_three_points_of_the_ground_and_a_known_length_by_clicks(window: Pilot) -> None:
    session, points = window.session, shown(window, 0)
    tool(window).ask("ground")
    corners = [points[4], points[5]]
    for point in corners:
        window.move(*place(window, point))
        window.press()
        window.release()
    assert len(tool(window).points) == 2
    pose = window.session.view.world_to_camera()
    area = window.rects["viewport.rendered"]
    window.drag(area.center, (area.center[0] + 60, area.center[1]))
    assert len(tool(window).points) == 2, "a drag turns the view and gives no point"
    assert not np.array_equal(window.session.view.world_to_camera(), pose)
    window.key(key.ESCAPE)
    assert tool(window).asking is None
    tool(window).length_m = 2.0
    tool(window).ask("length")
    for point in corners:
        window.move(*place(window, point))
        window.press()
        window.release()
    found = session.edits.world.meters_per_unit
    assert found is not None
    assert session.history.undo == "set the scale from a length"
