"""Jobs written as files: the templates of assets/schedule, filled in.

A template has `@name@` for values, and the lines `@sources:@` and `@:sources@` around what is left out where only the
reference clip has to be trained.
"""

from __future__ import annotations

import re
import shlex
import sys
from collections.abc import Callable, Sequence
from itertools import groupby
from pathlib import Path
from typing import NamedTuple

from app.schedule.clip_jobs import ClipJobs
from engine.assets import asset_path
from engine.errors import ProjectError
from engine.storage.files import checked_path

MOST_ARRAY_TASKS = 1000
"""Tasks of a SLURM array: its default MaxArraySize is 1001. Where more clips are left, a task trains several."""


class Scheduler(NamedTuple):
    """One kind of job file.

    Attributes:
        template: In assets/schedule.
        file: Where it is written to, in the project folder.
        submit: The program that takes it, and its arguments before the path of the file.
        quoted: Writes a text as the file's language needs it.
    """

    template: str
    file: str
    submit: tuple[str, ...]
    quoted: Callable[[str], str]


def yaml_text(text: str) -> str:
    """A text as YAML has it between quotes."""
    plain = (char if char.isprintable() and char not in '"\\' else f"\\U{ord(char):08x}" for char in text)
    return f'"{"".join(plain)}"'


SCHEDULERS = {
    "slurm": Scheduler("train.sbatch", "train.sbatch", ("bash",), shlex.quote),
    "openjd": Scheduler("template.yaml", "openjd/template.yaml", ("openjd", "run"), yaml_text),
    "shell": Scheduler("train.sh", "train.sh", ("sh",), shlex.quote),
}
"""By name: what `clipgstream schedule --for` takes."""


def job_text(
    scheduler: Scheduler, jobs: ClipJobs, *, capture: Path, project: Path, python: str = sys.executable
) -> str:
    """The text of a job file.

    Args:
        capture, project: Their folders, absolute, as every computer sees them.
        python: The interpreter that has this program installed.
    Raises:
        ProjectError: A path is not text.
    """
    n_each = -(-(max(jobs.sources, default=0) + 1) // MOST_ARRAY_TASKS)
    values = {
        "python": scheduler.quoted(_text(python)),
        "capture": scheduler.quoted(_text(capture)),
        "project": scheduler.quoted(_text(project)),
        "cpus": jobs.n_cpus,
        "memory_mb": jobs.memory_mb,
        "reference": jobs.reference,
        "reference_s": jobs.reference_s,
        "reference_minutes": jobs.reference_s // 60,
        "source_s": jobs.source_s,
        "source_minutes": jobs.source_s // 60 * n_each,
        "ranges": _joined(jobs.sources, "{}-{}", ","),
        "sequences": _joined(jobs.sources, "$(seq {} {})", " "),
        "tasks": _joined(sorted({index % MOST_ARRAY_TASKS for index in jobs.sources}), "{}-{}", ","),
        "stride": MOST_ARRAY_TASKS,
        "last": max(jobs.sources, default=0),
    }
    text = asset_path("schedule", scheduler.template).read_text(encoding="utf-8")
    text = re.sub(r"@sources:@\n(.*?)@:sources@\n", r"\1" if jobs.sources else "", text, flags=re.DOTALL)
    return re.sub(r"@(\w+)@", lambda found: str(values[found[1]]), text)


def write_job(path: Path, text: str, *, is_replacing: bool) -> None:
    """Write a job file; its folder is made.

    Raises:
        ProjectError: There is such a file already, and it must not be replaced.
        DiskError: It could not be written.
    """
    if path.exists() and not is_replacing:
        raise ProjectError(
            "There is a file of this name already.",
            hint="Add --replace, or choose another --out.",
            path=path,
        )
    with checked_path(path, what="The job") as unfinished:
        unfinished.write_text(text, encoding="utf-8", newline="\n")


def _text(path: Path | str) -> str:
    text = str(path)
    try:
        text.encode("utf-8")
    except UnicodeEncodeError as error:
        raise ProjectError(
            "The name of a folder is not valid UTF-8, so that no job can name it.", hint="Rename it.", path=path
        ) from error
    return text


def _joined(indices: Sequence[int], form: str, separator: str) -> str:
    """Ascending numbers as runs: 1-4,7,9-12 for the form "{}-{}"."""
    numbered = groupby(enumerate(indices), lambda pair: pair[1] - pair[0])
    runs = [[index for _, index in run] for _, run in numbered]
    return separator.join(form.format(run[0], run[-1]) if len(run) > 1 else str(run[0]) for run in runs)
