"""The scripts of `clipgstream completion`: read by the shells themselves where they are installed."""

from __future__ import annotations

import argparse
import shutil
import subprocess
from collections.abc import Mapping

import pytest

from app.cli.arguments import PlainParser
from app.cli.installing.completion import SHELLS, completion_script
from ui import main as window

SUMMARIES = {"fly": "fly a kite", "edit": "change a kite's edits"}


@pytest.fixture
def parsers() -> dict[str, PlainParser]:
    """A window, a command with a choice, and one with verbs."""
    own, fly, edit, cut = (PlainParser(prog=name) for name in ("kites", "kites fly", "kites edit", "kites edit K cut"))
    own.add_argument("path", nargs="?")
    own.add_argument("--size", metavar="WxH")
    fly.add_argument("place", choices=("beach", "hill"))
    fly.add_argument("--wind", choices=("calm", "storm"), help="how it's blowing, 50 %% or 'more'")
    fly.add_argument("--far", action="store_true")
    fly.add_argument("--secret", help=argparse.SUPPRESS)
    edit.add_argument("kite")
    cut.add_argument("--tail", type=float)
    edit.verbs = {"cut": cut}
    return {"": own, "fly": fly, "edit": edit}


def offered(shell: str, parsers: Mapping[str, PlainParser], *words: str) -> set[str]:
    """Words that a shell offers for the last one of a line, files left out."""
    script = completion_script(shell, parsers, SUMMARIES)
    if shell == "fish":
        done = run(shell, f"{script}\ncomplete -C '{' '.join(words)}'")
        return {line.partition("\t")[0] for line in done.splitlines()}
    line = " ".join(f"'{word}'" for word in words)
    call = f"COMP_WORDS=({line}); COMP_CWORD={len(words) - 1}; _clipgstream; printf '%s\\n' \"${{COMPREPLY[@]}}\""
    return set(run(shell, f"{script}\n{call}").split())


def run(shell: str, text: str) -> str:
    """What a shell prints that reads this text."""
    program = shutil.which(shell)
    if program is None:
        pytest.skip(f"{shell} is not installed")
    done = subprocess.run([program], input=text, capture_output=True, text=True, timeout=600, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout


@pytest.mark.parametrize("shell", ["bash", "fish"])
@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("clipgstream", "f"), {"fly"}),
        (("clipgstream", "--s"), {"--size"}),
        (("clipgstream", "my-kite", "--s"), {"--size"}),
        (("clipgstream", "fly", "--f"), {"--far"}),
        (("clipgstream", "fly", "--se"), set()),
        (("clipgstream", "fly", "--wind", "s"), {"storm"}),
        (("clipgstream", "fly", "hi"), {"hill"}),
        (("clipgstream", "edit", "a-kite", "cu"), {"cut"}),
        (("clipgstream", "edit", "a-kite", "cut", "--t"), {"--tail"}),
        (("clipgstream", "fly", "--t"), set()),
    ],
)
def test_a_shell_offers_what_the_parsers_declare(
    shell: str, parsers: dict[str, PlainParser], words: tuple[str, ...], expected: set[str]
) -> None:
    assert offered(shell, parsers, *words) == expected


def test_bash_completes_a_value_behind_an_equals_sign(parsers: dict[str, PlainParser]) -> None:
    assert offered("bash", parsers, "clipgstream", "fly", "--wind", "=", "c") == {"calm"}
    assert offered("bash", parsers, "clipgstream", "fly", "--wind", "=") == {"calm", "storm"}


def test_zsh_registers_the_script_of_bash(parsers: dict[str, PlainParser]) -> None:
    text = completion_script("zsh", parsers, SUMMARIES)
    assert text.endswith(completion_script("bash", parsers, SUMMARIES))
    assert run("zsh", f"{text}\nprint -r -- $_comps[clipgstream]\n").startswith("_bash_complete")


@pytest.mark.slow
@pytest.mark.parametrize("shell", SHELLS)
def test_the_program_prints_a_script_of_all_commands(shell: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert window.main(["completion", shell]) == 0
    text = capsys.readouterr().out
    run(shell, text)
    for name, parser in window.all_parsers().items():
        assert f"'{name} --'" in text or f"'__clipgstream_after {name}".rstrip() in text
        assert all(option.lstrip("-") in text for option in parser.options_of(None))


def test_another_shell_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        window.main(["completion", "tcsh"])
    assert ended.value.code == 2
    assert "invalid choice: 'tcsh'" in capsys.readouterr().err
