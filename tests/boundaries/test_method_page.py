"""docs/method.md leads a reader to what is there: symbols stand in the files beside them, commands are understood."""

from __future__ import annotations

import ast
import re
import shlex
from collections.abc import Iterator

import pytest

from app.cli.cli import build_parser
from app.cli.commands import COMMANDS
from app.lab.ablation.variants import chosen_variants
from tests.documents.blocks import ROOT

TEXT = (ROOT / "docs/method.md").read_text("utf-8")
PLACES = re.compile(r"\[[\w.]+\]\(\.\./(?P<path>[\w/]+\.py)\): (?P<names>`[\w.]+`(?:, `[\w.]+`)*)")
COMMAND = re.compile(r"^(clipgstream .+)$|`(clipgstream [^`]+)`", re.MULTILINE)


def places() -> list[tuple[str, str]]:
    """File and symbol, for every symbol that a file is linked for."""
    return [(place["path"], name) for place in PLACES.finditer(TEXT) for name in re.findall(r"[\w.]+", place["names"])]


def commands() -> list[str]:
    """Every command of the page."""
    return [line or inline for line, inline in COMMAND.findall(TEXT)]


def defined(body: list[ast.stmt], prefix: str = "") -> Iterator[str]:
    """Names of functions, classes, their methods, and constants of a module."""
    for node in body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            yield prefix + node.name
            if isinstance(node, ast.ClassDef):
                yield from defined(node.body, f"{node.name}.")
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            yield from (prefix + target.id for target in targets if isinstance(target, ast.Name))


@pytest.mark.parametrize(("path", "name"), places())
def test_a_symbol_is_in_the_file_beside_it(path: str, name: str) -> None:
    assert name in set(defined(ast.parse((ROOT / path).read_text("utf-8")).body))


@pytest.mark.parametrize("command", commands())
def test_a_command_is_understood(command: str) -> None:
    arguments = shlex.split(command)[1:]
    if len(arguments) < 2:  # the name of a command alone
        assert not arguments or arguments[0] in COMMANDS
        return
    options = build_parser(used=COMMANDS).parse_args(arguments)
    if getattr(options, "variants", None):
        chosen_variants(options.variants.split(","))


def test_equations_and_tables_are_all_there() -> None:
    """The paper has thirteen equations, nine figures and six tables."""
    assert len(places()) > 20
    assert len(commands()) > 10
    equations = _first_cells("## Equations")
    assert sorted(number for cell in equations for number in _numbers(cell)) == list(range(1, 14))
    assert {number for cell in _first_cells("## Figures") for number in _numbers(cell)} == set(range(1, 10))
    assert {number for cell in _first_cells("## Tables") for number in _numbers(cell.split(",")[0])} == set(range(1, 7))


def _first_cells(heading: str) -> list[str]:
    """First cells of the rows of the table under a heading, without its two lines of head."""
    section = TEXT.split(f"{heading}\n", 1)[1].split("\n## ", 1)[0]
    return [line.split("|")[1].strip() for line in section.splitlines() if line.startswith("| ") and line[2].isdigit()]


def _numbers(cell: str) -> list[int]:
    return [int(number) for number in re.findall(r"\d+", cell)]
