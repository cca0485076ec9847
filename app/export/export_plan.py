"""The size and the problems of an export: found before any work, on a thread."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from app.export.edits.edits_line import included_lines
from app.export.export_choices import ExportChoices, ExportContext
from app.export.jobs.answers import Answers
from app.export.staging import check_target
from engine.errors import EngineError, ProjectError
from engine.export.sequences.table import SEQUENCES

if TYPE_CHECKING:
    from app.evaluation.headless import TrainedProject

TAKEN = "Another running or waiting export writes to this place."
_SAME = {".htm": ".html"}
_OWN_SUFFIXES = (".mp4", ".webm", ".html", *{row.suffix for row in SEQUENCES.values()})
"""Suffixes that state the kind of a file."""
_FILE_SUFFIXES = (*_OWN_SUFFIXES, ".csv", ".json")
"""Of everything that is one file."""


@dataclass(frozen=True, slots=True)
class ExportPlan:
    """The dialog's preview of an export.

    Attributes:
        choices: The choices that it is the plan of.
        n_files, n_bytes: Of the files to write; 0 where not known.
        free_bytes: Of the disk; None where it is not known.
        problems: Obstacles to remove first, in sentences; none where the export can begin.
        lines: Other sentences that the user should know.
    """

    choices: ExportChoices
    n_files: int = 0
    n_bytes: int = 0
    free_bytes: int | None = None
    problems: tuple[str, ...] = ()
    lines: tuple[str, ...] = ()


def plan_export(
    opened: TrainedProject, context: ExportContext, choices: ExportChoices, taken: Sequence[Path] = ()
) -> ExportPlan:
    """Look at what an export would do. Reads headers and asks the disk; writes nothing.

    Args:
        taken: Paths that other exports will write, although it may not be there yet.
    """
    answers = Answers(context, choices)
    has_frames = answers.job_type.takes("frames")
    problems: list[str] = []
    lines: tuple[str, ...] = ()
    n_files = n_bytes = 0
    if has_frames and not answers.frames:
        problems.append("No frames are chosen.")
    elif has_frames and answers.job_type.needs_trained and choices.frames != "all":
        problems += _untrained(context.untrained(answers.frames))
    if not choices.out.strip():
        problems.append("Say where to write it.")
    if not problems:
        try:
            job = answers.make_job()
            found = job.load().estimate(opened, job)
            n_files, n_bytes, lines = found.n_files, found.n_bytes, found.lines
            lines = (*included_lines(opened, job), *lines)
            _check_place(answers, opened, n_bytes)
            _check_name(answers)
            if any(overlap(answers.out.resolve(), other.resolve()) for other in taken):
                raise ProjectError(TAKEN)
            if answers.suffix and answers.out.exists():
                lines = (*lines, "The existing file will be replaced.")
        except EngineError as error:
            problems.append(" ".join(part for part in error.parts() if part))
        except (OSError, RuntimeError, ValueError) as error:  # a path that cannot be one
            problems.append(f"This place cannot be written to ({error}).")
    return ExportPlan(choices, n_files, n_bytes, _free_bytes(choices.out), tuple(problems), lines)


def overlap(one: Path, other: Path) -> bool:
    """Whether two exports would write to the same place, or one into what the other writes. Whole paths."""
    return one.is_relative_to(other) or other.is_relative_to(one)


def _untrained(runs: list[tuple[int, int]]) -> list[str]:
    """A sentence about runs of frames, where there are any."""
    if not runs:
        return []
    listed = ", ".join(f"{first} to {last}" if first < last else f"{first}" for first, last in runs[:3])
    more = f" and {len(runs) - 3} more runs" if len(runs) > 3 else ""
    if len(runs) == 1 and runs[0][0] == runs[0][1]:
        return [f"Frame {listed} is not trained yet."]
    return [f"Frames {listed}{more} are not trained yet."]


def _check_name(answers: Answers) -> None:
    """Check that a name does not say that something else is written. Raises ProjectError."""
    suffix, given = answers.suffix, answers.out.suffix.lower()
    if suffix and _SAME.get(given, given) != suffix:
        raise ProjectError(f"The name of this file has to end in {suffix}.")
    if not suffix and _SAME.get(given, given) in _FILE_SUFFIXES:
        raise ProjectError(f"This export is a folder, but its name ends in {given}.")


def _check_place(answers: Answers, opened: TrainedProject, n_bytes: int) -> None:
    out = answers.out
    if not out.is_absolute():
        raise ValueError("give the full path, from the root or from ~")
    check_target(out, n_bytes=n_bytes, is_folder=not answers.suffix, opened=opened)


def _free_bytes(out: str) -> int | None:
    try:
        path = Path(out).expanduser().absolute()
        return shutil.disk_usage(next(parent for parent in path.parents if parent.is_dir())).free
    except (OSError, RuntimeError, ValueError, StopIteration):
        return None


def suggested_out(folder: str, context: ExportContext, choices: ExportChoices, taken: Sequence[Path] = ()) -> str:
    """A place for an export: a name of its own in a folder that was used last. Asks the disk.

    Args:
        taken: Paths that other exports will write, although it may not be there yet.
    """
    answers = Answers(context, choices)
    suffix = answers.suffix
    words = [context.name or "scene", *([] if suffix in _OWN_SUFFIXES else [choices.kind])]
    if not suffix:
        words.append(answers["format"])
    name = "-".join("".join(sign if sign.isalnum() or sign in "-_. " else "_" for sign in word) for word in words)
    base = Path(folder) if folder else Path.home()
    for number in range(1, 1000):
        path = base / f"{name}{'' if number == 1 else f'-{number}'}{suffix}"
        if not (_exists(path) or any(overlap(path.absolute(), other) for other in taken)):
            return str(path)
    return str(base / f"{name}{suffix}")


def _exists(path: Path) -> bool:
    try:
        return path.exists() or path.is_symlink()
    except OSError:
        return False
