"""The table of commands: every module is there, and none is imported before its command is used."""

import subprocess
import sys

import pytest

from app.cli.commands import COMMANDS


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


def test_only_the_command_in_use_is_imported() -> None:
    modules = {command.module for command in COMMANDS.values()}
    assert loaded_by() & modules == set()
    assert loaded_by("doctor") & modules == {COMMANDS["doctor"].module}
