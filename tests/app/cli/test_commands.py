"""The table of commands: every module is there, and none is imported before its command is used."""

import argparse
import subprocess
import sys
from types import ModuleType

import pytest

from app.cli.cli import build_parser
from app.cli.commands import COMMANDS, Command
from tests.documents.commands import command_sections
from ui import main as window


def loaded_by(*arguments: str) -> set[str]:
    """First-party modules that a fresh interpreter holds after the command line has parsed these arguments."""
    code = (
        "import sys\nfrom app.cli.cli import build_parser\n"
        f"build_parser(used={list(arguments)!r})\nprint(*sys.modules, sep='\\n')"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return {name for name in done.stdout.split() if name.split(".")[0] in ("app", "engine", "ui")}


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_has_a_module_with_arguments_and_work(name: str) -> None:
    module = COMMANDS[name].load()
    assert callable(module.add_arguments)
    assert callable(module.run)


@pytest.mark.slow
def test_only_the_command_in_use_is_imported() -> None:
    modules = {command.module for command in COMMANDS.values()}
    assert loaded_by() & modules == set()
    assert loaded_by("doctor") & modules == {COMMANDS["doctor"].module}


@pytest.fixture
def kites(monkeypatch: pytest.MonkeyPatch) -> None:
    """A made-up command, declared as any other: a module, and a row of the table."""
    module = ModuleType("app.cli.kites_command")

    def add_arguments(command: argparse.ArgumentParser) -> None:
        command.add_argument("--tail", type=float, metavar="M", help="length of the tail")

    def run(options: argparse.Namespace, launch: object) -> int:
        sys.stdout.write(f"a kite with {options.tail:g} m of tail\n")
        return 0

    monkeypatch.setattr(module, "add_arguments", add_arguments, raising=False)
    monkeypatch.setattr(module, "run", run, raising=False)
    monkeypatch.setitem(sys.modules, module.__name__, module)
    monkeypatch.setitem(COMMANDS, "kites", Command("fly kites", module.__name__, has_backend=True))


@pytest.mark.usefixtures("kites")
def test_a_command_is_in_every_layer(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    back_ends: list[str] = []
    monkeypatch.setattr("app.cli.cli.choose_backend", back_ends.append)
    assert "  clipgstream kites    fly kites" in window.build_parser().format_help()
    assert " kites " in build_parser(used=()).format_help()
    sections = command_sections()
    assert "### `clipgstream kites [options]`\n\nFly kites." in sections
    assert "| `--tail M` | length of the tail |" in sections
    assert window.main(["kites", "--tail", "2", "--backend", "reference"]) == 0
    assert back_ends == ["reference"]
    assert capsys.readouterr().out == "a kite with 2 m of tail\n"
    assert window.main(["kites", "--tial", "2"]) == 2
    assert "Did you mean --tail?" in capsys.readouterr().err
    with pytest.raises(SystemExit):
        window.main(["kite"])
    assert "kites" in capsys.readouterr().err
