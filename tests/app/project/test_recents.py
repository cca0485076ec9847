"""The list of recent projects in the preferences, and what earlier versions left there."""

from __future__ import annotations

import json
from pathlib import Path

from app.project.projects_folder import project_name
from app.project.recents import MAX_RECENT, RecentProject, missing_folders
from app.session.projects.settings import Settings


def entry(name: str, **values: object) -> RecentProject:
    return RecentProject(f"/projects/{name}", "/captures/kitchen", name, **values)  # type: ignore[arg-type]


def test_projects_are_kept_newest_first_and_once(tmp_path: Path) -> None:
    settings = Settings(tmp_path / "settings.json")
    for known in (entry("a", n_trained=1, n_clips=3), entry("b"), entry("a", n_trained=2, n_clips=3)):
        settings.add_recent(known)
    again = Settings(tmp_path / "settings.json")
    assert [(known.name, known.n_trained) for known in again.recent] == [("a", 2), ("b", 0)]
    assert again.recent[0].trained_text == "2 of 3 clips trained"
    again.add_recent(entry("c", n_trained=4, n_clips=4, word="imported"))
    assert Settings(tmp_path / "settings.json").recent[0].trained_text == "4 of 4 clips imported"
    again.forget_recent(Path("/projects/c"))
    again.forget_recent(Path("/projects/a"))
    assert [known.name for known in Settings(tmp_path / "settings.json").recent] == ["b"]


def test_captures_of_earlier_versions_stay_until_their_project_is_known(tmp_path: Path) -> None:
    path = tmp_path / "settings.json"
    path.write_text(json.dumps({"schema": 1, "recent": ["/captures/kitchen", "/captures/hall", "/projects/b"]}))
    settings = Settings(path)
    assert [(known.project, known.folder) for known in settings.recent] == [
        ("", Path("/captures/kitchen")),
        ("", Path("/captures/hall")),
        ("", Path("/projects/b")),
    ]
    settings.add_recent(entry("a"))
    settings.add_recent(entry("b"))
    assert [str(known.folder) for known in settings.recent] == ["/projects/b", "/projects/a", "/captures/hall"]
    assert [str(known.folder) for known in Settings(path).recent] == ["/projects/b", "/projects/a", "/captures/hall"]
    content = json.loads(path.read_text())
    assert content["recent"] == ["/captures/hall"]  # an earlier version still reads the file


def test_a_list_that_makes_no_sense_is_left_out(tmp_path: Path) -> None:
    path = tmp_path / "settings.json"
    for content in ({"projects": 3}, {"projects": [3, {}, {"project": 1, "capture": ""}], "recent": [None]}, {}):
        path.write_text(json.dumps(content))
        assert Settings(path).recent == []
    good = {"project": "/projects/a", "capture": "/captures/kitchen", "n_trained": "many", "name": 3}
    path.write_text(json.dumps({"projects": [good]}))
    assert Settings(path).recent == [entry("a")]
    path.write_bytes(b"\xff{")
    assert Settings(path).recent == []


def test_the_list_is_bounded(tmp_path: Path) -> None:
    settings = Settings(tmp_path / "settings.json")
    for number in range(2 * MAX_RECENT):
        settings.add_recent(entry(str(number)))
    assert len(settings.recent) == MAX_RECENT


def test_what_is_gone_is_found_out(tmp_path: Path) -> None:
    (tmp_path / "p").mkdir()
    (tmp_path / "p" / "project.json").touch()
    (tmp_path / "capture").mkdir()
    there, bare = RecentProject(str(tmp_path / "p"), "", "p"), RecentProject("", str(tmp_path / "capture"), "capture")
    emptied, gone = RecentProject(str(tmp_path / "capture"), "", "c"), RecentProject("", str(tmp_path / "q"), "q")
    assert missing_folders([there, bare, emptied, gone]) == {emptied.folder, gone.folder}


def test_a_project_is_called_by_the_folder_that_the_user_chose(tmp_path: Path) -> None:
    named = "kitchen-0123456789abcdef"
    assert project_name(tmp_path / named, "/captures/kitchen") == "kitchen"
    assert project_name(tmp_path / f"{named}-2", "/captures/kitchen") == "kitchen 2"
    assert project_name(tmp_path / "kitchen-toy", "/captures/kitchen") == "kitchen-toy"
