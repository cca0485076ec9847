"""What the command lines of the kernel benchmarks share: options, progress on standard error, table and JSON."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from app.lab.bench.suite import Plan, document, run_plan
from app.lab.bench.table import report_text
from engine.errors import EngineError


def make_parser(description: str | None, *, n_runs: int) -> argparse.ArgumentParser:
    """--runs, --threads and --json; the caller adds its own."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=n_runs, help="runs that count")
    parser.add_argument("--threads", type=int, default=None, help="every core by default")
    parser.add_argument("--json", type=Path, help="also write all figures here")
    return parser


def names(text: str, known: list[str], parser: argparse.ArgumentParser) -> tuple[str, ...]:
    """Names separated by commas; unknown ones end the program."""
    chosen = tuple(part.strip() for part in text.split(",") if part.strip())
    unknown = [name for name in chosen if name not in known]
    if unknown:
        parser.error(f"there is no {', '.join(unknown)}; known are {', '.join(known)}")
    return chosen


@contextmanager
def ending_on_bad_input() -> Iterator[None]:
    """What the engine says of a capture or a setting ends the program with one message and code 2."""
    try:
        yield
    except EngineError as error:
        print(error, file=sys.stderr)
        sys.exit(2)


def run(plan: Plan, options: argparse.Namespace) -> None:
    """Measure, print the table, write the JSON."""
    report = run_plan(plan, n_threads=options.threads, say=lambda what, done: print(what, file=sys.stderr))
    print(report_text(report))
    if options.json:
        options.json.write_text(json.dumps(document(report), indent=2) + "\n")
