"""Text of files and paths in messages: nothing a terminal obeys, nothing endless."""

from __future__ import annotations

from pathlib import Path

import pytest

from engine.errors import CaptureError, EngineError
from engine.text import MAX_SHOWN, duration_text, figure_text, printable, shown, size_text


def test_ordinary_text_stays_as_it_is() -> None:
    for text in ("cam 00", "Kamera Süd", "摄像机 3", "two\nlines"):
        assert printable(text) == text


def test_what_a_terminal_obeys_is_written_as_an_escape() -> None:
    assert printable("\x1b[31mred\x07") == "\\x1b[31mred\\x07"
    assert printable("a\u202eb") == "a\\u202eb"
    assert printable("half \ud800").encode("utf-8") == b"half \\ud800"


def test_values_are_cut_off() -> None:
    assert shown(30) == "30"
    assert shown("fast") == "'fast'"
    assert len(shown("x" * 5_000_000)) == len(shown([1] * 1000)) == MAX_SHOWN


def test_messages_hold_nothing_that_a_terminal_obeys() -> None:
    error = EngineError("Camera \x1b[2J.", hint="Rename \ud800.", path=Path("/data/a\nb\x1b"))
    for text in (str(error), *error.parts()):
        assert text.isprintable()
        text.encode("utf-8")
    assert "a\\nb\\x1b" in str(error)


def test_a_thousand_problems_do_not_fill_the_screen() -> None:
    error = CaptureError("Many.", problems=[CaptureError(f"Problem {i}.") for i in range(1000)])
    assert len(error.problems) == 1000
    assert len(str(error).splitlines()) == 22
    assert str(error).endswith("and 980 more like these.")


@pytest.mark.parametrize(
    ("seconds", "expected"),
    [
        (0, "0:00"),
        (61.4, "1:01"),
        (3599.4, "59:59"),
        (3599.6, "1 h 00 min"),
        (3725, "1 h 02 min"),
        (None, "–"),
        (-1, "–"),
        (float("nan"), "–"),
        (1e9, "–"),
    ],
)
def test_durations(seconds, expected):
    assert duration_text(seconds) == expected


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0, "0"), (0.01234, "0.0123"), (23.14, "23.1"), (1374.6, "1,375"), (-2.5, "-2.50"), (6.6e-7, "0.000001")],
)
def test_figures_have_three_digits_and_no_exponent(value: float, text: str) -> None:
    assert figure_text(value) == text


def test_a_size_is_never_nothing():
    said = [size_text(megabytes) for megabytes in (0.024, 0.06, 3.21, 24.4, 1500)]
    assert said == ["24 kB", "0.1 MB", "3.2 MB", "24 MB", "1.5 GB"]
