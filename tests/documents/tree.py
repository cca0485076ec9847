"""The tree of ARCHITECTURE.md, made of the first sentences of packages and modules."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("engine", "app", "ui")
WIDTH = 28
"""Columns of a path; what a module is stands to the right of it."""


def first_sentence(path: Path) -> str:
    """The first line of a module's docstring without its full stop; empty where it has none."""
    text = ast.get_docstring(ast.parse(path.read_text("utf-8"))) or ""
    paragraph = " ".join(text.split("\n\n", 1)[0].split())
    return paragraph.split(". ", 1)[0].removesuffix(".").replace("`", "")


def tree_lines(folder: Path, depth: int = 0) -> Iterator[str]:
    """One line per package, and one per module with what it is: subpackages first, as they are the lower layers."""
    about = first_sentence(folder / "__init__.py")
    yield f"{'  ' * depth + folder.name + '/':{WIDTH}}{about}".rstrip()
    for inner in sorted(path for path in folder.iterdir() if (path / "__init__.py").exists()):
        yield from tree_lines(inner, depth + 1)
    for module in sorted(folder.glob("*.py")):
        if module.name != "__init__.py":
            yield f"{'  ' * (depth + 1) + module.name:{WIDTH}} {first_sentence(module)}".rstrip()


def tree_block() -> str:
    """The trees of all packages, as a fenced block."""
    trees = "\n\n".join("\n".join(tree_lines(ROOT / name)) for name in PACKAGES)
    return f"```\n{trees}\n```"
