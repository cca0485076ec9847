"""Damaged folders of a project: links, pipes, devices, foreign and missing ones, and foreign files among its own.

Each case puts something else under the name of one or two folders of a small project, or under the name of a file that
the program writes there, and then does what writes: edits, versions, an exchange of clips, curves, figures, a log, a
repair. Counted as faults: an exception that is neither an EngineError nor an OSError of what was asked for alone, a
hang, and any change to what lies outside of the project.

    python -m tests.faults.fuzz_folders --cases 1000 --seed 1
"""

from __future__ import annotations

import contextlib
import io
import os
import random
import shutil
import sys
import zlib
from dataclasses import replace
from pathlib import Path
from typing import Any

from tests.faults.fuzz_project import CONTENT, make_project
from tests.faults.tally import Case, Outcome, fuzz_main, judge, start_memory

OTHERS = ("versions/0000", "versions/0001", "reports")
FILES = (
    "logs/clip-0000.log",
    "metrics/0000.jsonl",
    "metrics/0000.unfinished.jsonl",
    "live/clip-0001-r0001.safetensors",
    "live/0000-final.safetensors",
    "live/notes.txt",
    "exchange/exchange.json",
    "exchange/authorized_keys",
    "exchange/0000.safetensors",
    "evaluations/0000.jsonl",
    "versions/0000/0001.safetensors",
    "versions/0000/0007.jsonl",
    "damaged/0000-1.safetensors",
    "mends/unfinished.json",
    "journal/00000000.jsonl",
    "checkpoints/0001.safetensors",
    "clips/0000.safetensors",
    ".partial-999999999-project.json",
    "lock",
    ".lock",
    "history.json",
    "project.backup.json",
)
"""Names that the program writes, replaces or removes, or that look so."""
KINDS = ("pipe", "link", "link to a file", "device", "dangling link", "link to itself", "file", "folder", "nothing")


def make_foreign(folder: Path, project: Path) -> None:
    """A folder of somebody's own with files of every name that a project has, and others."""
    for path in [*project.rglob("*"), folder / "letter"]:
        name = path.name if path.is_file() or not path.exists() else f"{path.name}.txt"
        (folder / name).write_text(f"mine: {name}")
    for name in FILES:
        (folder / Path(name).name).write_text(f"mine: {name}")
    (folder / ".partial-999999999-letter").write_text("mine")


def state_of(folder: Path) -> dict[str, bytes]:
    """Every file below a folder."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def put(path: Path, kind: str, foreign: Path) -> None:
    """Put something else under a name."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    path.unlink(missing_ok=True)
    path.parent.mkdir(parents=True, exist_ok=True)
    match kind:
        case "pipe":
            os.mkfifo(path)
        case "link":
            path.symlink_to(foreign)
        case "link to a file":
            path.symlink_to(foreign / "letter")
        case "device":
            path.symlink_to("/dev/full")
        case "dangling link":
            path.symlink_to(foreign / "not-there" / "x")
        case "link to itself":
            path.symlink_to(path)
        case "file":
            path.write_text("mine")
        case "folder":
            path.mkdir()
            (path / "notes").write_text("mine")
        case _:
            pass


# ---------------------------------------------------------------- what writes


def command(*arguments: str) -> None:
    """A command of the command line. Raises RuntimeError where it ends with a bug in the program."""
    from app.cli.cli import main

    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = main(arguments)
    if code not in (0, 1, 2) or "bug in the program" in err.getvalue() or "Traceback" in err.getvalue():
        raise RuntimeError(f"{arguments[0]} ended with {code}: {err.getvalue()[-300:]}")


def edit(project: Any) -> None:
    """Two steps and the document written anew."""
    from app.document.project_document import Marker

    for frame in range(2):
        project.change(replace(project.document, markers=(Marker(frame, "x"),)), "mark")
    project.store.compact()


def versions(project: Any) -> None:
    """Set a clip aside, bring it back, forget the oldest."""
    from app.project.clips.clip_versions import (
        forget_oldest,
        list_versions,
        put_damaged_aside,
        restore_version,
        set_aside,
    )

    set_aside(project, 0)
    put_damaged_aside(project, 1)
    for version in list_versions(project, 0)[:1]:
        restore_version(project, 0, version.number)
    forget_oldest(project, 0)


