"""Commands on what is shown: modes, parts of clips, and what pictures are compared with."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from app.playback.modes.view_modes import CONTENTS, MODES
from app.session.projects.settings import Settings
from app.session.session import Session
from app.session.showing.look_commands import SetCompareWith, SetContent, SetMode, ShowViews
from app.status import CAPTURED, version_name, version_number


@pytest.fixture
def session(tmp_path: Path) -> Iterator[Session]:
    made = Session(project_dir=tmp_path / "project", settings=Settings(tmp_path / "settings"), is_preloading=False)
    yield made
    made.close()


def test_every_mode_part_and_other_picture_can_be_set(session: Session) -> None:
    for mode in MODES:
        session.dispatch(SetMode(mode))
        assert session.overlays.mode == mode
        assert session.request_other(32, 24) is None, "nothing is open"
    for content in CONTENTS:
        session.dispatch(SetContent(content))
        assert session.overlays.content == content
    for other in (CAPTURED, *MODES, version_name(12)):
        session.dispatch(SetCompareWith(other))
        assert session.overlays.compare_with == other
        assert session.request_other(32, 24) is None
    assert version_number(session.overlays.compare_with) == 12
    assert session.shown_coverage() is None
    assert session.shown_trails() is None


def test_modes_belong_to_the_view_that_keys_act_on(session: Session) -> None:
    session.dispatch(ShowViews(2))
    session.dispatch(SetMode("depth"))
    first, second = (look.overlays.mode for look in session.views.shown)
    assert (first, second) == ("depth", "color")


@pytest.mark.parametrize("command", [SetMode("Depth"), SetContent(""), SetCompareWith("version x")])
def test_what_does_not_exist_is_refused(session: Session, command: SetMode | SetContent | SetCompareWith) -> None:
    with pytest.raises(ValueError, match="not "):
        session.dispatch(command)
