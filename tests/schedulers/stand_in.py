"""A program in place of the interpreter, which trains nothing: it keeps what `clipgstream train --clip` promises.

A clip is finished by one process at a time and once, source clips after the reference clip 0. A file `fail-K` in the
project holds exit codes that the next calls for clip K end with, one a line; `slow-K` makes it take that many seconds,
and as long as there is `hold-K`, it goes on.
Each call is a line "K CODE" of the file `calls`.
"""

from __future__ import annotations

import sys
from pathlib import Path

from app.schedule.clip_jobs import ClipJobs
from app.schedule.job_files import SCHEDULERS, job_text, write_job

PROGRAM = """#!{python}
import os, signal, sys, time
for number in (signal.SIGTERM, signal.SIGINT):
    signal.signal(number, lambda *_: end(130))
assert sys.argv[1:5] == ["-P", "-m", "ui", "train"] and sys.argv[6] == "--project" and sys.argv[8] == "--clip"
project, clip = sys.argv[7], sys.argv[9]
def path(name):
    return os.path.join(project, name)
claim = None
def end(code):
    if claim:
        os.unlink(claim)
    with open(path("calls"), "a") as calls:
        calls.write(clip + " " + str(code) + "\\n")
    os._exit(code)
try:
    with open(path("fail-" + clip)) as file:
        codes = file.read().split()
except FileNotFoundError:
    codes = []
if codes:
    with open(path("fail-" + clip), "w") as file:
        file.write(" ".join(codes[1:]))
    end(int(codes[0]))
if os.path.exists(path("done-" + clip)):
    end(0)
if clip != "0" and not os.path.exists(path("done-0")):
    end(75)
try:
    os.close(os.open(path("claim-" + clip), os.O_CREAT | os.O_EXCL))
except FileExistsError:
    end(75)
claim = path("claim-" + clip)
try:
    with open(path("slow-" + clip)) as file:
        seconds = float(file.read())
except FileNotFoundError:
    seconds = 0.05
with open(path("begun-" + clip), "w") as begun:
    begun.write(str(os.getpid()))
time.sleep(seconds)
while os.path.exists(path("hold-" + clip)):
    time.sleep(0.05)
with open(path("done-" + clip), "a") as done:
    done.write("x")
end(0)
"""

NAME = 'it\'s 50%j "of" $HOME\n{{x}} é'
"""A name of a folder that every quoting has to survive."""


def scheduled(scheduler: str, folder: Path, *, n_clips: int, reference: int = 0) -> tuple[Path, Path]:
    """A project in a folder of a terrible name, and its job for a scheduler, which calls the stand-in."""
    program, project = folder / "stand in", folder / NAME
    program.write_text(PROGRAM.format(python=sys.executable))
    program.chmod(0o755)
    (project / "openjd").mkdir(parents=True)
    jobs = ClipJobs(
        reference=reference,
        sources=tuple(index for index in range(n_clips) if index != reference),
        n_cpus=1,
        memory_mb=256,
        reference_s=600,
        source_s=600,
        is_time_known=True,
        skipped=(),
    )
    found = SCHEDULERS[scheduler]
    text = job_text(found, jobs, capture=folder / "capture", project=project, python=str(program))
    write_job(project / found.file, text, is_replacing=False)
    return project, project / found.file


def calls(project: Path, clip: int) -> list[int]:
    """Exit codes of all calls for a clip, in order."""
    file = project / "calls"
    lines = (line.split() for line in (file.read_text().splitlines() if file.exists() else ()))
    return [int(code) for index, code in lines if int(index) == clip]


def times_trained(project: Path, n_clips: int) -> list[int]:
    """How often each clip was trained."""
    files = [project / f"done-{clip}" for clip in range(n_clips)]
    return [len(file.read_text()) if file.exists() else 0 for file in files]
