"""RecentProjects: kept in the preferences, and looked for on a thread."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

from app.project.clips.clip_catalog import ClipCatalog
from app.project.opening.opened_project import OpenedProject
from app.session.projects.recent_projects import RecentProjects
from app.session.projects.settings import Settings
from tests.app.conftest import DEADLINE_S
from tests.app.fakes import write_trained


def test_the_newest_stands_first_with_how_far_it_is_trained(make_opened: Callable[..., OpenedProject], tmp_path: Path):
    recent = RecentProjects(Settings(tmp_path / "settings.json"))
    first, second = make_opened("a"), make_opened("b")
    write_trained(first, 0)
    for opened in (first, second, first):
        recent.keep(opened, ClipCatalog(opened.project, len(opened.clips)))
    told = [(entry.folder.name, entry.n_trained, entry.n_clips) for entry in recent.entries]
    assert told == [("a", 1, 2), ("b", 0, 2)]
    again = RecentProjects(Settings(tmp_path / "settings.json"))
    assert again.entries == recent.entries
    again.forget(recent.entries[0].folder)
    assert [entry.folder.name for entry in again.entries] == ["b"]
    recent.close()
    again.close()


def test_those_that_are_gone_are_known_a_moment_later(make_opened: Callable[..., OpenedProject], tmp_path: Path):
    recent = RecentProjects(Settings(tmp_path / "settings.json"))
    opened = make_opened("a")
    recent.keep(opened, ClipCatalog(opened.project, len(opened.clips)))
    (opened.project.folder / "project.json").unlink()
    recent.look()
    assert recent.missing == frozenset()
    until_s = time.monotonic() + DEADLINE_S
    while not recent.missing:
        assert time.monotonic() < until_s
        recent.poll()
    assert recent.missing == {opened.project.folder.resolve()}
    recent.close()
