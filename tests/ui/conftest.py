"""A headless window on a made-up session, driven by pyglet events with a fixed clock."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

import pyglet
import pytest

pyglet.options.headless = True  # before pyglet.window is imported anywhere in this process
pyglet.options.shadow_window = False

from app.session.projects.preferences import PreferencesFile  # noqa: E402
from app.session.projects.window_memory import WindowMemory  # noqa: E402
from tests.ui.fake_session import FakeSession  # noqa: E402
from tests.ui.pilot import Pilot  # noqa: E402


def _why_no_window() -> str | None:
    """The reason why no headless window can be made here, or None."""
    from ui.shell.window import make_window

    try:
        window = make_window(64, 64)
    except Exception as error:  # noqa: BLE001 - missing libraries show as several kinds; any of them means skip
        return f"no headless OpenGL window ({type(error).__name__}: {error}); install libegl1 and libgl1-mesa-dri"
    window.close()
    return None


@pytest.fixture(scope="session")
def headless_gl() -> None:
    """Skips the test, with the reason, where EGL or a driver is missing."""
    reason = _why_no_window()
    if reason is not None:
        pytest.skip(reason)


@pytest.fixture
def open_pilot(headless_gl: None) -> Iterator[Callable[..., Pilot]]:
    """Factory of driven windows; all are closed at the end of the test."""
    from ui.shell.window import StudioWindow

    opened: list[Any] = []

    def open_window(
        session: FakeSession | None = None,
        *,
        size: tuple[int, int] = (1280, 800),
        memory: WindowMemory | None = None,
        preferences: PreferencesFile | None = None,
        first_frames: int = 6,
        is_eased: bool = False,
    ) -> Pilot:
        width, height = size
        studio = StudioWindow(
            session or FakeSession(),
            width=width,
            height=height,
            fixed_delta_s=1 / 60,
            memory=memory,
            preferences=preferences,
        )
        opened.append(studio)
        # Synthetic events would wait for dispatch_events() otherwise.
        studio.window._enable_event_queue = False
        studio.frame.ui.navigation.is_motion_reduced = not is_eased
        pilot = Pilot(studio)
        pilot.draw(first_frames)
        return pilot

    yield open_window
    for studio in opened:
        studio.close()


@pytest.fixture
def lasting_notices(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is said for some seconds stays, however long the test takes."""
    for name in ("INFO_LIFETIME_S", "WARNING_LIFETIME_S"):
        monkeypatch.setattr(f"ui.panels.notices.{name}", math.inf)


@pytest.fixture
def pilot(open_pilot: Callable[..., Pilot]) -> Pilot:
    """A window with the made-up capture open."""
    return open_pilot()
