"""Measures the tables of docs/results.md and writes each to the ledger, docs/results/NAME.json.

    python -m tests.benchmarks.figures OUT NAME... [--basketball PATH] [--remark TEXT] [--commit HASH]
    python -m tests.benchmarks.figures OUT --short | --all [--basketball PATH]

Captures and trainings of a table lie in OUT/NAME, and are taken up where they are there already. Tables of the
basketball are left out without --basketball; its later frames are in a folder beside it, PATH_later. Before it begins
it says how long it will take, from how long each took the last time. Fill the documents with `make docs` afterwards;
`make figures` does all this for the short tables, and `make figures LONG=1 BASKETBALL=PATH` for all.
"""

from __future__ import annotations

import argparse
import json
import shlex
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from app.lab.machine import describe_machine
from app.project.opening.project_access import open_project
from engine.clip_files.clip_state import read_clip_header
from tests.documents.fingerprint import default_settings, fingerprint
from tests.documents.ledger import HEADLINE, LEDGER, Calm, ClipRow, ClipsEntry, Entry, TableEntry, entry, write_entry
from tests.documents.printed import printed_tables

ROOT = Path(__file__).resolve().parents[2]
SAMPLE = ROOT / "assets" / "sample"
_CLIPGSTREAM = "import sys; sys.path.insert(0, '.'); from app.cli.cli import main; sys.exit(main(sys.argv[1:]))"
"""Of this folder's code, whatever is installed; spawned processes import nothing from it."""
HOLDOUT = "0,10,15,30"
"""Of the basketball, as others hold out."""


@dataclass(frozen=True, slots=True)
class Clips:
    """Clips that are trained as they are by default. A value.

    Attributes:
        title: Of the capture, for a table.
        training: What follows `clipgstream train`: the capture and options.
        makes: A command that makes the capture first, if one does; CAPTURE stands for its folder.
    """

    title: str
    training: str
    makes: str = ""
    is_long: bool = True

    @property
    def commands(self) -> tuple[str, ...]:
        """As of Printed."""
        made = (self.makes,) if self.makes else ()
        return (*made, f"clipgstream train {self.training} --project DIR", "clipgstream eval DIR --json FILE")


@dataclass(frozen=True, slots=True)
class Printed:
    """A table that commands print. A value.

    Attributes:
        commands: "clipgstream ...", "python -m ..." or "make ..."; SAMPLE, BASKETBALL and LATER stand for captures, OUT
            and DIR for the folder of this table and a project in it. What the last one prints is the table.
        which: Among the tables that it prints; None takes every line as a row.
        columns: Those that are kept, by their headings; empty keeps all.
    """

    title: str
    commands: tuple[str, ...]
    which: int | None = 0
    columns: tuple[str, ...] = ()
    seeds: tuple[int, ...] = ()
    is_long: bool = True


_TRAIN_SAMPLE = "clipgstream train SAMPLE --project DIR --clips 0:2"
_TRAIN_HALF = f"clipgstream train BASKETBALL --scale 0.5 --project DIR --clips 0:4 --holdout {HOLDOUT}"
_SHARED = {_TRAIN_SAMPLE: "sample", _TRAIN_HALF: "objects-basketball"}
"""Trainings that several tables begin with, and in whose folder the project is."""
_OF_THE_PAPER = (
    "decoder-new,residual-none,residual-full,inherit-trainable,inherit-trainable-residual-full,field-continue,"
    "independent,schedule-inherited"
)
OUR_ROWS, PAPER_ROWS = f"full,anchors-stay,{_OF_THE_PAPER},gate-off", f"full,{_OF_THE_PAPER}"
"""Under the paper's scheme anchors stay and no gate is there anyway."""
_PAPER_SCHEME = "--set gate=off --set cloud=frames --set field_max_levels=16"
_COLUMNS = (
    "",
    "PSNR",
    "moving",
    "static",
    "SSIM",
    "DSSIM1",
    "DSSIM MS",
    "DSSIM r2",
    "tOF px",
    "flicker inside /255",
    "flicker borders /255",
    "seam ratio static",
    "MB",
    "s per later clip",
    "FPS CPU",
)


def _ablation(title: str, options: str, *, seeds: tuple[int, ...], variants: str = OUR_ROWS) -> Printed:
    """Rows of the paper's ablations, three clips each, with the smallest models and schedules."""
    of_seeds = f"--seeds {','.join(map(str, seeds))}"
    command = f"--project OUT --preset toy --n-clips 3 --variants {variants} {of_seeds} --metrics all --quiet"
    return Printed(title, (f"clipgstream ablate {options} {command}",), columns=_COLUMNS, seeds=seeds)


