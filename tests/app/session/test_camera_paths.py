"""Camera paths by commands: kept in the project, taken back together with regions, and followed by the view."""

from __future__ import annotations

import math

import numpy as np
import pytest

from app.document.storing.document_store import DocumentStore
from app.session.editing.edit_commands import Redo, Undo
from app.session.editing.mark_commands import MarkRegion
from app.session.paths import path_commands as p
from app.session.showing.look_commands import ActivateView, LookThrough, SetFrame, ShowViews, TogglePlay
from engine.camera.projection import camera_center
from engine.errors import ProjectError
from tests.app.conftest import poll_until

BALL = MarkRegion("dynamic", (0.25, -0.5, 1.0), 0.125)


def ready(session):
    """The session, once it has read what its project holds."""
    poll_until(
        session, lambda: session.paths.can_edit and session.regions.can_mark, what="paths and regions of the project"
    )
    return session


@pytest.fixture
def session(make_session):
    return ready(make_session())


def on_disk(session):
    session.document.settle()
    return DocumentStore(session.project.folder).read().present.camera_paths


def frames(session) -> list[float]:
    return [key.frame for key in session.paths.path.keys]


def add_keys(session, *frame_indices: int) -> None:
    """A key at each frame, each from another side."""
    for frame_index in frame_indices:
        session.dispatch(SetFrame(frame_index))
        session.view.orbit(40.0, 5.0)
        session.dispatch(p.SetCameraKey())


def test_keys_go_where_the_playhead_and_the_view_are(session):
    add_keys(session, 4, 0, 2)
    assert session.paths.path.name == "Path"
    assert frames(session) == [0.0, 2.0, 4.0]
    assert session.paths.chosen_key == 1, "the one that was added"
    key = session.paths.key
    assert np.allclose(key.world_to_camera, session.view.world_to_camera())
    assert key.fov_y_rad == session.view.fov_y
    session.view.orbit(10.0, 0.0)
    session.dispatch(p.SetCameraKey())
    assert frames(session) == [0.0, 2.0, 4.0]
    assert np.allclose(session.paths.path.keys[1].world_to_camera, session.view.world_to_camera())
    assert [path.name for path in on_disk(session)] == ["Path"]


def test_a_key_from_a_capture_camera_is_that_camera(session):
    session.dispatch(LookThrough(2))
    session.dispatch(p.SetCameraKey())
    assert np.allclose(session.paths.path.keys[0].world_to_camera, session.rig.world_to_camera[2])


def test_a_key_from_a_flat_view_stands_where_that_seems_to(session):
    eye = session.view.eye.copy()
    session.view.set_orthographic(True)
    session.dispatch(p.SetCameraKey())
    assert np.allclose(session.paths.path.keys[0].center, eye)


def test_keys_move_in_time_between_their_neighbours(session):
    add_keys(session, 0, 3, 5)
    for wanted, expected in ((1.2, 1.0), (-5.0, 1.0), (99.0, 4.0), (math.nan, 4.0), (2.6, 3.0)):
        session.dispatch(p.TimeCameraKey(1, wanted))
        assert frames(session) == [0.0, expected, 5.0]
    session.dispatch(p.TimeCameraKey(1, 2.25, is_whole=False))
    assert frames(session) == [0.0, 2.25, 5.0]
    session.dispatch(p.TimeCameraKey(2, 1e9))
    assert frames(session)[2] == session.timeline.last_frame
    session.dispatch(p.TimeCameraKey(0, -3.0, is_whole=False))
    assert frames(session)[0] == 0.0


def test_keys_move_in_space_take_a_lens_and_the_view(session):
    add_keys(session, 0, 3)
    rotation = session.paths.key.world_to_camera[:3, :3]
    session.dispatch(p.PlaceCameraKey(1, (1.0, 2.0, 3.0)))
    assert np.allclose(session.paths.key.center, (1, 2, 3))
    assert np.allclose(session.paths.key.world_to_camera[:3, :3], rotation)
    session.dispatch(p.SetCameraKeyFov(1, 0.5))
    assert session.paths.key.fov_y_rad == 0.5
    session.dispatch(p.AimCameraKey(0))
    assert np.allclose(session.paths.key.world_to_camera, session.view.world_to_camera())
    assert frames(session) == [0.0, 3.0]


