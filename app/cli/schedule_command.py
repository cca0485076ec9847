"""clipgstream schedule: a job that trains the clips of a project on many computers, by one command per clip."""

from __future__ import annotations

import argparse

from app.cli.arguments import EXIT_OK, parse_range, path_argument
from app.cli.chosen_project import add_project_arguments, open_for_training, project_to_plan
from app.cli.terminal.progress import ProgressLine
from app.command_text.quoting import shell_line
from app.plan.planning import memory_text
from app.plan.speed import step_time
from app.project.opening.project_access import is_project, read_settings
from app.schedule.clip_jobs import ClipJobs, clip_jobs
from app.schedule.job_files import SCHEDULERS, job_text, write_job
from app.training.service import Launch
from engine.text import duration_text


def add_arguments(command: argparse.ArgumentParser) -> None:
    """Arguments of `clipgstream schedule`."""
    add_project_arguments(command)
    command.add_argument("--for", dest="scheduler", required=True, choices=SCHEDULERS, help="what takes the job")
    files = ", ".join(scheduler.file for scheduler in SCHEDULERS.values())
    command.add_argument(
        "--out", type=path_argument, metavar="FILE", help=f"file to write (default, in the project folder: {files})"
    )
    command.add_argument("--replace", action="store_true", help="replace an existing file")
    command.set_defaults(is_starting_over=False)


def run(options: argparse.Namespace, launch: Launch) -> int:
    """clipgstream schedule: make the project, write its job, say how to submit it. Returns the exit code."""
    line = ProgressLine()
    scheduler = SCHEDULERS[options.scheduler]
    planned, capture = project_to_plan(options)  # bad input leaves no project behind
    chosen = parse_range(options.clips, len(planned.clips(capture.n_frames)), option="--clips", what="clips")
    jobs = clip_jobs(planned, capture, chosen, step_time)
    capture.close()
    if jobs is None:
        line.say("Nothing to schedule: each of these clips is trained, damaged, or in need of a damaged one.")
        return EXIT_OK
    text = job_text(scheduler, jobs, capture=options.capture.absolute(), project=options.project.absolute())
    if not is_project(options.project) or read_settings(options.project) != planned.settings:
        project, capture = open_for_training(options, line.say)
        capture.close()
        project.close()
    path = (options.out or options.project / scheduler.file).absolute()
    write_job(path, text, is_replacing=options.replace)
    for sentence in _said(jobs):
        line.say(sentence)
    print(shell_line([*scheduler.submit, str(path)], is_windows=False))
    return EXIT_OK


def _said(jobs: ClipJobs) -> list[str]:
    limits = f"{duration_text(jobs.reference_s)} for the reference clip, {duration_text(jobs.source_s)} for each other"
    if not jobs.is_time_known:
        limits = f"{duration_text(jobs.reference_s)} for each clip, since no forecast of the time is possible yet"
    others = {0: "and no other", 1: "then 1 other"}.get(len(jobs.sources), f"then {len(jobs.sources)} others")
    said = [
        f"The reference clip {jobs.reference}, {others}; each takes {jobs.n_cpus} core{'s' * (jobs.n_cpus > 1)} and "
        f"{memory_text(jobs.memory_mb)}. Time limits: {limits}."
    ]
    if jobs.skipped:
        listed = ", ".join(str(clip_index) for clip_index in jobs.skipped)
        said.append(f"Skipped, because damaged or in need of a damaged clip: clip {listed}")
    return [*said, "Start it with the following command."]