_BASKETBALL = f"BASKETBALL --scale 0.5 --holdout {HOLDOUT} --set passes=3"
TABLES: dict[str, Clips | Printed] = {
    "sample": Clips("sample, 320x240, 18 training cameras", "SAMPLE --clips 0:2", is_long=False),
    "basketball": Clips(
        "CMU Panoptic basketball, 640x360, 27 training cameras", f"BASKETBALL --clips 0:4 --holdout {HOLDOUT}"
    ),
    "far-clips": Clips(
        "basketball, frames 0 to 19 and 100 to 119",
        f"CAPTURE --clips 0:4 --holdout {HOLDOUT}",
        makes="python -m tests.benchmarks.join_panoptic BASKETBALL LATER CAPTURE",
    ),
    "full-size": Clips(
        "the sample's scene, 1920x1080, 18 training cameras",
        "CAPTURE --clips 0:2",
        makes="python -m app.lab.synthetic --out CAPTURE --width 1920 --height 1080 --cameras 20 --frames 20 "
        "--clip-length 10 --supersampling 2",
    ),
    "paper-sample": Clips("sample, `--preset paper`", "SAMPLE --preset paper --clips 0:2"),
    "paper-equal-steps": Clips(
        "sample, default settings with as many steps",
        "SAMPLE --set joint_steps=6120 --set source_steps=6120 --clips 0:2",
    ),
    "paper-basketball": Clips(
        "basketball at half size, `--preset paper`",
        f"BASKETBALL --preset paper --scale 0.5 --clips 0:1 --holdout {HOLDOUT}",
    ),
    "paper-basketball-default": Clips(
        "basketball at half size, default settings", f"BASKETBALL --scale 0.5 --clips 0:1 --holdout {HOLDOUT}"
    ),
    "hard-cases": Printed("hard cases", ("python -m tests.benchmarks.bench_hard_cases OUT",), seeds=(0,)),
    "long-captures": Printed(
        "changing exposure and light",
        ("python -m tests.benchmarks.bench_long_captures OUT --every 5 --set passes=6",),
        which=-1,
        seeds=(0,),
    ),
    "length": Printed(
        "length",
        (
            "python -m tests.benchmarks.bench_length OUT --lengths 30,300 --stream-frames 300 --independent-frames 300 "
            "--set passes=1",
        ),
        seeds=(0,),
    ),
    "mending": Printed("mending", ("python -m tests.benchmarks.bench_mending OUT",), seeds=(0,)),
    "objects": Printed(
        "objects of generated captures", ("python -m tests.benchmarks.bench_objects --all OUT",), which=-1, seeds=(0,)
    ),
    "objects-basketball": Printed(
        "objects of the basketball",
        (
            _TRAIN_HALF,
            "python -m tests.benchmarks.bench_objects DIR tests/objects_truth/basketball_boxes.json "
            "--title basketball --find 4 --from 30 --corrections 2",
        ),
        which=-1,
        seeds=(0,),
    ),
    "objects-drawing": Printed(
        "frames with edits, objects and copies", (_TRAIN_HALF, "python -m tests.benchmarks.bench_edits DIR"), which=-1
    ),
    "sequences": Printed(
        "files over time",
        (_TRAIN_HALF, "python -m tests.benchmarks.bench_sequences DIR --frames 40,150"),
        which=-1,
    ),
    "kernels": Printed("kernels", ("clipgstream bench --full --out OUT --quiet",), is_long=False),
    "steps": Printed("training steps", ("clipgstream bench --full --out OUT --quiet",), which=1, is_long=False),
    "ablation-sample": _ablation("sample, this program's scheme", "SAMPLE --set passes=4", seeds=(0, 1, 2)),
    "ablation-sample-paper": _ablation(
        "sample, the paper's scheme", f"SAMPLE --set passes=4 {_PAPER_SCHEME}", seeds=(0, 1, 2), variants=PAPER_ROWS
    ),
    "ablation-basketball": _ablation("basketball, this program's scheme", _BASKETBALL, seeds=(0, 1)),
    "ablation-basketball-paper": _ablation(
        "basketball, the paper's scheme", f"{_BASKETBALL} {_PAPER_SCHEME}", seeds=(0, 1), variants=PAPER_ROWS
    ),
    "settings": Printed(
        "speed against error of settings",
        ("clipgstream bench --capture SAMPLE --out OUT --quiet",),
        which=-1,
        seeds=(0,),
    ),
    "doctor": Printed("the capture doctor", ("python -m tests.benchmarks.bench_doctor SAMPLE BASKETBALL",)),
    "synchronisation": Printed(
        "offsets in time", ("python -m tests.benchmarks.bench_synchronisation SAMPLE BASKETBALL",), seeds=(0, 1)
    ),
    "calibration": Printed("cameras found", ("python -m tests.benchmarks.bench_calibration OUT SAMPLE",), seeds=(0,)),
    "gl": Printed("OpenGL against the rasterizer", (_TRAIN_SAMPLE, "python -m tests.benchmarks.bench_gl DIR")),
    "splat4d": Printed(
        "files over time and .splat4d",
        (_TRAIN_HALF, "python -m tests.benchmarks.bench_splat4d DIR OUT"),
    ),
    "player-drawing": Printed(
        "the player in a browser without a graphics card",
        (
            "clipgstream train SAMPLE --scale 0.5 --clip-length 5 --set quality=draft --project DIR --clips 0:1",
            "python -m tests.benchmarks.bench_drawing DIR",
        ),
    ),
    "player": Printed("the streaming player", (_TRAIN_HALF, "python -m tests.benchmarks.bench_player DIR")),
    "timeline": Printed("the timeline", ("python -m tests.benchmarks.bench_timeline",), is_long=False),
    "window": Printed("the window", (_TRAIN_SAMPLE, "python -m tests.benchmarks.bench_window DIR --no-training")),
    "opening": Printed("opening", ("python -m tests.benchmarks.bench_opening OUT",), which=None),
    "workers": Printed(
        "several workers",
        ("python -m tests.benchmarks.bench_workers OUT BASKETBALL --scale 0.5 --frames 0:36 --clip-length 4",),
        which=-1,
    ),
    "plan": Printed("the forecast of several workers", ("python -m tests.benchmarks.bench_plan BASKETBALL OUT",)),
    "node-loss": Printed("a lost node", ("python -m tests.benchmarks.bench_node_loss",)),
    "large": Printed("a project of 1,000 clips", ("python -m tests.benchmarks.bench_project",), which=None),
    "faults": Printed("faults", ("make faults",), which=None),
}
_FIGURES = ("psnr", "psnr_fit", "psnr_moving", "psnr_rest", "psnr_fit_rest", "ssim", "flip")


