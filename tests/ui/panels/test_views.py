"""One, two or four views of the same frame, in the real window."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pyglet.window import key

from app.playback.views.views import Views
from app.session.showing.look_commands import LookThrough, SetCompare, ShowViews
from tests.ui.fake_session import make_rig
from tests.ui.pilot import Pilot
from ui.panels.picture.panes import VIEW_GAP, view_areas
from ui.panels.state import Rect


@pytest.mark.parametrize("n", [1, 2, 4])
def test_views_share_the_area_without_overlap(n: int) -> None:
    area = Rect(10.0, 20.0, 410.0, 320.0)
    parts = view_areas(area, n)
    assert len(parts) == n
    for part in parts:
        assert area.x0 <= part.x0 < part.x1 <= area.x1
        assert area.y0 <= part.y0 < part.y1 <= area.y1
    covered = sum(part.width * part.height for part in parts)
    assert covered >= (area.width - VIEW_GAP) * (area.height - VIEW_GAP)


def test_a_new_view_starts_where_the_active_one_is_and_goes_its_own_way() -> None:
    views = Views()
    views.look_at(make_rig())
    views.current.view.orbit(40.0, 5.0)
    views.current.overlays.show_residual = True
    views.show(4)
    first, *others = views.shown
    for look in others:
        assert np.array_equal(look.view.world_to_camera(), first.view.world_to_camera())
        assert look.overlays == first.overlays
        look.view.pan(30.0, 0.0)
        look.overlays.show_residual = False
        assert not np.array_equal(look.view.world_to_camera(), first.view.world_to_camera())
    assert first.overlays.show_residual


def test_fewer_views_keep_the_active_one() -> None:
    views = Views()
    views.show(4)
    views.activate(3)
    active = views.current
    views.show(1)
    assert views.current is active
    assert views.shown == [active]
    with pytest.raises(ValueError, match="not 3"):
        views.show(3)
    views.activate(2)  # not shown
    assert views.active_index == 0


def test_a_view_that_is_drawn_takes_the_place_of_the_active_one_even_if_drawing_fails() -> None:
    views = Views()
    views.show(2)
    first, second = views.shown

    def draw() -> None:
        with views.drawn(1):
            assert views.current is second
            raise RuntimeError("a panel failed")

    with pytest.raises(RuntimeError, match="a panel failed"):
        draw()
    assert views.current is first


@pytest.mark.slow
def test_the_pointer_makes_a_view_active_and_turns_only_that_one(pilot: Pilot) -> None:
    pilot.key(key.V)
    pilot.draw(4)
    assert pilot.session.views.n_shown == 2
    before = [look.view.world_to_camera() for look in pilot.session.views.shown]
    start = pilot.rects["viewport.view1"].center
    pilot.drag(start, (start[0] + 60, start[1]))
    after = [look.view.world_to_camera() for look in pilot.session.views.shown]
    assert pilot.session.views.active_index == 1
    assert np.array_equal(before[0], after[0])
    assert not np.array_equal(before[1], after[1])
    pilot.key(key.V, modifiers=(key.LSHIFT,))
    assert pilot.session.views.active_index == 0


@pytest.mark.slow
def test_each_view_looks_through_its_own_camera_and_they_share_time(pilot: Pilot) -> None:
    pilot.click("viewport.views4")
    pilot.draw(4)
    pilot.key(key.BRACKETRIGHT)
    pilot.tap(*pilot.rects["viewport.view2"].center)
    pilot.key(key.BRACKETRIGHT)
    pilot.key(key.BRACKETRIGHT)
    pilot.key(key.RIGHT)
    cameras = [look.view.look_through for look in pilot.session.views.shown]
    assert cameras[0] is not None
    assert cameras[2] is not None
    assert cameras[0] != cameras[2]
    assert cameras[1] is cameras[3] is None
    assert pilot.session.timeline.frame_index == 1
    assert pilot.sent(ShowViews) == [ShowViews(4)]
    first, last = pilot.rects["viewport.view0"], pilot.rects["viewport.view3"]
    assert last.x0 > first.x1
    assert last.y0 > first.y1


@pytest.mark.slow
def test_words_over_small_views_stay_in_their_view_and_parts_stay_whole(pilot: Pilot) -> None:
    from ui.panels.picture.hud import wrapped
    from ui.viewport.hud_text import PARTS

    label = PARTS.join(["clip 0", "frame 0", "0.00 s", "cam04", "156 x 117"])
    assert wrapped(label, 24, len, between=PARTS) == [
        PARTS.join(["clip 0", "frame 0"]),
        PARTS.join(["0.00 s", "cam04"]),
        "156 x 117",
    ]
    pilot.studio.window.set_size(900, 600)
    pilot.session.dispatch(LookThrough(2))
    pilot.session.dispatch(SetCompare("wipe"))
    pilot.session.dispatch(ShowViews(4))
    pilot.draw(4)
    before = pilot.picture()
    view, other = pilot.rects["viewport.view3"], pilot.rects["viewport.view1"]
    hud = pilot.studio.frame.viewport.active.hud
    drawn = hud.text
    assert drawn is not None
    words = " ".join(["as much as nobody would like to read in a picture as small as this one"] * 4)
    hud._text = lambda *_: replace(drawn, note=words, failure=words)
    pilot.draw(3)
    after = pilot.picture()
    outside = np.s_[int(other.y0) : int(view.y0) - 6, int(other.x0) : int(other.x1)]
    assert np.array_equal(before[outside], after[outside])
