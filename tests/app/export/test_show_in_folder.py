"""The system's file manager, made up: what it is told, and what is said where there is none."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from app.export.show_in_folder import show_in_folder
from engine.errors import ProjectError

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="other systems bring their own")


def make_manager(folder: Path, monkeypatch: pytest.MonkeyPatch, code: int) -> Path:
    """An xdg-open that writes down what it was asked for."""
    told = folder / "told"
    program = folder / "bin" / "xdg-open"
    program.parent.mkdir()
    program.write_text(f'#!/bin/sh\nprintf "%s" "$1" > "{told}"\nexit {code}\n')
    program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{program.parent}:/usr/bin:/bin")
    return told


def test_the_folder_of_a_file_and_a_folder_itself_are_shown(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    told = make_manager(tmp_path, monkeypatch, 0)
    folder = tmp_path / "a $(touch x) ; b"
    folder.mkdir()
    (folder / "m.csv").write_text("m")
    show_in_folder(folder / "m.csv")
    assert told.read_text() == str(folder)
    show_in_folder(folder)
    assert told.read_text() == str(folder)
    assert not Path("x").exists()


def test_what_fails_is_said_with_the_place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    make_manager(tmp_path, monkeypatch, 3)
    with pytest.raises(ProjectError, match="ended with code 3") as raised:
        show_in_folder(tmp_path)
    assert raised.value.path == tmp_path
    with pytest.raises(ProjectError, match="no longer exists"):
        show_in_folder(tmp_path / "gone")
    monkeypatch.setenv("PATH", str(tmp_path / "nothing"))
    with pytest.raises(ProjectError, match="No file manager"):
        show_in_folder(tmp_path)
