"""The timeline by pointer and keys, in a real frame."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from pyglet.window import key, mouse

from app.session.projects.window_memory import WindowMemory, read_window_memory
from app.session.showing.look_commands import FollowTraining, SetFrame
from app.session.training.train_commands import TrainAll, TrainClip, TrainClips
from app.status import ClipStatus, ResidualStatus, SeamStatus
from tests.ui.fake_session import FakeSession
from tests.ui.long_capture import MARKERS, long_session
from tests.ui.pilot import CTRL, SHIFT, Pilot
from ui.panels.timeline.time_range import TimeRange
from ui.panels.timeline.units import FRAMES, SECONDS, TIMECODE

pytestmark = [pytest.mark.gl, pytest.mark.slow]


def shown(pilot: Pilot) -> TimeRange:
    return pilot.studio.frame.ui.timeline.range_of(pilot.session.timeline.n_frames)


def x_of(pilot: Pilot, frame_index: float) -> float:
    track, part = pilot.rects["timeline.track"], shown(pilot)
    return track.x0 + (frame_index - part.start) / part.length * track.width


def ctrl_wheel(pilot: Pilot, ticks: float) -> None:
    pilot.studio.window.dispatch_event("on_key_press", CTRL, 0)
    pilot.draw()
    pilot.wheel(ticks)
    pilot.studio.window.dispatch_event("on_key_release", CTRL, 0)
    pilot.draw(2)


# ---- zoom and pan -------------------------------------------------------------------------------------------------


def test_ctrl_and_the_wheel_zoom_at_the_pointer_and_a_double_click_shows_all(pilot: Pilot) -> None:
    track = pilot.rects["timeline.track"]
    at = (x_of(pilot, 12.0), track.y0 + 8)
    assert "timeline.overview" not in pilot.rects
    pilot.move(*at)
    ctrl_wheel(pilot, 3.0)
    assert shown(pilot).length == pytest.approx(30 / 1.25**3)
    assert x_of(pilot, 12.0) == pytest.approx(at[0], abs=1.0)
    assert "timeline.overview" in pilot.rects
    pilot.tap(at[0], pilot.rects["timeline.track"].y0 + 8)
    pilot.tap(at[0], pilot.rects["timeline.track"].y0 + 8)
    assert shown(pilot) == TimeRange(0.0, 30.0)
    ctrl_wheel(pilot, -5.0)
    assert shown(pilot) == TimeRange(0.0, 30.0)


def test_the_wheel_and_a_middle_drag_move_through_time(pilot: Pilot) -> None:
    view = pilot.studio.frame.ui.timeline
    view.show(TimeRange(10.0, 20.0), 30)
    pilot.draw(2)
    frame_index = pilot.session.timeline.frame_index
    pilot.move(*pilot.rects["timeline.track"].center)
    pilot.wheel(1.0)
    assert shown(pilot).start == pytest.approx(8.5)
    pilot.wheel(-1.0)
    assert shown(pilot).start == pytest.approx(10.0)
    pilot.studio.window.dispatch_event("on_mouse_scroll", *pilot._at(), -2.0, 0.0)
    pilot.draw(2)
    assert shown(pilot).start == pytest.approx(13.0)
    track = pilot.rects["timeline.track"]
    pilot.drag(track.center, (track.center[0] + track.width / 10, track.center[1]), button=mouse.MIDDLE)
    assert shown(pilot).start == pytest.approx(12.0, abs=0.05)
    assert shown(pilot).length == pytest.approx(10.0)
    assert pilot.session.timeline.frame_index == frame_index
    pilot.move(track.center[0] + 50, track.center[1])
    assert shown(pilot).start == pytest.approx(12.0, abs=0.05), "the button was let go of"


def test_the_part_that_is_shown_is_dragged_in_the_overview(pilot: Pilot) -> None:
    pilot.studio.frame.ui.timeline.show(TimeRange(0.0, 10.0), 30)
    pilot.draw(2)
    window, overview = pilot.rects["timeline.window"], pilot.rects["timeline.overview"]
    pilot.drag(window.center, (window.center[0] + overview.width / 3, window.center[1]))
    assert shown(pilot).start == pytest.approx(10.0, abs=0.05)
    pilot.move(overview.x1 - 2, overview.center[1])
    pilot.press()
    pilot.release()
    assert shown(pilot).stop == 30.0
    assert pilot.sent(SetFrame) == []


def test_the_timeline_is_zoomed_and_moved_by_keys(pilot: Pilot) -> None:
    pilot.session.timeline.seek(14)
    pilot.key(key.PAGEUP, modifiers=(key.LALT,))
    pilot.key(key.PAGEUP, modifiers=(key.LALT,))
    assert shown(pilot).length == pytest.approx(30 / 1.25**2)
    start = shown(pilot).start
    pilot.key(key.PAGEUP, modifiers=(SHIFT,))
    assert shown(pilot).start < start
    pilot.key(key.PAGEDOWN, modifiers=(key.LALT,))
    assert shown(pilot).length == pytest.approx(30 / 1.25)
    pilot.key(key.Z)
    assert shown(pilot) == TimeRange(0.0, 30.0)
    pilot.key(key.Z)
    assert (shown(pilot).start, shown(pilot).stop) == (pytest.approx(9.5), pytest.approx(20.5)), "clip 1 with some room"


def test_a_playhead_that_runs_turns_the_page_and_training_leaves_it(pilot: Pilot) -> None:
    view, timeline = pilot.studio.frame.ui.timeline, pilot.session.timeline
    view.show(TimeRange(0.0, 10.0), 30)
    timeline.seek(9)
    pilot.draw(2)
    timeline.toggle_play()
    timeline.tick(1 / timeline.fps)
    pilot.studio.draw()
    assert shown(pilot) == TimeRange(10.0, 20.0)
    timeline.hold()
    pilot.session.clip_states[0] = ClipStatus("training", 0.5)
    view.pan_by(5.0, 30)
    pilot.draw(3)
    assert shown(pilot) == TimeRange(15.0, 25.0)


def test_a_scrub_held_beyond_the_edge_moves_on(pilot: Pilot) -> None:
    pilot.studio.frame.ui.timeline.show(TimeRange(0.0, 10.0), 30)
    pilot.draw(2)
    track = pilot.rects["timeline.track"]
    pilot.move(track.x1 - 20, track.y0 + 8)
    pilot.press()
    pilot.studio.window.dispatch_event("on_mouse_drag", track.x1 + 8, pilot._at()[1], 28, 0, mouse.LEFT, 0)
    pilot.draw(30)
    assert shown(pilot).start > 4.0
    assert pilot.session.timeline.frame_index >= 14
    pilot.release()


def test_another_capture_begins_with_all_of_it(pilot: Pilot, tmp_path: Path) -> None:
    pilot.studio.frame.ui.timeline.show(TimeRange(0.0, 10.0), 30)
    pilot.draw(2)
    pilot.studio.window.dispatch_event("on_file_drop", 5, 5, [str(tmp_path)])
    pilot.rest()
    assert shown(pilot) == TimeRange(0.0, 30.0)


# ---- seams, playing -----------------------------------------------------------------------------------------------


def test_a_click_on_a_seam_plays_around_it_and_one_beside_it_scrubs(pilot: Pilot) -> None:
    timeline = pilot.session.timeline
    pilot.click("timeline.seam2")
    assert (timeline.around, timeline.is_playing) == ((8, 29), True)
    timeline.hold()
    mark = pilot.rects["timeline.seam1"]
    pilot.move(x_of(pilot, 4.5), mark.center[1])
    pilot.press()
    pilot.release()
    assert (timeline.around, timeline.frame_index) == (None, 4)
    pilot.key(key.SLASH)
    assert timeline.around == (0, 21)
    pilot.key(key.SLASH)
    assert (timeline.around, timeline.is_playing) == (None, False)


def test_a_seam_that_is_worse_stands_out_more_and_its_colour_never_changes(pilot: Pilot) -> None:
    def colour_of(index: int) -> np.ndarray:
        x, y = pilot.rects[f"timeline.seam{index}"].center[0], pilot.rects[f"timeline.seam{index}"].y1 - 2
        return pilot.picture()[int(y), int(x)].astype(float)

    pilot.session.measured = ResidualStatus((SeamStatus(1, 10, 0.1, 1.2), SeamStatus(2, 20, 0.9, 3.0)))
    pilot.draw(3)
    mild, bad = colour_of(1), colour_of(2)
    assert bad.sum() > mild.sum() + 200
    pilot.session.measured = ResidualStatus((SeamStatus(1, 10, 0.1, 1.2), SeamStatus(2, 20, 0.1, 1.2)))
    pilot.draw(3)
    np.testing.assert_allclose(colour_of(1), mild, atol=1)
    np.testing.assert_allclose(colour_of(2), mild, atol=1)


def test_playing_is_steered_by_keys(pilot: Pilot) -> None:
    timeline = pilot.session.timeline
    timeline.fps = 0.001  # so that no frame passes meanwhile
    seen = []
    for symbol in (key.L, key.L, key.J, key.J, key.K):
        pilot.key(symbol)
        seen.append((timeline.is_playing, timeline.speed * timeline.direction))
    assert seen == [(True, 1), (True, 2), (True, -1), (True, -2), (False, -2)]
    pilot.key(key.COMMA, modifiers=(SHIFT,))
    assert timeline.speed == 1.0
    pilot.key(key.PERIOD, modifiers=(SHIFT,))
    assert timeline.speed == 2.0
    is_looping = timeline.is_looping
    pilot.key(key.SLASH, modifiers=(CTRL,))
    assert timeline.is_looping is not is_looping
    for symbol, frame_index in ((key.PERIOD, 1), (key.PERIOD, 2), (key.COMMA, 1)):
        pilot.key(symbol)
        assert timeline.frame_index == frame_index
    timeline.seek(5)
    pilot.key(key.I)
    timeline.seek(20)
    pilot.key(key.O)
    assert timeline.play_range == (5, 20)
    assert "timeline.played" in pilot.rects
    pilot.key(key.X)
    assert timeline.play_range == (0, 29)


def test_the_speed_is_chosen_from_a_list(pilot: Pilot) -> None:
    pilot.click("timeline.speed")
    pilot.draw(3)
    pilot.click("speed.0.25")
    assert pilot.session.timeline.speed == 0.25


def test_end_twice_and_the_button_follow_the_training(pilot: Pilot) -> None:
    pilot.key(key.END)
    assert pilot.sent(FollowTraining) == []
    pilot.key(key.END)
    assert pilot.session.timeline.is_following
    pilot.key(key.LEFT)
    assert not pilot.session.timeline.is_following
    pilot.click("timeline.follow")
    assert pilot.session.timeline.is_following
    pilot.click("timeline.follow")
    assert pilot.sent(FollowTraining) == [FollowTraining(), FollowTraining(), FollowTraining(False)]


# ---- jumps, units, lanes ------------------------------------------------------------------------------------------


def type_time(pilot: Pilot, text: str) -> None:
    pilot.key(key.A, modifiers=(CTRL,))
    pilot.type(text)
    pilot.key(key.RETURN)
    pilot.draw(2)


def test_a_typed_time_is_gone_to_and_nonsense_is_answered(pilot: Pilot) -> None:
    timeline = pilot.session.timeline
    pilot.key(key.G, modifiers=(CTRL,))
    pilot.draw(2)
    type_time(pilot, "0.5s")
    assert timeline.frame_index == 15
    assert "timeline.jump" not in pilot.rects, "it has closed"
    pilot.key(key.G, modifiers=(CTRL,))
    pilot.draw(2)
    type_time(pilot, "50 %")
    assert timeline.frame_index == 15
    assert "timeline.jump words" in pilot.rects
    type_time(pilot, "clip 77")
    assert timeline.frame_index == 20
    assert "timeline.jump" in pilot.rects, "it says that there is no such clip"
    pilot.key(key.RETURN)
    pilot.draw(2)
    assert "timeline.jump" not in pilot.rects, "once more closes it"
    pilot.key(key.G, modifiers=(CTRL,))
    pilot.draw(2)
    pilot.key(key.ESCAPE)
    pilot.draw(2)
    assert "timeline.jump" not in pilot.rects
    pilot.key(key.SPACE)
    assert timeline.is_playing, "keys are the window's again"


def test_unit_and_lanes_are_kept_for_the_next_window(open_pilot: Callable[..., Pilot], tmp_path: Path) -> None:
    path = tmp_path / "window.json"
    pilot = open_pilot(FakeSession(), memory=read_window_memory(path))
    view = pilot.studio.frame.ui.timeline
    units = [view.unit]
    for act in (lambda: pilot.click("timeline.unit"), lambda: pilot.key(key.U)):
        act()
        units.append(view.unit)
    assert units == [FRAMES, SECONDS, TIMECODE]
    pilot.click("timeline.fold quality")
    pilot.draw(2)
    assert "timeline.fold quality" not in pilot.rects
    pilot.click("timeline.lanes")
    pilot.draw(2)
    pilot.click("lanes.markers")
    pilot.draw(2)
    assert view.folded == {"quality", "markers"}
    pilot.studio.close()
    again = open_pilot(FakeSession(), memory=read_window_memory(path)).studio.frame.ui.timeline
    assert (again.unit, again.folded) == (TIMECODE, {"quality", "markers"})


# ---- markers, menu ------------------------------------------------------------------------------------------------


def test_markers_are_made_named_visited_and_removed(pilot: Pilot) -> None:
    timeline = pilot.session.timeline
    timeline.seek(7)
    pilot.key(key.M, modifiers=(CTRL,))
    pilot.draw(2)
    pilot.type("50 % ## %s")
    pilot.key(key.RETURN)
    pilot.draw(2)
    assert timeline.markers.at(7).text == "50 % ## %s"
    assert not pilot.studio.frame.ui.regions.is_active, "M with Ctrl marks no sphere"
    timeline.seek(21)
    pilot.key(key.M, modifiers=(CTRL,))
    pilot.draw(2)
    pilot.key(key.ESCAPE)
    pilot.draw(2)
    assert timeline.markers.frames == [7, 21]
    pilot.key(key.UP, modifiers=(SHIFT,))
    assert timeline.frame_index == 7
    pilot.key(key.UP, modifiers=(SHIFT,))
    assert timeline.frame_index == 7
    pilot.key(key.DOWN, modifiers=(SHIFT,))
    assert timeline.frame_index == 21
    pilot.tap(*pilot.rects["timeline.marker7"].center)
    assert timeline.frame_index == 7
    pilot.tap(*pilot.rects["timeline.marker7"].center)
    pilot.draw(2)
    assert "timeline.marker name" in pilot.rects, "a double click asks for the name"
    pilot.click("timeline.marker remove")
    pilot.draw(2)
    assert timeline.markers.frames == [21]


def test_the_menu_of_a_clip_trains_from_there_plays_it_and_shows_it(pilot: Pilot) -> None:
    session = pilot.session
    session.clip_states = [ClipStatus("trained", 1.0), ClipStatus(), ClipStatus("stale")]

    def choose(name: str, clip: int = 1) -> None:
        pilot.tap(*pilot.rects[f"timeline.clip{clip}"].center, button=mouse.RIGHT)
        pilot.draw(2)
        pilot.click(f"clip menu.{name}")
        pilot.draw(2)

    choose("train from here")
    choose("train from here", clip=2)
    choose("train all", clip=2)
    assert pilot.sent(TrainClips) == [TrainClips((1, 2)), TrainClips((2,))]
    assert pilot.sent(TrainAll) == [TrainAll()]
    choose("range")
    assert session.timeline.play_range == (10, 19)
    choose("no range")
    assert session.timeline.play_range == (0, 29)
    choose("zoom")
    assert shown(pilot).length == pytest.approx(11.0)
    choose("whole")
    assert shown(pilot) == TimeRange(0.0, 30.0)
    choose("seam")
    assert session.timeline.around == (0, 21)


def test_the_menu_opens_by_key_for_the_clip_under_the_playhead(pilot: Pilot) -> None:
    pilot.session.clip_states[0] = ClipStatus("trained", 1.0)
    pilot.session.timeline.seek(25)
    pilot.key(key.F10, modifiers=(SHIFT,))
    pilot.draw(3)
    assert "clip menu.train" in pilot.rects
    pilot.key(key.ENTER)
    pilot.draw(3)
    assert pilot.sent(TrainClip) == [TrainClip(2)]


# ---- long captures, small windows ---------------------------------------------------------------------------------


@pytest.mark.parametrize("size", [(1280, 800), (900, 600)])
@pytest.mark.parametrize("n_shown", [10_000, 900, 40])
def test_a_thousand_clips_are_drawn_with_few_pieces_at_every_zoom(
    open_pilot: Callable[..., Pilot], size: tuple[int, int], n_shown: int
) -> None:
    session = long_session(is_alternating=True)
    pilot = open_pilot(session, size=size)
    view = pilot.studio.frame.ui.timeline
    view.show(TimeRange(3300.0, 3300.0 + n_shown).within(10_000), 10_000)
    pilot.draw(3)
    track = pilot.rects["timeline.track"]
    bands = [rect for name, rect in pilot.rects.items() if name.startswith("timeline.clip")]
    marks = [name for name in pilot.rects if name.startswith("timeline.seam")]
    assert 1 <= len(bands) <= track.width / 3 + 2
    assert len(marks) <= track.width / 9 + 2
    assert all(band.x1 > track.x0 - 4 and band.x0 < track.x1 + 4 for band in bands), "nothing out of sight is drawn"
    assert len(session.notices) == 0
    assert "timeline.playhead" in pilot.rects


def test_names_of_markers_are_shown_as_they_are(
    open_pilot: Callable[..., Pilot], monkeypatch: pytest.MonkeyPatch
) -> None:
    import ui.panels.timeline.rows.small_lanes as lanes

    written = []
    draw = lanes.small_text
    monkeypatch.setattr(lanes, "small_text", lambda *args: (written.append(args[3]), draw(*args)))
    pilot = open_pilot(long_session())
    assert {*written} == {" ".join(name.split("\n")) for name in MARKERS}
    assert len(pilot.session.notices) == 0


def test_rows_at_twice_the_scale_are_where_they_are_at_once(open_pilot: Callable[..., Pilot], tmp_path: Path) -> None:
    small = open_pilot(long_session(300, 10), size=(900, 600))
    rects = {name: rect for name, rect in small.rects.items() if name.startswith("timeline.")}
    small.studio.close()
    memory = WindowMemory(tmp_path / "window.json", ui_scale=2.0)
    large = open_pilot(long_session(300, 10), size=(1800, 1200), memory=memory)
    for name, rect in rects.items():  # letters are not quite as wide at another size
        assert np.allclose([*vars(large.rects[name]).values()], [*vars(rect).values()], atol=2), name


ROWS = [
    "timeline.unit",
    "timeline.lanes",
    "timeline.fold seams",
    "timeline.fold cache",
    "timeline.speed",
    "timeline.follow",
]


def test_whatever_the_pointer_rests_on_says_what_it_is(open_pilot: Callable[..., Pilot]) -> None:
    session = long_session(300, 10)
    session.clip_states[1] = ClipStatus("stale", reason="Its reference was trained again: 100 % ## %s.")
    pilot = open_pilot(session)
    pilot.move(5, 5)
    pilot.draw(60)
    before = pilot.picture()
    names = [*ROWS, "timeline.seam3", "timeline.seam7", "timeline.marker128"]
    places = {name: pilot.rects[name].center for name in names}
    places["quality"] = (x_of(pilot, 40.0), pilot.rects["timeline.fold quality"].center[1])
    places["stale"] = pilot.rects["timeline.clip1"].center
    for name, place in places.items():
        pilot.move(*place)
        pilot.draw(40)
        assert (pilot.picture() != before).any(axis=2).sum() > 1_500, f"the note of {name} covers that many pixels"
        pilot.move(5, 5)
        pilot.draw(4)
        assert (pilot.picture() != before).any(axis=2).sum() < 200, f"the note of {name} goes with the pointer"
    assert len(session.notices) == 0


def test_a_note_tells_the_ratio_of_a_seam_and_the_names_as_they_are(
    open_pilot: Callable[..., Pilot], monkeypatch: pytest.MonkeyPatch
) -> None:
    from imgui_bundle import imgui

    said = []
    monkeypatch.setattr(imgui, "text_unformatted", said.append)
    session = long_session(300, 10)
    session.measured = ResidualStatus((SeamStatus(3, 90, 0.5, 2.64),))
    pilot = open_pilot(session)
    pilot.move(*pilot.rects["timeline.seam3"].center)
    pilot.draw(2)
    assert "frame 90" in said[-1]
    assert "2.6!" in said[-1]
    pilot.move(*pilot.rects["timeline.seam4"].center)
    pilot.draw(2)
    assert "2.6!" not in said[-1]
    pilot.move(*pilot.rects["timeline.marker128"].center)
    pilot.draw(2)
    assert said[-1] == MARKERS[1]
