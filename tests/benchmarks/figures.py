"""Measures the figures of the first table of docs/results.md, and writes them to the ledger in docs/results.

    python -m tests.benchmarks.figures OUT sample
    python -m tests.benchmarks.figures OUT basketball --capture PATH [--remark TEXT] [--commit HASH]

Trains the first clips of a capture as a project in OUT/NAME, measures it (OUT/NAME.json), and writes the file
docs/results/NAME.json; then fill the documents with `make docs`. A project that is trained there already is only
measured, and measurements that are there are taken as they are: give the commit that they are of. `make figures` does
all this for the sample.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from app.cli.cli import main as clipgstream
from app.lab.machine import describe_machine
from app.project.opening.project_access import open_project
from engine.clip_files.clip_state import read_clip_header
from tests.documents.ledger import SCHEMA, ClipRow, Entry, write_entry

ROOT = Path(__file__).resolve().parents[2]


@dataclass(frozen=True, slots=True)
class Measured:
    """What is trained of a capture. A value.

    Attributes:
        title: Of the capture, for a table.
        clips: First clip and the one behind the last.
        holdout: Cameras that training leaves out; "" takes those of the capture.
        capture: Where it is, if the project has it.
    """

    title: str
    clips: str
    holdout: str = ""
    capture: Path | None = None


CAPTURES = {
    "sample": Measured("sample, 320x240, 18 training cameras", "0:2", capture=ROOT / "assets" / "sample"),
    "basketball": Measured("CMU Panoptic basketball, 640x360, 27 training cameras", "0:4", "0,10,15,30"),
}
_FIGURES = ("psnr", "psnr_fit", "psnr_moving", "psnr_rest", "psnr_fit_rest", "ssim", "flip")


def main() -> None:
    """Measure one capture."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("name", choices=CAPTURES)
    parser.add_argument("--capture", type=Path)
    parser.add_argument("--remark", default="")
    parser.add_argument("--commit")
    arguments = parser.parse_args()
    what = CAPTURES[arguments.name]
    capture = arguments.capture or what.capture
    if capture is None:
        parser.error(f"{arguments.name} does not come with the program: give its folder with --capture")
    commit = arguments.commit or _commit()
    project, figures = arguments.out / arguments.name, arguments.out / f"{arguments.name}.json"
    options = ["--clips", what.clips, *(["--holdout", what.holdout] if what.holdout else [])]
    if not figures.exists():
        for command in (
            ["train", str(capture), "--project", str(project), *options],
            ["eval", str(project), "--json", str(figures)],
        ):
            if code := clipgstream(command):
                sys.exit(code)
    commands = [f"clipgstream train CAPTURE --project DIR {' '.join(options)}", "clipgstream eval DIR --json FILE"]
    made = Entry(
        schema=SCHEMA,
        title=what.title,
        commands=commands,
        commit=commit,
        day=datetime.fromtimestamp(figures.stat().st_mtime, UTC).date().isoformat(),
        machine=_machine(),
        seed=0,
        remark=arguments.remark,
        rows=_rows(project, json.loads(figures.read_text("utf-8"))),
    )
    sys.stdout.write(f"{write_entry(arguments.name, made)}\n")


def _rows(folder: Path, document: dict[str, Any]) -> list[ClipRow]:
    project = open_project(folder, is_writable=False)
    held_out = [row for row in document["rows"] if row["is_held_out"]]
    found = []
    for clip_index in document["clips"]:
        pictures = [row for row in held_out if row["clip_index"] == clip_index]
        header, path = read_clip_header(project.clip_path(clip_index)), project.clip_path(clip_index)
        assert header is not None
        assert header.metrics is not None
        means = {kind: _mean([row[kind] for row in pictures]) for kind in _FIGURES}
        found.append(
            ClipRow(
                clip_index=clip_index,
                is_reference=header.role == "reference",
                n_pictures=len(pictures),
                preparation_s=round(header.metrics.preparation_s or 0.0, 1),
                training_s=round(header.metrics.training_s or 0.0, 1),
                n_bytes=path.stat().st_size,
                **means,
            )
        )
    return found


def _mean(values: list[float | None]) -> float:
    return round(float(np.mean([value for value in values if value is not None])), 4)


def _machine() -> str:
    found = describe_machine(2)
    return f"{found.cpu}, {found.n_cores} cores, Python {found.python}, torch {found.torch}, numba {found.numba}"


def _commit() -> str:
    """The commit of the code. Exits where files of the engine or the app differ from it."""
    changed = subprocess.run(
        ["git", "status", "--porcelain", "engine", "app"], cwd=ROOT, capture_output=True, text=True
    )
    if changed.stdout:
        sys.exit(f"Commit these first, so that figures have a commit:\n{changed.stdout}")
    found = subprocess.run(["git", "rev-parse", "--short=8", "HEAD"], cwd=ROOT, capture_output=True, text=True)
    return found.stdout.strip()


if __name__ == "__main__":
    main()
