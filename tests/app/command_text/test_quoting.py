"""Quoting: what a shell makes of a line is what was meant, whatever is in it."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

from app.command_text.quoting import can_be_argument, number, option, shell_line
from tests.app.command_text.documents import HARD_NAMES

TELL = "import json, sys; print(json.dumps([sys.argv[1:], sys.stdin.read()]))"


def test_a_shell_gives_back_what_was_meant():
    arguments, stdin = [sys.executable, "-c", TELL, *HARD_NAMES], '{"a": "it\'s $HOME \\\\ `x` %s"}'
    done = subprocess.run(["sh", "-c", shell_line(arguments, stdin, is_windows=False)], capture_output=True, check=True)
    assert json.loads(done.stdout) == [list(HARD_NAMES), stdin + "\n"]


@pytest.mark.parametrize(
    ("text", "quoted"),
    [
        ("plain", "plain"),
        ("--delete", "--delete"),
        (r"a b\c", r"'a b\c'"),
        ("it's", "'it''s'"),
        ("100 %", "'100 %'"),
        ("a\nb", "'a\nb'"),
        ("-x y", "'-x y'"),
        ("\u2019", "'\u2019\u2019'"),
        ("$env:X", "'$env:X'"),
        ("", "''"),
    ],
)
def test_powershell(text, quoted):
    assert shell_line(["clipgstream", text], is_windows=True) == f"clipgstream {quoted}"


def test_powershell_takes_input_from_the_left():
    assert shell_line(["clipgstream", "-"], "{}", is_windows=True) == "'{}' | clipgstream '-'"


@pytest.mark.parametrize("value", [0.1, -1e-5, 1e-300, 1e22, 123456789.125, -0.0, 5.0])
def test_numbers_are_exact_and_have_no_exponent(value):
    assert float(number(value)) == value
    assert "e" not in number(value)


def test_what_looks_like_an_option():
    assert option("--name", "-x") == ("--name=-x",)
    assert option("--name", "x") == ("--name", "x")


def test_what_no_argument_can_hold():
    assert not can_be_argument("a\0b")
    assert not can_be_argument("\ud800")
    assert can_be_argument("a\nb")
