"""Fonts of the window: text and symbols from the installed imgui-bundle, and faces of the system for scripts that those
have no letters of. Whatever is missing or damaged is left out; with nothing left, ImGui's built-in face serves.
"""

from __future__ import annotations

import logging
import os
from dataclasses import dataclass
from pathlib import Path

import imgui_bundle
from imgui_bundle import ImVec2, imgui

logger = logging.getLogger(__name__)

_FONT_STARTS = (b"\x00\x01\x00\x00", b"OTTO", b"true", b"ttcf")
"""TrueType, OpenType and collections of them."""
_SYSTEM_FONTS = (
    (  # Hebrew, Arabic, Greek, Cyrillic and more
        "/usr/share/fonts/truetype/dejavu/DejaVuSans.ttf",
        "/usr/share/fonts/dejavu-sans-fonts/DejaVuSans.ttf",
        "/usr/share/fonts/dejavu/DejaVuSans.ttf",
        "/usr/share/fonts/TTF/DejaVuSans.ttf",
        "/System/Library/Fonts/Supplemental/Arial Unicode.ttf",
        "{WINDIR}/Fonts/segoeui.ttf",
    ),
    (  # Chinese, Japanese and Korean
        "/usr/share/fonts/opentype/noto/NotoSansCJK-Regular.ttc",
        "/usr/share/fonts/noto-cjk/NotoSansCJK-Regular.ttc",
        "/usr/share/fonts/google-noto-cjk/NotoSansCJK-Regular.ttc",
        "/System/Library/Fonts/Hiragino Sans GB.ttc",
        "{WINDIR}/Fonts/msyh.ttc",
    ),
)
"""For each group of scripts, where a face for it may lie; the first that is there is taken."""


@dataclass(frozen=True)
class Fonts:
    """The loaded faces and the sizes used with them, in points of the logical window."""

    bold: imgui.ImFont | None = None
    body_size: float = 15.0
    small_size: float = 13.0
    title_size: float = 26.0


def load_fonts(folder: Path | None = None) -> Fonts:
    """Load all faces into the current context. folder: Of fonts; that of imgui-bundle when None."""
    folder = Path(imgui_bundle.__file__).parent / "assets" / "fonts" if folder is None else folder
    faces = [folder / "Roboto" / "Roboto-Regular.ttf", folder / "Roboto" / "Roboto-Bold.ttf"]
    icons = folder / "Font_Awesome_6_Free-Solid-900.otf"
    if not all(is_font(path) for path in (*faces, icons)):
        logger.info("Text fonts were not found beside imgui-bundle; using its built-in face - %s", folder)
        return Fonts()
    others = system_fonts()
    loaded = []
    for face in faces:  # the first one loaded is the default of the context
        loaded.append(imgui.get_io().fonts.add_font_from_file_ttf(str(face), Fonts.body_size))
        symbols = imgui.ImFontConfig()
        symbols.glyph_min_advance_x = Fonts.body_size
        symbols.glyph_offset = ImVec2(0.0, 1.0)
        _merge(icons, Fonts.body_size - 2.0, symbols)
        for other in others:
            _merge(other, Fonts.body_size, imgui.ImFontConfig())
    return Fonts(bold=loaded[1])


def system_fonts() -> list[Path]:
    """Faces of the system for scripts that the text font lacks, those that are there."""
    folders = {"WINDIR": os.environ.get("WINDIR", "")}
    groups = [[Path(path.format_map(folders)) for path in group] for group in _SYSTEM_FONTS]
    return [found for group in groups if (found := next(filter(is_font, group), None)) is not None]


def is_font(path: Path) -> bool:
    """Does a file hold a font, by its first bytes? ImGui ends the program over one that does not."""
    try:
        with path.open("rb") as file:
            return file.read(4) in _FONT_STARTS and path.stat().st_size > 1000
    except OSError:
        return False


def _merge(path: Path, size: float, config: imgui.ImFontConfig) -> None:
    """Add the letters of a face that the one before lacks."""
    config.merge_mode = True
    imgui.get_io().fonts.add_font_from_file_ttf(str(path), size, config)
