"""What the window looked like: kept, read again, and never a failure."""

from __future__ import annotations

import json
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import app.session.projects.window_memory
from app.playback.views.views import COUNTS
from app.session.projects.window_memory import (
    MAX_PROJECTS,
    WindowMemory,
    markers_of,
    read_window_memory,
    show_again,
    view_of,
)
from tests.app.conftest import DEADLINE_S
from tests.ui.fake_session import FakeSession


def test_what_was_kept_is_read_again(tmp_path: Path) -> None:
    memory = WindowMemory(tmp_path / "folder" / "window.json", size=(900, 600), ui_scale=1.5, layout="[Window]\n")
    memory.is_maximized, memory.mark_size, memory.mark_opacity = True, 1.5, 0.4
    memory.time_unit, memory.folded_lanes = "timecode", ("quality", "cache")
    memory.keep_view("/somewhere", view_of(FakeSession()))
    memory.save()
    again = read_window_memory(memory.path)
    for name in (
        "size",
        "is_maximized",
        "ui_scale",
        "layout",
        "mark_size",
        "mark_opacity",
        "time_unit",
        "folded_lanes",
        "views",
    ):
        assert getattr(again, name) == getattr(memory, name), name


def test_a_session_goes_back_to_what_it_showed() -> None:
    left, other = FakeSession(), FakeSession()
    left.timeline.seek(17)
    left.view.orbit(80, -30)
    left.view.dolly(0.5)
    left.overlays.show_inherited, left.overlays.show_frusta = True, False
    left.overlays.compare, left.overlays.wipe_position = "side", 0.25
    show_again(other, json.loads(json.dumps(view_of(left))))
    np.testing.assert_array_equal(other.view.world_to_camera(), left.view.world_to_camera())
    assert other.overlays == left.overlays
    assert other.timeline.frame_index == 17
    left.view.look(3)
    show_again(other, view_of(left))
    assert other.view.look_through == 3

    show_again(other, view_of(left) | {"camera": "cam99"})
    assert other.view.look_through is None


@pytest.mark.parametrize("n_views", COUNTS)
def test_as_many_views_come_back_each_as_it_was(n_views: int) -> None:
    left, other = FakeSession(), FakeSession()
    left.views.show(n_views)
    for index, look in enumerate(left.views.shown):
        look.view.orbit(10.0 * index, 5.0)
        look.overlays.show_residual = index % 2 == 1
    left.views.activate(n_views - 1)
    other.views.show(2)  # as the project before was left
    show_again(other, json.loads(json.dumps(view_of(left))))
    assert (other.views.n_shown, other.views.active_index) == (n_views, n_views - 1)
    for mine, theirs in zip(other.views.shown, left.views.shown, strict=True):
        np.testing.assert_array_equal(mine.view.world_to_camera(), theirs.view.world_to_camera())
        assert mine.overlays == theirs.overlays


def test_how_it_was_played_comes_back() -> None:
    left, other = FakeSession(), FakeSession()
    left.timeline.set_range(3, 20)
    left.timeline.speed, left.timeline.is_looping = 0.25, False
    show_again(other, json.loads(json.dumps(view_of(left))))
    assert (other.timeline.play_range, other.timeline.speed, other.timeline.is_looping) == ((3, 20), 0.25, False)


def test_markers_of_an_earlier_version_are_found_where_they_make_sense() -> None:
    session = FakeSession()
    kept = {"markers": [[4], 7, ["a", "b"], [1e9, "far"], [True, "x"], [5, 5], [6, "good"], [9, "50 % ## of\nall"]]}
    assert markers_of(kept, session.timeline) == [(6, "good"), (9, "50 % ## of\nall")]
    for nonsense in NONSENSE:
        assert markers_of({"markers": nonsense}, session.timeline) == []


NONSENSE = [None, True, -1, 10**30, 1e308, -0.5, "", "cam99", [], [1.0, "a", 2.0], [1e300] * 3, {"a": 1}]


@pytest.mark.parametrize("value", NONSENSE, ids=repr)
@pytest.mark.parametrize("name", [*view_of(FakeSession())])
def test_values_that_make_no_sense_change_nothing_that_can_be_seen(name: str, value: object) -> None:
    kept = view_of(FakeSession()) | {name: value}
    session = FakeSession()
    show_again(session, kept)
    assert np.isfinite(session.view.world_to_camera()).all()
    assert 0 <= session.timeline.frame_index < session.timeline.n_frames
    first, last = session.timeline.play_range
    assert 0 <= first <= last < session.timeline.n_frames
    assert 0.0 <= session.overlays.wipe_position <= 1.0
    assert session.overlays.compare in ("off", "wipe", "side")


@pytest.mark.parametrize(
    "content", ["", "{", "[]", '{"size": [1e99, -4], "views": 3, "layout": 7, "ui_scale": "big"}', "\x00\xff"]
)
def test_a_damaged_file_counts_as_empty(tmp_path: Path, content: str) -> None:
    path = tmp_path / "window.json"
    path.write_text(content)
    memory = read_window_memory(path)
    assert (memory.size, memory.layout, memory.ui_scale, memory.views) == (None, "", None, {})


def test_one_changed_character_is_noticed(tmp_path: Path) -> None:
    memory = WindowMemory(tmp_path / "window.json", layout="[Window][Viewport]\nPos=0,22\n")
    memory.save()
    text = memory.path.read_text()
    memory.path.write_text(text.replace("Pos=0,22", "Pos=9,22"))
    assert read_window_memory(memory.path).layout == ""


def test_old_projects_are_forgotten_and_the_disk_is_written_only_when_needed(tmp_path: Path) -> None:
    memory = WindowMemory(tmp_path / "window.json")
    for i in range(MAX_PROJECTS + 5):
        memory.keep_view(f"/project{i}", {"frame_index": i})
    memory.keep_view("/project5", {"frame_index": 1})
    assert len(memory.views) == MAX_PROJECTS
    assert [*memory.views][-1] == "/project5"
    memory.save()
    written = memory.path.stat().st_mtime_ns
    memory.save()
    assert memory.path.stat().st_mtime_ns == written


def test_a_disk_that_refuses_costs_no_more_than_the_memory(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    memory = WindowMemory(tmp_path / "file" / "window.json")
    memory.keep_view("/project", {})
    memory.save()
    assert not memory.path.exists()
    assert "/project" in memory.views


def test_saving_soon_waits_for_no_disk_and_loses_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    module, began, go_on = app.session.projects.window_memory, threading.Event(), threading.Event()
    write = module.write_checked_json

    def slow(path: Path, document: dict[str, Any]) -> None:
        began.set()
        assert go_on.wait(DEADLINE_S)
        write(path, document)

    monkeypatch.setattr(module, "write_checked_json", slow)
    memory = WindowMemory(tmp_path / "window.json", mark_size=1.0)
    memory.save_soon()
    assert began.wait(DEADLINE_S)
    memory.mark_size = 2.0
    memory.save_soon()  # the first one is still being written
    assert not memory.path.exists()
    go_on.set()
    memory.save()
    assert read_window_memory(memory.path).mark_size == 2.0
