"""The entry in the menu of a desktop: what is written, how the program is named in it, and that nothing stays."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

from app.cli.installing import desktop
from engine.assets import asset_path
from engine.errors import DiskError, ProjectError
from engine.importing.suffixes import SEQUENCE_SUFFIXES
from ui import main as window

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="entries of a Linux desktop")


@pytest.fixture
def data_home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty data folder of a user, with a name that needs care."""
    folder = tmp_path / "a $HOME of 100 %"
    monkeypatch.setenv("XDG_DATA_HOME", str(folder))
    monkeypatch.setenv("PATH", "")  # no program of a desktop
    return folder


def files_below(folder: Path) -> set[str]:
    """Files of a data folder, without the program's own log."""
    found = {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}
    return {name for name in found if not name.startswith("ClipGStream/")}


def test_installing_twice_leaves_one_entry_and_removing_nothing(
    data_home: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other = data_home / "applications" / "other.desktop"
    other.parent.mkdir(parents=True)
    other.touch()
    for _ in range(2):
        assert window.main(["desktop", "install"]) == 0
        assert files_below(data_home) == {
            "applications/other.desktop",
            "applications/clipgstream.desktop",
            "icons/hicolor/scalable/apps/clipgstream.svg",
            "mime/packages/clipgstream.xml",
        }
    assert capsys.readouterr().out.count("wrote ") == 6
    assert window.main(["desktop", "remove"]) == 0
    assert files_below(data_home) == {"applications/other.desktop"}
    assert window.main(["desktop", "remove"]) == 0
    assert "removed nothing" in capsys.readouterr().out


def test_the_program_is_quoted_as_the_specification_asks() -> None:
    text = desktop.desktop_entry(['/opt/100 % "$5" `a\\b`/clipgstream'])
    assert 'Exec="/opt/100 %% \\\\"\\\\$5\\\\" \\\\`a\\\\\\\\b\\\\`/clipgstream" %f\n' in text
    assert 'TryExec=/opt/100 % "$5" `a\\\\b`/clipgstream\n' in text


@pytest.mark.skipif(shutil.which("desktop-file-validate") is None, reason="desktop-file-validate is not installed")
def test_the_validator_accepts_the_entry(tmp_path: Path) -> None:
    path = tmp_path / "clipgstream.desktop"
    path.write_text(desktop.desktop_entry(["/opt/a $b/clipgstream"]))
    done = subprocess.run(["desktop-file-validate", path], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout + done.stderr) == (0, "")


def test_the_entry_opens_the_kinds_that_are_declared() -> None:
    tree = ElementTree.parse(asset_path("desktop", "clipgstream.xml"))
    names = [kind.get("type") for kind in tree.iter() if kind.tag.endswith("mime-type")]
    assert tuple(names) == desktop.MIME_TYPES
    ends = [glob.get("pattern", "").removeprefix("*") for glob in tree.iter() if glob.tag.endswith("glob")]
    assert set(ends) <= set(SEQUENCE_SUFFIXES)
    assert f"MimeType={';'.join(desktop.MIME_TYPES)};\n" in desktop.desktop_entry(["clipgstream"])


@pytest.mark.skipif(shutil.which("update-mime-database") is None, reason="update-mime-database is not installed")
def test_a_desktop_recognises_the_files_until_they_are_removed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    desktop.install()
    globs = tmp_path / "mime" / "globs2"
    assert "application/x-4dgs:*.4dgs" in globs.read_text()
    desktop.remove()
    assert not globs.exists() or "4dgs" not in globs.read_text()


def test_the_program_is_named_so_that_it_starts_from_anywhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    script = tmp_path / "clipgstream"
    script.write_text("#!/bin/sh\n")
    script.chmod(0o755)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["./clipgstream"])
    assert desktop.program_words() == [str(script)]
    monkeypatch.setattr(sys, "argv", [str(tmp_path / "ui" / "__main__.py")])
    assert desktop.program_words() == [sys.executable, "-P", "-m", "ui"]


def test_the_icon_is_a_picture_of_plain_shapes() -> None:
    tree = ElementTree.parse(asset_path("desktop", "clipgstream.svg"))
    names = {element.tag.rpartition("}")[2] for element in tree.iter()}
    assert {"svg", "ellipse"} <= names
    assert not names & {"script", "image", "use", "foreignObject"}


@pytest.mark.usefixtures("data_home")
def test_other_systems_are_refused(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(desktop.sys, "platform", "win32")
    with pytest.raises(ProjectError, match="Only Linux"):
        desktop.install()


def test_a_disk_that_refuses_is_named(data_home: Path) -> None:
    data_home.parent.joinpath(data_home.name).write_text("a file in place of the folder")
    with pytest.raises(DiskError):
        desktop.install()
    with pytest.raises(DiskError):
        desktop.remove()
