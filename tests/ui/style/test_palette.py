"""Colours: words stand out from what is behind them in both themes, states stay apart for every eye, none is kept."""

from __future__ import annotations

import ast
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

from app.playback.modes.arrays import BACKGROUND
from ui.style import theme
from ui.style.palette import DARK, LIGHT, VOID, ThemeColors, contrast

UI = Path(__file__).resolve().parents[3] / "ui"
READABLE = 4.5
"""WCAG 2.1 AA for words of ordinary size."""
HUES = ("sky", "orange", "green", "yellow", "vermillion", "purple", "held_out")
SURFACES = ("backdrop", "panel", "popup", "raised")
# How the three cones' answers are mixed where one kind is missing, on linear RGB (Machado, Oliveira, Fernandes 2009).
SIMULATED = {
    "protanopia": [[0.152, 1.053, -0.205], [0.115, 0.786, 0.099], [-0.004, -0.048, 1.052]],
    "deuteranopia": [[0.367, 0.861, -0.228], [0.280, 0.673, 0.047], [-0.012, 0.043, 0.969]],
    "tritanopia": [[1.256, -0.077, -0.179], [-0.078, 0.931, 0.148], [0.005, 0.691, 0.304]],
}


@pytest.mark.parametrize("palette", [DARK, LIGHT], ids=lambda palette: palette.name)
def test_words_stand_out_from_what_is_behind_them(palette: ThemeColors) -> None:
    behind = {name: getattr(palette, name) for name in SURFACES}
    for word in ("text", "text_dim", *HUES):
        low = {name: contrast(getattr(palette, word), color) for name, color in behind.items()}
        assert min(low.values()) >= READABLE, (word, low)
    for name in ("raised_hover", "raised_active"):
        assert contrast(palette.text, getattr(palette, name)) >= READABLE
    for name in ("sky", "sky_light", "sky_dark"):
        assert contrast(palette.text_on_accent, getattr(palette, name)) >= READABLE
    assert contrast(palette.text_on_playhead, palette.playhead) >= READABLE


def test_words_over_a_picture_stand_out_from_their_plate() -> None:
    for word in ("text", "text_dim", *HUES):
        assert contrast(getattr(theme.ON_PICTURE, word), VOID) >= READABLE, word
    assert VOID[:3] == pytest.approx(BACKGROUND), "plates and what is behind a picture are the same"
    assert LIGHT.void == DARK.void == VOID


@pytest.mark.parametrize("palette", [DARK, LIGHT], ids=lambda palette: palette.name)
def test_states_of_clips_can_be_read_on_the_panel(palette: ThemeColors) -> None:
    for state, color in palette.clip_colors.items():
        assert contrast(color, palette.panel) >= READABLE, state


@pytest.mark.parametrize("eye", SIMULATED)
@pytest.mark.parametrize("palette", [DARK, LIGHT], ids=lambda palette: palette.name)
def test_what_is_done_what_runs_and_what_has_failed_differ_for_every_eye(palette: ThemeColors, eye: str) -> None:
    matrix = np.array(SIMULATED[eye])
    seen = {name: _lab(matrix @ _linear(getattr(palette, name))) for name in ("sky", "green", "vermillion")}
    for first, second in combinations(seen, 2):
        assert np.linalg.norm(seen[first] - seen[second]) > 12, (first, second)


def test_contrast_is_that_of_the_standard() -> None:
    black, white = (0.0, 0.0, 0.0, 1.0), (1.0, 1.0, 1.0, 1.0)
    assert contrast(black, white) == contrast(white, black) == pytest.approx(21.0)
    assert contrast(white, white) == 1.0
    grey = (0x76 / 255, 0x76 / 255, 0x76 / 255, 1.0)
    assert contrast(grey, white) == pytest.approx(4.54, abs=0.01)


def test_taking_a_palette_changes_every_colour_that_the_panels_look_up() -> None:
    try:
        theme.take(LIGHT)
        assert (theme.TEXT, theme.PANEL, theme.CLIP_COLORS["trained"]) == (LIGHT.text, LIGHT.panel, LIGHT.green)
        assert theme.status_color("failed") == LIGHT.vermillion
        assert theme.ON_PICTURE.text == DARK.text
    finally:
        theme.take(DARK)
    assert {name: getattr(theme, name) for name in theme.SWITCHED} == {
        name: getattr(DARK, name.lower()) for name in theme.SWITCHED
    }
    assert theme.named("light") is LIGHT
    assert theme.named("no such theme") is DARK


@pytest.mark.slow
def test_no_module_keeps_a_colour_of_the_theme() -> None:
    files = [path for path in UI.rglob("*.py") if path.name != "theme.py"]
    found = [f"{path.relative_to(UI)}:{line}" for path in files for line in kept_colors(path.read_text("utf-8"))]
    assert not found, f"these would stay dark in the light theme: {found}"
    assert list(kept_colors("def f(c=theme.TEXT): ...")) == [1], "the rule sees defaults of arguments"
    assert list(kept_colors("LOOK = {'a': theme.SKY}\ndef f(): return theme.SKY")) == [1], "and values of modules"
    assert list(kept_colors("from ui.style.theme import TEXT")) == [1], "and names that are imported"


def kept_colors(source: str) -> list[int]:
    """Lines that look a colour up when the module is loaded, and not when something is drawn."""
    lines: list[int] = []
    tree = ast.parse(source)
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module == "ui.style.theme":
            lines += [node.lineno for alias in node.names if alias.name in theme.SWITCHED]
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda):
            for default in [*node.args.defaults, *node.args.kw_defaults]:
                lines += _looked_up(default)
    for node in _run_at_import(tree):
        lines += _looked_up(node)
    return sorted(set(lines))


def _run_at_import(tree: ast.Module | ast.ClassDef) -> list[ast.AST]:
    nodes: list[ast.AST] = []
    for node in tree.body:
        if isinstance(node, ast.ClassDef):
            nodes += _run_at_import(node)
        elif not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Import | ast.ImportFrom):
            nodes.append(node)
    return nodes


def _looked_up(node: ast.AST | None) -> list[int]:
    if node is None:
        return []
    return [
        found.lineno
        for found in ast.walk(node)
        if isinstance(found, ast.Attribute)
        and isinstance(found.value, ast.Name)
        and found.value.id == "theme"
        and found.attr in theme.SWITCHED
    ]


def _linear(color: tuple[float, ...]) -> np.ndarray:
    values = np.array(color[:3])
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


def _lab(linear: np.ndarray) -> np.ndarray:
    """CIE L*a*b* of linear sRGB."""
    to_xyz = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
    x, y, z = np.cbrt(np.clip(to_xyz @ linear, 1e-6, None) / [0.9505, 1.0, 1.089])
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])
