"""Where no window can be opened the program says why and ends; faults of the program stay what they are."""

from __future__ import annotations

import argparse

import pytest

from ui import main
from ui.shell import no_window


class ContextException(Exception):
    """Named like pyglet's."""


class NoSuchDisplayException(Exception):
    """Likewise."""


class DriverError(Exception):
    """As moderngl raises it."""


DriverError.__module__ = "moderngl"


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (ContextException("Could not create GL context"), "no OpenGL 3.3"),
        (DriverError("cannot detect OpenGL version"), "no OpenGL 3.3"),
        (NoSuchDisplayException('Cannot connect to "None"'), "display :7 does not answer"),
        (ImportError('Library "GL" not found.'), 'Library "GL" not found.'),
    ],
)
def test_the_reason_is_said_in_plain_words_and_the_program_ends_with_1(
    error: Exception, said: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail(options: argparse.Namespace) -> int:
        raise error

    shown: list[str] = []
    monkeypatch.setenv("DISPLAY", ":7")
    monkeypatch.setattr(main, "_serve_window", fail)
    monkeypatch.setattr(no_window, "_show_dialog", shown.append)
    assert main._run_window(argparse.Namespace()) == 1
    written = capsys.readouterr().err
    assert said in written
    assert "doctor" in written
    assert "Traceback" not in written
    assert len(shown) == 1
    assert said in shown[0]


def test_a_fault_of_the_program_is_not_taken_for_a_missing_driver(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(options: argparse.Namespace) -> int:
        raise ValueError("broken on purpose")

    monkeypatch.setattr(main, "_serve_window", fail)
    with pytest.raises(ValueError, match="on purpose"):
        main._run_window(argparse.Namespace())
