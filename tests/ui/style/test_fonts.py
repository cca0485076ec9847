"""Fonts that are missing or damaged cost their letters, not the window."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

import imgui_bundle
import pytest
from imgui_bundle import imgui

from ui.style import fonts

FOLDER = Path(imgui_bundle.__file__).parent / "assets" / "fonts"
ROBOTO = FOLDER / "Roboto" / "Roboto-Regular.ttf"


@pytest.fixture(autouse=True)
def context() -> Iterator[None]:
    made = imgui.create_context()
    yield
    imgui.destroy_context(made)


def test_text_symbols_and_other_scripts_are_loaded() -> None:
    assert fonts.load_fonts().bold is not None


@pytest.mark.parametrize("damage", ["missing", "empty", "nonsense", "cut"])
@pytest.mark.parametrize("name", ["Roboto/Roboto-Bold.ttf", "Font_Awesome_6_Free-Solid-900.otf"])
def test_without_them_the_built_in_face_serves(tmp_path: Path, name: str, damage: str) -> None:
    for path in (ROBOTO, FOLDER / "Roboto" / "Roboto-Bold.ttf", FOLDER / "Font_Awesome_6_Free-Solid-900.otf"):
        copy = tmp_path / path.relative_to(FOLDER)
        copy.parent.mkdir(exist_ok=True)
        shutil.copy(path, copy)
    content = (tmp_path / name).read_bytes()
    {
        "missing": lambda path: path.unlink(),
        "empty": lambda path: path.write_bytes(b""),
        "nonsense": lambda path: path.write_bytes(b"not a font" * 1000),
        "cut": lambda path: path.write_bytes(content[:200]),
    }[damage](tmp_path / name)
    assert fonts.load_fonts(tmp_path).bold is None


def test_faces_of_the_system_are_taken_where_they_are(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    there = tmp_path / "there.ttf"
    shutil.copy(ROBOTO, there)
    broken = tmp_path / "broken.ttf"
    broken.write_bytes(b"x" * 5000)
    groups = ((str(tmp_path / "gone.ttf"), str(broken), str(there)), (str(tmp_path / "gone too.ttf"),))
    monkeypatch.setattr(fonts, "_SYSTEM_FONTS", groups)
    assert fonts.system_fonts() == [there]
    assert fonts.load_fonts().bold is not None