def exchanged(project: Any) -> None:
    """Exchange a clip for a copy of it."""
    from app.project.clips.clip_exchange import begin_exchange, exchange

    place = begin_exchange(project.folder)
    if project.clip_path(0).is_file():
        shutil.copyfile(project.clip_path(0), place / "0000.safetensors")
        exchange(project.folder, ["0000.safetensors"])


def trained(project: Any) -> None:
    """What a training leaves beside its clip: log, curves, snapshots."""
    from app.training.worker.folder_store import FolderStore
    from engine.clip_files.clip_state import read_clip_state
    from engine.errors import ProjectError
    from engine.storage.files import open_to_append

    for path in (project.log_path(0), project.unfinished_metrics_path(0)):
        with contextlib.suppress(OSError):  # as worker and run, which go on without
            path.parent.mkdir(exist_ok=True)
            os.close(open_to_append(path))
    with contextlib.suppress(ProjectError):
        FolderStore(project.folder).put_snapshot("0000", 1, read_clip_state(project.clip_path(0)))
    project.discard_progress(0)


def measured(folder: Path) -> None:
    """Figures are kept by programs that have the project open read-only."""
    from app.evaluation.kept_figures import KeptFigures
    from tests.faults.fuzz_project import _figure_rows

    figures = KeptFigures(folder / "evaluations" / "0000.jsonl", CONTENT, None, lambda said: None)
    with figures.writing():
        figures.add(_figure_rows()[0])


def write_everything(folder: Path) -> None:
    """All that writes into a project. Raises EngineError where it may not be written to."""
    from app.background.logs import tail
    from app.project.opening.project_access import open_project
    from engine.errors import EngineError

    command("gate", str(folder), "--forget")
    command("inspect", str(folder))
    command("versions", str(folder))
    measured(folder)
    tail(folder / "logs" / "clip-0000.log")
    command("repair", str(folder), "--keep-good-steps")
    project = open_project(folder)
    try:
        for act in (edit, versions, exchanged, trained):
            with contextlib.suppress(EngineError):
                act(project)
    finally:
        project.close()


# ---------------------------------------------------------------- one case


def run_case(case: Case) -> Outcome:
    """Put something odd where index and seed say, and write."""
    from app.project.folders import FOLDERS

    rng = random.Random(zlib.crc32(f"{case.seed}:{case.index}".encode()))
    pristine, foreign = case.work_dir / "pristine", case.work_dir / "foreign"
    if not pristine.is_dir():
        for name in ("DATA", "CONFIG", "STATE"):
            os.environ[f"XDG_{name}_HOME"] = str(case.work_dir / "home")
        make_project(pristine)
        write_everything(pristine)
        foreign.mkdir()
        make_foreign(foreign, pristine)
        start_memory()
    before = state_of(foreign)
    project = case.work_dir / "case"
    shutil.rmtree(project, ignore_errors=True)
    shutil.copytree(pristine, project)
    said = []
    for _ in range(rng.choice((1, 1, 2))):
        name, kind = rng.choice((*FOLDERS, *FOLDERS, *OTHERS, *FILES)), rng.choice(KINDS)
        parents = [project / parent for parent in Path(name).parents]
        if not any(os.path.lexists(parent) and (parent.is_symlink() or not parent.is_dir()) for parent in parents):
            put(project / name, kind, foreign)
            said.append(f"{name}: {kind}")
    verdict, detail = judge(lambda: write_everything(project))
    after = state_of(foreign)
    if after != before:
        changed = sorted(name for name in {*before, *after} if before.get(name) != after.get(name))
        verdict, detail = "outside", ", ".join(changed)
        shutil.rmtree(foreign)
        foreign.mkdir()
        make_foreign(foreign, pristine)
    shutil.rmtree(project)
    return Outcome("; ".join(said), verdict, detail)


if __name__ == "__main__":
    sys.exit(fuzz_main("fuzz_folders", __doc__ or "", run_case, n_cases=1000))