def test_a_drag_is_taken_back_at_once_and_steps_of_regions_and_paths_in_turn(session):
    add_keys(session, 0)
    session.dispatch(BALL)
    for x in (0.1, 0.2, 0.3):
        session.dispatch(p.PlaceCameraKey(0, (x, 0.0, 0.0), gesture=1))
    for x in (0.4, 0.5):
        session.dispatch(p.PlaceCameraKey(0, (x, 0.0, 0.0), gesture=2))
    assert session.history.undo == "move camera key"
    session.dispatch(Undo())
    assert np.allclose(session.paths.path.keys[0].center, (0.3, 0, 0))
    session.dispatch(Undo())
    assert session.history.undo == "mark a region"
    assert session.history.redo == "move camera key"
    session.dispatch(Undo())
    assert session.regions.regions == ()
    session.dispatch(Undo())
    assert session.paths.paths == ()
    assert on_disk(session) == ()
    session.dispatch(Undo())  # nothing to take back
    for _ in range(4):
        session.dispatch(Redo())
    assert np.allclose(session.paths.path.keys[0].center, (0.5, 0, 0))
    assert len(session.regions.regions) == 1
    assert session.history.redo == ""
    assert np.allclose(on_disk(session)[0].keys[0].center, (0.5, 0, 0))
    assert len(session.notices) == 0


def test_what_is_done_after_undo_is_a_step_of_its_own(session):
    add_keys(session, 0)
    session.dispatch(p.PlaceCameraKey(0, (0.1, 0.0, 0.0), gesture=1))
    session.dispatch(p.PlaceCameraKey(0, (0.2, 0.0, 0.0), gesture=2))
    session.dispatch(Undo())
    session.dispatch(p.PlaceCameraKey(0, (0.3, 0.0, 0.0), gesture=1))
    assert session.history.redo == ""
    session.dispatch(Undo())
    assert np.allclose(session.paths.path.keys[0].center, (0.1, 0, 0))


def test_paths_are_named_chosen_and_deleted(session):
    session.dispatch(p.NewCameraPath())
    session.dispatch(p.NewCameraPath("a <b> %s ##\n"))
    session.dispatch(p.NewCameraPath())
    assert [path.name for path in session.paths.paths] == ["Path", "a <b> %s ##", "Path 2"]
    session.dispatch(p.RenameCameraPath("Path"))
    assert "two camera paths" in session.notices[-1].detail
    session.dispatch(p.RenameCameraPath("  "))
    assert "needs a name" in session.notices[-1].detail
    session.dispatch(p.ChooseCameraPath(0))
    session.dispatch(p.RenameCameraPath("x"))
    assert [path.name for path in on_disk(session)] == ["x", "a <b> %s ##", "Path 2"]
    session.dispatch(p.DeleteCameraPath())
    assert session.paths.path.name == "a <b> %s ##"
    session.dispatch(p.ChooseCameraPath(1))
    session.dispatch(Undo())
    assert session.paths.path.name == "x", "what came back is chosen"
    for _ in range(3):
        session.dispatch(p.DeleteCameraPath())
    assert session.paths.chosen is None
    assert on_disk(session) == ()
    session.dispatch(p.DeleteCameraPath())
    assert "no camera path yet" in session.notices[-1].detail


def test_presets_fill_what_is_played_and_begin_where_one_looks(session):
    session.timeline.set_range(1, 4)
    before = session.view.world_to_camera()
    session.dispatch(p.MakeTurntable())
    path = session.paths.path
    assert path.frame_range == (1.0, 5.0), "played over and over, no frame of the loop comes twice"
    assert np.allclose(path.at(1)[0], before, atol=1e-6)
    session.dispatch(p.MakeFlyThrough())
    assert session.paths.path.frame_range == (1.0, 4.0)
    assert len(session.paths.path.keys) == len(session.rig)
    session.dispatch(p.MakeTurntable())
    assert [path.name for path in session.paths.paths] == ["Turntable", "Fly-through", "Turntable 2"]
    session.timeline.set_range(3, 3)
    session.dispatch(p.MakeFlyThrough())
    assert "of 1 frame" in session.notices[-1].detail
    assert len(on_disk(session)) == 3


def test_the_view_goes_along_until_it_is_moved(session):
    add_keys(session, 0, 5)
    session.dispatch(p.LookAlongPath())
    for frame_index in (5, 3, 0):
        session.dispatch(SetFrame(frame_index))
        assert np.allclose(session.view.world_to_camera(), session.paths.path.at(frame_index)[0], atol=1e-9)
        assert session.view.fov_y == pytest.approx(session.paths.path.at(frame_index)[1])
    session.dispatch(TogglePlay())
    session.timeline.tick(2.5 / session.timeline.fps)
    assert session.lead_view()
    assert not session.lead_view(), "it is there already"
    assert np.allclose(session.view.world_to_camera(), session.paths.path.at(2)[0], atol=1e-9)
    session.dispatch(p.SetCameraKeyFov(1, 0.3))
    assert session.view.fov_y == pytest.approx(session.paths.path.at(2)[1]), "what is changed is seen at once"
    session.view.orbit(3.0, 0.0)
    moved = session.view.world_to_camera()
    session.poll()
    assert not session.paths.is_along
    session.dispatch(SetFrame(5))
    assert np.allclose(session.view.world_to_camera(), moved)


