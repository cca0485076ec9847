"""Is `train --plan --workers N` right? Forecast against real runs of one-core workers.

    python -m tests.benchmarks.bench_plan CAPTURE OUT [--scale 0.5] [--clip-length 5] [--workers 1,2]

The reference clip and one source clip are trained on one core first, so that the plan knows how fast one core is. For
each number of workers the project is copied, its other clips are planned, and then trained by as many workers on as
many cores. Needs a quiet machine with that many cores.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

from engine.clip_files.clip_state import read_clip_header
from tests.benchmarks.options import ending_on_bad_input
from tests.documents.table import table

BEFORE = 2
"""Clips trained before: the reference clip, and one of the others."""


def clipgstream(n_cores: int, *arguments: object) -> str:
    """Run a command on that many cores. Returns what it prints; a failure ends the program."""
    os.sched_setaffinity(0, set(range(n_cores)))
    code = "import sys; from app.cli.cli import main; sys.exit(main(sys.argv[1:]))"
    done = subprocess.run([sys.executable, "-c", code, *map(str, arguments)], stdout=subprocess.PIPE, text=True)
    if done.returncode:
        sys.exit(done.returncode)
    return done.stdout


def measure(project: Path, n_workers: int, arguments: tuple[object, ...]) -> dict[str, Any]:
    """Forecast and measurement of the clips that are left in a project."""
    what = (*arguments, "--project", project, "--clips", f"{BEFORE}:", "--workers", n_workers)
    plan = json.loads(clipgstream(1, *what, "--plan", "--json"))
    started_s = time.perf_counter()
    clipgstream(n_workers, *what, "--quiet")
    wall_s = time.perf_counter() - started_s
    files = sorted((project / "clips").glob("*.safetensors"))[BEFORE:]
    headers = [header for path in files if (header := read_clip_header(path)) is not None]
    return {
        "workers": n_workers,
        "clips": len(files),
        "forecast_s": plan["workers"]["seconds"],
        "wall_s": wall_s,
        "forecast_mb": plan["workers"]["memory_mb"],
        "memory_mb": max(header.figures.memory_mb or 0.0 for header in headers),
        "forecast_stored_mb": plan["forecast"]["disk_mb"],
        "stored_mb": sum(path.stat().st_size for path in files) / 1e6,
        "moved_mb": plan["workers"]["moved_mb"],
    }


def main() -> None:
    """Command line; see the module docstring."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("capture", type=Path)
    parser.add_argument("out", type=Path, help="folder of the projects, which must be new")
    parser.add_argument("--scale", default="0.5")
    parser.add_argument("--clip-length", default="5")
    parser.add_argument("--workers", default="1,2")
    parser.add_argument("--set", nargs="*", default=[], help="key=value settings")
    parser.add_argument("--json", type=Path, help="also write all figures here")
    options = parser.parse_args()
    arguments = ("train", options.capture, "--scale", options.scale, "--clip-length", options.clip_length)
    arguments += tuple(part for setting in options.set for part in ("--set", setting))
    first = options.out / "first"
    clipgstream(1, *arguments, "--project", first, "--clips", f"0:{BEFORE}", "--quiet")
    rows = []
    with ending_on_bad_input():
        for n_workers in map(int, options.workers.split(",")):
            shutil.copytree(first, options.out / f"workers-{n_workers}")
            rows.append(measure(options.out / f"workers-{n_workers}", n_workers, arguments))
    names = list(rows[0])
    print(table(names, [[f"{row[name]:.4g}" for name in names] for row in rows]))
    print(f"load {os.getloadavg()[0]:.1f}")
    if options.json:
        options.json.write_text(json.dumps(rows, indent=1) + "\n")


if __name__ == "__main__":
    main()
