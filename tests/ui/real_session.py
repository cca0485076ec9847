"""A real session over a small made capture, whose trainings are made up and over at once; and waiting for a window."""

from __future__ import annotations

import time
from collections.abc import Callable
from itertools import count
from pathlib import Path

from app.session.projects.settings import Settings
from app.session.session import Session
from tests.app.fakes import make_fake
from tests.app.inline_worker import InlineWorker
from tests.ui.pilot import Pilot
from ui.viewport.hud_text import HudText

REDRAWN_EVERY, PAUSE_S = 8, 0.005
WAIT_S = 300.0
"""Only a hang takes longer, or the first start, which compiles the kernels."""


def make_session(folder: Path) -> Session:
    """With a project of its own in a folder; trains in this process."""
    return Session(
        project_dir=folder / "project",
        launch=lambda job, project: InlineWorker(job, project.folder, make_fake),
        settings=Settings(folder / "settings.json"),
        is_preloading=False,
    )


def poll(session: Session, is_done: Callable[[], bool]) -> None:
    """Let a session without a window work until something is so."""
    until_s = time.monotonic() + WAIT_S
    while not is_done():
        assert time.monotonic() < until_s, f"{session.training} {list(session.notices)}"
        session.poll()


def hud(pilot: Pilot) -> HudText:
    """What the window says of its picture."""
    text = pilot.studio.frame.viewport.hud.text
    assert text is not None
    return text


def draw_until(pilot: Pilot, is_done: Callable[[], bool], what: str) -> None:
    """Turn the window's loop until something is so; what has not changed is drawn now and then only."""
    until_s = time.monotonic() + WAIT_S
    for turn in count():
        if is_done():
            return
        assert time.monotonic() < until_s, f"{what} did not come: {list(pilot.session.notices)}"
        if pilot.studio.frame.update(1 / 60) or turn % REDRAWN_EVERY == 0:
            pilot.studio.draw()
        else:
            time.sleep(PAUSE_S)
