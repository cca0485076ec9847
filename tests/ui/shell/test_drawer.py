"""The drawer between picture and timeline: closed to begin with; whatever is opened in it, the timeline is seen."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from pyglet.window import key

from app.session.projects.window_memory import WindowMemory
from tests.ui.pilot import CTRL, Pilot
from ui.panels.state import DOCTOR, DRAWER, LOG, TIMELINE

pytestmark = [pytest.mark.gl, pytest.mark.slow]
INSIDE = {LOG: "log.lines"}


def show(pilot: Pilot, title: str) -> None:
    """By the palette."""
    pilot.key(key.K, modifiers=(CTRL,))
    pilot.draw(2)
    pilot.type(f"show the panel {title}")
    pilot.draw(2)
    pilot.key(key.ENTER)
    pilot.rest()


@pytest.mark.parametrize("size", [(900, 600), (1600, 1000)])
def test_the_timeline_is_seen_whatever_is_opened(open_pilot: Callable[..., Pilot], size: tuple[int, int]) -> None:
    pilot = open_pilot(size=size)
    pilot.rest()
    before, canvas = pilot.rects["timeline.track"], pilot.rects["viewport.canvas"]
    frame = pilot.studio.frame
    assert not frame._visible_panels & set(DRAWER)
    for title in DRAWER:
        show(pilot, title)
        assert {title, TIMELINE} <= frame._visible_panels
        assert pilot.rects["timeline.track"] == before, title
        assert 100 < pilot.rects["viewport.canvas"].height < canvas.height
        if title in INSIDE:
            assert pilot.rects["viewport.canvas"].y1 < pilot.rects[INSIDE[title]].y0
            assert pilot.rects[INSIDE[title]].y1 < before.y0
    pilot.key(key.W, modifiers=(CTRL,))
    pilot.rest()
    assert not frame._visible_panels & set(DRAWER)
    assert pilot.rects["viewport.canvas"] == canvas, "the picture has its room back"


def test_a_tab_closes_what_it_shows(pilot: Pilot) -> None:
    frame = pilot.studio.frame
    show(pilot, DOCTOR)
    show(pilot, LOG)
    canvas = pilot.rects["viewport.canvas"]
    pilot.tap(canvas.x1 - 14, canvas.y1 + 16)  # the cross at the end of the tabs
    pilot.rest()
    assert len(frame.ui.open_drawer) < 2
    show(pilot, LOG)
    assert LOG in frame._visible_panels


def test_it_opens_at_its_place_after_a_restart(open_pilot: Callable[..., Pilot], tmp_path: Path) -> None:
    file = tmp_path / "window.json"
    pilot = open_pilot(memory=WindowMemory(file))
    pilot.rest()
    pilot.studio.close()
    again = open_pilot(memory=WindowMemory(file))
    again.rest()
    track = again.rects["timeline.track"]
    show(again, LOG)
    assert LOG not in again.studio.frame._floating_panels
    assert again.rects["timeline.track"] == track
    assert again.rects["viewport.canvas"].y1 < again.rects["log.lines"].y0 < track.y0
