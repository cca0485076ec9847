"""Folders of a project that are links, and files in it that the program has not made: nothing outside is touched."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path

import pytest

from app.document.project_settings import ProjectSettings
from app.document.storing.kept_json import kept_text, write_kept
from app.project.folders import FOLDERS
from app.project.opening.project_access import create_project, open_project, repair_project
from engine.errors import ProjectError

SETTINGS = ProjectSettings(capture="somewhere", fingerprint="abc")
LIVE = "clip-0001-r0003.safetensors"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A project."""
    create_project(tmp_path / "p", SETTINGS).close()
    return tmp_path / "p"


@pytest.fixture
def elsewhere(tmp_path: Path) -> Path:
    """A folder that has nothing to do with it, with files of somebody's and of the program's names."""
    place = tmp_path / "elsewhere"
    place.mkdir()
    for name in ("letter.txt", LIVE, ".partial-999999999-x", "0000.safetensors", "00000000.jsonl", "exchange.json"):
        (place / name).write_text(name)
    return place


def content(place: Path) -> dict[str, str]:
    return {path.name: path.read_text() for path in place.iterdir()}


@pytest.mark.parametrize("name", [*FOLDERS, "versions/0003"])
def test_a_folder_that_is_a_link_is_refused_and_what_lies_there_stays(folder: Path, elsewhere: Path, name: str):
    link = folder / name
    link.parent.mkdir(exist_ok=True)
    if link.is_dir():
        link.rename(folder / "before")
    link.symlink_to(elsewhere)
    before = content(elsewhere)
    for write in (open_project, repair_project):
        with pytest.raises(
            ProjectError, match=f'folder "{name}".*symbolic link.*link the whole project folder'
        ) as found:
            write(folder)
        assert found.value.path == link
    assert content(elsewhere) == before
    assert not (folder / "lock").exists()


@pytest.mark.parametrize("make", [os.mkfifo, Path.touch])
def test_what_is_no_folder_is_refused_without_waiting_for_it(folder: Path, make: Callable[[Path], None]):
    make(folder / "exchange")
    with pytest.raises(ProjectError, match='folder "exchange" cannot be used'):
        open_project(folder)


def test_a_project_that_is_a_link_itself_may_be_written(folder: Path, tmp_path: Path):
    (tmp_path / "link").symlink_to(folder)
    open_project(tmp_path / "link").close()


def test_only_what_the_program_makes_is_swept(folder: Path):
    stays = ["live/notes.txt", "live/clip-1.safetensors", ".partial-notes", "reports/.partial-x-report.html"]
    goes = [f"live/{LIVE}", "live/0001-final.safetensors", "live/000030-000035-final.safetensors"]
    goes += ["live/mended-0002.safetensors", "clips/.partial-999999999-0001.safetensors"]
    for name in (*stays, *goes):
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(name)
    copy = folder / ".partial-999999999-damaged-1" / "journal"
    copy.mkdir(parents=True)
    (copy / "00000000.jsonl").write_text("x")
    open_project(folder).close()
    assert [name for name in stays if not (folder / name).exists()] == []
    assert [name for name in goes if (folder / name).exists()] == []
    assert not copy.parent.exists()


@pytest.mark.parametrize("name", ["authorized_keys", "0000.txt", "none-3.safetensors", "../0000.safetensors"])
def test_an_exchange_takes_names_of_clips_only(folder: Path, name: str):
    (folder / "clips").mkdir()
    (folder / "exchange").mkdir()
    (folder / "exchange" / name).write_text("x")
    write_kept(folder / "exchange" / "exchange.json", kept_text({"files": [name]}))
    with pytest.raises(ProjectError, match="list of exchanged clips is damaged"):
        open_project(folder)
    assert list((folder / "clips").iterdir()) == []
    assert json.loads((folder / "exchange" / "exchange.json").read_text())["files"] == [name]
