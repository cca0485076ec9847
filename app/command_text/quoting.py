"""Arguments quoted for a shell: spaces, quotes, line breaks, percent signs."""

from __future__ import annotations

import re
import shlex
import sys
from collections.abc import Sequence
from decimal import Decimal

_PLAIN_IN_POWERSHELL = re.compile(r"[\w:./\\+=@-]+")
END = "END_OF_INPUT"
"""Ends the standard input in a command; the input is JSON in one line, which never equals this."""


def can_be_argument(text: str) -> bool:
    """Whether a program can be given this text at all."""
    try:
        text.encode("utf-8")
    except UnicodeEncodeError:  # half a character
        return False
    return "\0" not in text


def shell_line(arguments: Sequence[str], stdin: str = "", *, is_windows: bool = sys.platform == "win32") -> str:
    """A command that can be pasted.

    Args:
        arguments: The program and its arguments.
        stdin: One line that it reads from standard input; empty for none.
        is_windows: For PowerShell rather than for sh, bash or zsh.
    """
    if is_windows:
        line = " ".join(_powershell(argument) for argument in arguments)
        return f"{_powershell(stdin)} | {line}" if stdin else line
    line = shlex.join(arguments)
    return f"{line} <<'{END}'\n{stdin}\n{END}\n" if stdin else line


def _powershell(argument: str) -> str:
    if _PLAIN_IN_POWERSHELL.fullmatch(argument) and not argument.startswith(("-", "@")):
        return argument
    if re.fullmatch(r"--[a-z][a-z-]*", argument):
        return argument
    return "'" + re.sub("(['\u2018\u2019\u201a\u201b])", r"\1\1", argument) + "'"


def number(value: float) -> str:
    """A number, exactly, without an exponent: argparse takes -1e-05 for an option."""
    text = repr(value)
    return format(Decimal(text), "f") if "e" in text else text


def option(name: str, value: str) -> tuple[str, ...]:
    """An option and its text, which may look like an option itself."""
    return (f"{name}={value}",) if value.startswith("-") else (name, value)
