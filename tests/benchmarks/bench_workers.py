"""How much faster several workers train the clips of a capture than one, and whether they train the same clips.

    python -m tests.benchmarks.bench_workers OUT                         # the shipped sample
    python -m tests.benchmarks.bench_workers OUT CAPTURE --scale 0.5 --frames 0:36 --clip-length 4
    python -m tests.benchmarks.bench_workers OUT --set passes=0.1 --clips 3     # only to see that it works

Every way trains the reference clip and then, from a copy of one project in which that is done, all other clips, each by
`clipgstream train`, and is timed from the start of the command to its end. A way is a number of cores that the program
may use and a number of workers. Ways are measured one after the other, so the machine has to be quiet; OUT must not
exist.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

from app.lab.machine import describe_machine
from app.project.opening.opening import open_capture_of
from app.project.opening.project_access import open_project
from engine.assets import asset_path
from engine.clip_files.clip_state import read_clip_state
from engine.parallel import CORES_VARIABLE
from tests.benchmarks.options import ending_on_bad_input

ROOT = Path(__file__).resolve().parents[2]
RUN = "import sys; from app.cli.cli import main; sys.exit(main())"


@dataclass(frozen=True, slots=True)
class Way:
    """Cores that the program may use, and workers on them."""

    n_cores: int
    n_workers: int

    def __str__(self) -> str:
        workers = f"{self.n_workers} worker{'s' if self.n_workers > 1 else ''}"
        return f"{workers} on {self.n_cores} core{'s' if self.n_cores > 1 else ''}"


ONE, TWO, FOUR, THREADED = Way(1, 1), Way(2, 2), Way(2, 4), Way(2, 1)
RATIOS = {
    "two one-core workers against one": (ONE, TWO),
    "two workers against one with both cores": (THREADED, TWO),
    "four workers against two, on two cores": (TWO, FOUR),
}
"""How many times faster the second way of each is."""


@dataclass(frozen=True, slots=True)
class Timed:
    """Seconds of the reference clip and of the others, and fingerprints of all clips."""

    reference_s: float
    others_s: float
    fingerprints: tuple[str, ...]


def train(way: Way, folder: Path, arguments: list[str], clips: str) -> float:
    """Train clips of a project. Returns seconds; ends the program where that fails."""
    environment = {name: value for name, value in os.environ.items() if name != "NUMBA_NUM_THREADS"}
    command = [sys.executable, "-P", "-c", RUN, "train", *arguments, "--project", str(folder), "--clips", clips]
    started_s = time.perf_counter()
    done = subprocess.run(
        [*command, "--workers", str(way.n_workers)],
        env=environment | {"PYTHONPATH": str(ROOT), CORES_VARIABLE: str(way.n_cores)},
        stdin=subprocess.DEVNULL,
        check=False,
    )
    if done.returncode:
        sys.exit(done.returncode)
    return time.perf_counter() - started_s


def prints_of(folder: Path, clips: range) -> tuple[str, ...]:
    """Fingerprints of trained clips of a project."""
    project = open_project(folder, is_writable=False)
    return tuple(read_clip_state(project.clip_path(index)).fingerprint for index in clips)


def measure(out: Path, arguments: list[str], n_wanted: int | None) -> dict[Way, Timed]:
    """Train in every way. n_wanted: How many clips; all when None."""
    first = out / "first"
    train(THREADED, first, arguments, "0")  # compiles what is not compiled yet, so that no way has to
    project = open_project(first, is_writable=False)
    clips = range(n_wanted or len(project.clips(open_capture_of(project.settings, first).n_frames)))
    found: dict[Way, Timed] = {}
    references: dict[int, tuple[float, tuple[str, ...]]] = {}  # it trains alone, whatever the number of workers
    for way in (ONE, TWO, FOUR, THREADED):
        print(way, file=sys.stderr)
        if way.n_cores not in references:
            alone = out / f"reference-{way.n_cores}"
            references[way.n_cores] = train(way, alone, arguments, "0"), prints_of(alone, clips[:1])
        reference_s, prints = references[way.n_cores]
        folder = out / f"{way.n_workers}-workers-{way.n_cores}-cores"
        shutil.copytree(first, folder)
        others_s = train(way, folder, arguments, f"1:{clips.stop}")
        found[way] = Timed(reference_s, others_s, prints + prints_of(folder, clips[1:]))
    return found


def table(found: dict[Way, Timed]) -> str:
    """Seconds of every way, ratios, and which clips differ."""
    lines = [f"{'':<20}{'reference s':>12}{'others s':>10}{'together s':>12}"]
    for way, timed in found.items():
        together_s = timed.reference_s + timed.others_s
        lines.append(f"{way!s:<20}{timed.reference_s:>12.1f}{timed.others_s:>10.1f}{together_s:>12.1f}")
    lines.append("")
    for name, (slow, fast) in RATIOS.items():
        if slow in found and fast in found:
            a, b = found[slow], found[fast]
            together = (a.reference_s + a.others_s) / (b.reference_s + b.others_s)
            lines.append(f"{name}: {a.others_s / b.others_s:.2f} times as fast; with the reference {together:.2f}")
    clips = list(zip(*(timed.fingerprints for timed in found.values()), strict=True))
    differing = [str(index) for index, prints in enumerate(clips) if len(set(prints)) > 1]
    same = "the same, bit for bit, in every way" if not differing else f"not the same: {', '.join(differing)}"
    lines.append(f"{len(clips)} clips are {same}")
    return "\n".join(lines)


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path, help="folder for the projects; must not exist")
    parser.add_argument("capture", nargs="?", type=Path, default=asset_path("sample"), help="default: the sample")
    parser.add_argument("--scale", default="1")
    parser.add_argument("--frames", metavar="A:B", help="default: all")
    parser.add_argument("--clip-length", type=int, default=4, metavar="M")
    parser.add_argument("--clips", type=int, metavar="N", help="only the first N clips")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="as of clipgstream train")
    parser.add_argument("--json", type=Path, help="also write the figures here")
    options = parser.parse_args()
    options.out.mkdir(parents=True)
    arguments = [str(options.capture), "--scale", options.scale, "--clip-length", str(options.clip_length)]
    arguments += ["--frames", options.frames] if options.frames else []
    for assignment in options.set:
        arguments += ["--set", assignment]
    machine = describe_machine(n_threads=TWO.n_cores)
    with ending_on_bad_input():
        found = measure(options.out, arguments, options.clips)
    print(table(found))
    print(machine)
    if options.json:
        rows = [
            {
                "n_cores": way.n_cores,
                "n_workers": way.n_workers,
                "reference_s": timed.reference_s,
                "others_s": timed.others_s,
                "fingerprints": timed.fingerprints,
            }
            for way, timed in found.items()
        ]
        options.json.write_text(json.dumps({"schema": 1, "machine": str(machine), "rows": rows}, indent=2) + "\n")


if __name__ == "__main__":
    main()