def test_one_of_several_views_goes_along_while_the_others_look_on(session):
    add_keys(session, 0, 5)
    session.dispatch(ShowViews(2))
    session.dispatch(p.LookAlongPath())
    assert session.paths.along == 0
    session.dispatch(ActivateView(1))
    session.view.orbit(50.0, 0.0)
    onlooker = session.view.world_to_camera()
    session.dispatch(SetFrame(2))
    assert np.allclose(session.views.shown[0].view.world_to_camera(), session.paths.path.at(2)[0], atol=1e-9)
    assert np.allclose(session.view.world_to_camera(), onlooker)
    assert session.paths.along == 0
    session.dispatch(ShowViews(1))  # the active one stays, the one that goes along is gone
    assert not session.paths.is_along
    assert np.allclose(session.view.world_to_camera(), onlooker)


def test_looking_along_ends_with_the_path_and_needs_keys(session):
    session.dispatch(p.LookAlongPath())
    assert "No camera path with keys" in session.notices[-1].detail
    assert not session.paths.is_along
    add_keys(session, 0)
    session.dispatch(p.LookAlongPath())
    session.dispatch(p.DeleteCameraKey(0))
    session.poll()
    assert not session.paths.is_along
    session.dispatch(p.LookAlongPath(False))
    assert not session.paths.is_along


def test_going_to_a_key_moves_time_and_view(session):
    add_keys(session, 0, 4)
    session.view.orbit(99.0, 9.0)
    session.dispatch(p.ChooseCameraKey(0, is_going=True))
    assert session.timeline.frame_index == 0
    assert np.allclose(camera_center(session.view.world_to_camera()), session.paths.path.keys[0].center)
    session.dispatch(p.ChooseCameraKey(None))
    assert session.paths.key is None


@pytest.mark.parametrize(
    "command",
    [
        p.DeleteCameraKey(7),
        p.TimeCameraKey(-1, 0.0),
        p.PlaceCameraKey(0, (math.nan, 0.0, 0.0)),
        p.PlaceCameraKey(0, (0.0, 1e300, 0.0)),
        p.SetCameraKeyFov(0, 3.1415),
        p.SetCameraKeyFov(0, math.nan),
        p.ChooseCameraKey(2),
        p.ChooseCameraPath(1),
        p.MakeTurntable(0.0),
        p.MakeTurntable(math.inf),
        p.NewCameraPath("x" * 300),
        p.RenameCameraPath("\ud800"),
    ],
)
def test_what_cannot_be_is_told_and_changes_nothing(session, command):
    add_keys(session, 1)
    before = session.paths
    session.dispatch(command)
    assert session.notices[-1].title == "The camera path cannot be changed"
    assert session.paths == before
    assert len(on_disk(session)) == 1


def test_paths_come_back_when_the_project_is_opened_again(make_session):
    first = ready(make_session())
    add_keys(first, 0, 2)
    first.dispatch(p.CloseCameraPath(True))
    keys = first.paths.path.keys
    first.close()  # right away: nothing may be lost
    again = ready(make_session())
    assert again.paths.path.is_closed
    assert all(
        np.array_equal(a.world_to_camera, b.world_to_camera) for a, b in zip(again.paths.path.keys, keys, strict=True)
    )
    assert again.history.undo == "close camera path"
    again.dispatch(Undo())
    assert not again.paths.path.is_closed


def test_what_could_not_be_kept_is_not_shown_as_if_it_were(session, monkeypatch):
    add_keys(session, 0)
    assert len(on_disk(session)[0].keys) == 1

    def refuse(*_):
        raise ProjectError("The project could not be saved (No space left on device).", hint="Free some space.")

    monkeypatch.setattr(DocumentStore, "write", refuse)
    add_keys(session, 3)
    poll_until(session, lambda: len(session.notices) > 0 and session.paths.can_edit, what="a notice")
    assert "No space left" in session.notices[0].detail
    assert frames(session) == [0.0]
    assert session.history.undo == "new camera path", "what was done before is on disk"


def test_a_project_that_another_program_writes_to_is_left_alone(make_session):
    first = ready(make_session())
    add_keys(first, 0)
    assert len(on_disk(first)) == 1
    second = make_session()
    poll_until(second, lambda: len(second.paths.paths) == 1, what="the paths of the other program")
    assert "read-only" in second.paths.why_not
    second.dispatch(p.SetCameraKey())
    assert second.notices[-1].kind == "error"
    assert len(on_disk(first)[0].keys) == 1
    second.dispatch(p.LookAlongPath())  # looking is allowed
    assert second.paths.is_along


def test_without_a_capture_there_is_nowhere_to_keep_a_path(make_session):
    session = make_session(is_open=False)
    session.dispatch(p.SetCameraKey())
    assert "No capture is open" in session.notices[0].detail
    assert session.paths.paths == ()
