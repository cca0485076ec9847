"""Prints how many lines of source (without the lab) and of tests there are, for `make test`."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


def _files(folder: Path) -> Iterator[Path]:
    return (path for path in folder.rglob("*.py") if "node_modules" not in path.parts)


def _n_lines(files: Iterator[Path]) -> int:
    return sum(path.read_bytes().count(b"\n") for path in files)


def main() -> None:
    """Print one line."""
    lab = ROOT / "app" / "lab"
    source = _n_lines(
        path for name in ("app", "engine", "ui") for path in _files(ROOT / name) if lab not in path.parents
    )
    counts = f"{source:,} lines of source outside app/lab, {_n_lines(_files(ROOT / 'tests')):,} of tests"
    sys.stdout.write(f"{counts}\n")


if __name__ == "__main__":
    main()