def main() -> None:
    """Measure the tables that are named."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(TABLES))
    parser.add_argument("--short", action="store_true", help="the tables that take a few minutes")
    parser.add_argument("--all", action="store_true", help="all tables: hours")
    parser.add_argument("--basketball", type=Path, help="folder of the CMU Panoptic basketball")
    parser.add_argument("--remark", default="", help="what else has to be known, such as other work on the machine")
    parser.add_argument("--commit", help="of what lies in OUT; by default that of the code")
    arguments = parser.parse_args()
    if unknown := [name for name in arguments.names if name not in TABLES]:
        parser.error(f"there is no table {', '.join(unknown)}; known are {', '.join(TABLES)}")
    chosen = {
        name: what
        for name, what in TABLES.items()
        if name in arguments.names or arguments.all or (arguments.short and not what.is_long)
    }
    if not chosen:
        parser.error(f"name one of {', '.join(TABLES)}, or give --short or --all")
    if arguments.basketball is None:
        left_out = [name for name, what in chosen.items() if is_of_basketball(what)]
        if set(left_out) & set(arguments.names):
            parser.error(f"{', '.join(left_out)} needs a capture that does not come with the program: --basketball")
        chosen = {name: what for name, what in chosen.items() if name not in left_out}
    commit = arguments.commit or _commit()
    say(forecast(list(chosen)))
    failed: list[str] = []
    for name, what in chosen.items():
        folder = arguments.out / folder_name(name)
        folder.mkdir(parents=True, exist_ok=True)
        places = {"SAMPLE": str(SAMPLE), "BASKETBALL": str(arguments.basketball), "OUT": str(folder)}
        first = what.commands[0]
        trained = arguments.out / _SHARED[first] if first in _SHARED else folder
        places |= {"DIR": str(trained / "project"), "FILE": str(folder / "figures.json")}
        places |= {"CAPTURE": str(folder / "capture"), "LATER": f"{arguments.basketball}_later"}
        common = {"commit": commit, "machine": _machine(), "remark": arguments.remark}
        is_there, start = any((folder / file).exists() for file in ("figures.json", "printed.txt")), time.monotonic()
        try:
            if isinstance(what, Clips):
                made: Entry = measured_clips(what, places, common)
            else:
                made = measured_table(what, folder, places, common)
        except subprocess.CalledProcessError as error:
            failed.append(f"{name} was not measured: its command ended with code {error.returncode}")
            continue
        took_s = round(time.monotonic() - start, 1)
        if is_there:  # then only read
            took_s = made.total("preparation_s") + made.total("training_s") if isinstance(made, ClipsEntry) else None
        made = msgspec.structs.replace(made, took_s=took_s)
        say(str(write_entry(name, made)))
    if failed:
        sys.exit("\n".join(failed))


def is_of_basketball(what: Clips | Printed) -> bool:
    """Whether a command reads that capture."""
    return any("BASKETBALL" in command for command in what.commands)


def folder_name(name: str) -> str:
    """Of what a table leaves behind: tables that the same commands print share it."""
    what = TABLES[name]
    if isinstance(what, Clips):
        return name
    return next(one for one, of in TABLES.items() if isinstance(of, Printed) and of.commands == what.commands)


def forecast(names: Sequence[str]) -> str:
    """How long tables will take, in words: as long as the last time."""
    took = {name: entry(name).took_s if (LEDGER / f"{name}.json").exists() else None for name in names}
    known = [seconds for seconds in took.values() if seconds is not None]
    unknown = [name for name, seconds in took.items() if seconds is None]
    text = f"{', '.join(names)}: about {sum(known) / 60:.0f} minutes, as long as the last time"
    return text + (f"; not known of {', '.join(unknown)}" if unknown else "")


def say(text: str) -> None:
    """A line on the screen, at once."""
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()


def measured_clips(what: Clips, places: dict[str, str], common: dict[str, Any]) -> ClipsEntry:
    """Train clips and measure them; measurements that are there are taken as they are."""
    project, figures = Path(places["DIR"]), Path(places["FILE"])
    if not figures.exists():
        for command in what.commands:
            _run(command, places)
    document = json.loads(figures.read_text("utf-8"))
    engine: dict[str, Any] = {}
    if what in map(TABLES.get, HEADLINE):
        with tempfile.TemporaryDirectory() as name:
            engine = {"fingerprint": fingerprint(Path(name) / "brief"), "settings": default_settings()}
    return ClipsEntry(
        title=what.title,
        commands=list(what.commands),
        day=datetime.fromtimestamp(figures.stat().st_mtime, UTC).date().isoformat(),
        seeds=[0],
        rows=_rows(project, document),
        calm=_calm(document["seams"]),
        **engine,
        **common,
    )


def measured_table(what: Printed, folder: Path, places: dict[str, str], common: dict[str, Any]) -> TableEntry:
    """Run commands and keep the table that the last one prints."""
    printed = folder / "printed.txt"
    if not printed.exists():
        text = ""
        for command in what.commands:
            text = _run(command, places)
        printed.write_text(text, "utf-8")
    headings, *rows = _table_in(printed.read_text("utf-8"), what.which)
    kept = [headings.index(name) for name in what.columns or headings]
    return TableEntry(
        title=what.title,
        commands=list(what.commands),
        day=datetime.fromtimestamp(printed.stat().st_mtime, UTC).date().isoformat(),
        seeds=list(what.seeds),
        columns=[headings[i] for i in kept],
        rows=[[row[i] for i in kept] for row in rows],
        **common,
    )


def _table_in(printed: str, which: int | None) -> list[list[str]]:
    if which is None:
        return [["what was printed"], *([line.strip()] for line in printed.splitlines() if line.strip())]
    return printed_tables(printed)[which]


def _run(command: str, places: dict[str, str]) -> str:
    """What a command prints on standard output. Raises CalledProcessError where its code is not 0."""
    program, *words = [places.get(word, word) for word in shlex.split(command)]
    start = {"clipgstream": [sys.executable, "-P", "-c", _CLIPGSTREAM], "python": [sys.executable]}
    say(command)
    called = [*start.get(program, [program]), *words]
    return subprocess.run(called, cwd=ROOT, stdout=subprocess.PIPE, text=True, check=True).stdout


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


def _calm(seams: dict[str, Any]) -> Calm | None:
    """None for a single clip, which has no boundary."""
    if not seams["boundaries"]:
        return None
    means = seams["means"]["held_out"]
    inside, at = means["interior"], means["boundary"]

    def levels(name: str) -> tuple[float, float]:
        return round(255 * inside[name], 3), round(255 * at[name], 3)

    return Calm(
        render=levels("change_static"),
        truth=levels("truth_change_static"),
        moving_ratio=round(means["ratio_moving"], 3),
        moving_ratio_truth=round(means["truth_ratio_moving"], 3),
        boundaries=[round(boundary["ratio_static"], 3) for boundary in seams["boundaries"]],
    )


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
