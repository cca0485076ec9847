"""What an export would write, and what is wrong with it: found before any work, on a thread."""

from __future__ import annotations

import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from app.export.export_choices import ExportChoices, ExportContext
from app.export.export_jobs import KINDS
from app.export.forms.form import Answers
from app.export.forms.table import answers_to
from app.export.staging import check_target
from engine.errors import EngineError

if TYPE_CHECKING:
    from app.evaluation.headless import TrainedProject


@dataclass(frozen=True, slots=True)
class ExportPlan:
    """What the dialog shows beforehand.

    Attributes:
        choices: What it is the plan of.
        n_files, n_bytes: What will be written; 0 where it cannot be told.
        free_bytes: Of the disk; None where it is not known.
        problems: What has to be mended first, in sentences; none where the export can begin.
        lines: What else the user should know.
    """

    choices: ExportChoices
    n_files: int = 0
    n_bytes: int = 0
    free_bytes: int | None = None
    problems: tuple[str, ...] = ()
    lines: tuple[str, ...] = ()


def plan_export(opened: TrainedProject, context: ExportContext, choices: ExportChoices) -> ExportPlan:
    """Look at what an export would do. Reads headers and asks the disk; writes nothing."""
    answers = answers_to(context, choices)
    form = answers.form
    problems: list[str] = []
    lines: tuple[str, ...] = ()
    n_files = n_bytes = 0
    if form.has_frames and not answers.frames:
        problems.append("There are no such frames.")
    elif form.has_frames and form.needs_trained and (runs := context.untrained(answers.frames)):
        listed = ", ".join(f"{first} to {last}" if first < last else f"{first}" for first, last in runs[:3])
        more = f" and {len(runs) - 3} more" if len(runs) > 3 else ""
        problems.append(f"Clips of these frames are not trained: {listed}{more}.")
    if not choices.out.strip():
        problems.append("Say where it is to be written.")
    if not problems:
        try:
            job = form.make_job(answers)
            found = KINDS[choices.kind].load().estimate(opened, job)
            n_files, n_bytes, lines = found.n_files, found.n_bytes, found.lines
            _check_place(answers, opened, n_bytes)
            if answers.suffix and answers.out.exists():
                lines = (*lines, "The file that is there is replaced.")
        except EngineError as error:
            problems.append(" ".join(part for part in error.told_apart() if part))
        except (OSError, RuntimeError, ValueError) as error:  # a path that cannot be one
            problems.append(f"This place cannot be written to ({error}).")
    return ExportPlan(choices, n_files, n_bytes, _free_bytes(choices.out), tuple(problems), lines)


def _check_place(answers: Answers, opened: TrainedProject, n_bytes: int) -> None:
    out = answers.out
    if not out.is_absolute():
        raise ValueError("give the whole path, from the root or from ~")
    for what, folder in (("the project", opened.project.folder), ("the capture", Path(opened.capture.path))):
        if out.resolve().is_relative_to(folder.resolve()):
            raise ValueError(f"it lies inside of {what}")
    check_target(out, n_bytes=n_bytes, is_folder=not answers.suffix)


def _free_bytes(out: str) -> int | None:
    try:
        path = Path(out).expanduser().absolute()
        return shutil.disk_usage(next(parent for parent in path.parents if parent.is_dir())).free
    except (OSError, RuntimeError, ValueError, StopIteration):
        return None


_OWN_SUFFIXES = (".mp4", ".webm", ".html")
"""They say what a file is."""


def suggested_out(folder: str, context: ExportContext, choices: ExportChoices) -> str:
    """A place for an export: a name of its own in a folder that was used last."""
    answers = answers_to(context, choices)
    suffix = answers.suffix
    words = [context.name or "scene", *([] if suffix in _OWN_SUFFIXES else [choices.kind])]
    if not suffix:
        words.append(answers["format"])
    name = "-".join("".join(sign if sign.isalnum() or sign in "-_. " else "_" for sign in word) for word in words)
    base = Path(folder) if folder else Path.home()
    for number in range(1, 1000):
        path = base / f"{name}{'' if number == 1 else f'-{number}'}{suffix}"
        if not _exists(path):
            return str(path)
    return str(base / f"{name}{suffix}")


def _exists(path: Path) -> bool:
    try:
        return path.exists() or path.is_symlink()
    except OSError:
        return False
