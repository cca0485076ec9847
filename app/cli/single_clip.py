"""clipgstream train --clip K: one clip, without the project's lock. May be run anywhere, any number of times, also at
the same time: one finished clip results. Schedulers of clusters run it for every clip, and go by its exit code."""

from __future__ import annotations

import argparse
import time

from app.cli.arguments import EXIT_NOT_READY, EXIT_OK, EXIT_STOPPED, fail
from app.cli.chosen_project import open_for_clip
from app.cli.terminal.exit_codes import exit_code
from app.cli.terminal.progress import ProgressLine
from app.cli.terminal.training_lines import show_event, show_outcome, show_status
from app.evaluation.headless import ClipOutcome, train_clips, train_document
from app.project.claims.claims import LOOK_EVERY_S, ClipClaimed
from app.project.clips.clip_catalog import ClipCatalog
from app.training.service import Launch, TrainingService
from app.training.train_queue import needed_clips
from engine.errors import ProjectError
from engine.storage.json_files import json_text

_CONTRADICTED = (
    ("clips", ":", "--clips"),
    ("workers", None, "--workers"),
    ("again", False, "--again"),
    ("is_starting_over", False, "--start-over"),
    ("cluster", None, "--cluster"),
)
"""Options that ask for more than that one clip is there in the end: name, default, as written."""


def train_single_clip(options: argparse.Namespace, launch: Launch) -> int:
    """Train the clip of the arguments, if nobody has and nobody does. Returns the exit code.

    0: it is trained, now or before. 75: not yet possible, try again later. 1: it failed; trying again continues from
    its checkpoint. 2: bad input; trying again does not help. 3: somebody stopped it.
    """
    for name, default, written in _CONTRADICTED:
        if getattr(options, name) != default:
            raise ProjectError(f"--clip cannot be combined with {written}.", hint=f"Leave {written} out.")
    if options.own_assignments:
        raise ProjectError("--clip cannot be combined with --clip-set.", hint="Leave --clip-set out.")
    line = ProgressLine(is_quiet=options.quiet)
    project, capture = open_for_clip(options)
    clips, clip_index = project.clips(capture.n_frames), options.clip
    if clip_index >= len(clips):  # of a capture that grows
        return fail(EXIT_NOT_READY, f"Clip {clip_index} is still being recorded: {len(clips)} clips are complete.")
    holdout = capture.camera_indices(project.settings.holdout)
    needed = needed_clips(project, clip_index)
    is_chained = project.settings.config().follows_previous  # then it stands on all that are before it
    catalog = ClipCatalog(project, len(clips), only=None if is_chained else (*needed, clip_index))
    service = TrainingService(
        project, clips, holdout=holdout, launch=launch, is_window_open=False, catalog=catalog, cpu=options.cpu
    )
    service.set_live_view("off")
    try:
        missing = [index for index in needed if not project.is_trained(index)]
        if missing and service.catalog[clip_index].state != "trained":
            return fail(EXIT_NOT_READY, f"Clip {clip_index} needs clip {missing[0]}, which is not trained yet.")
        _claim(service, clip_index, line)
        (outcome,) = train_clips(
            service,
            [clip_index],
            on_status=lambda status: show_status(line, status),
            on_event=lambda event: show_event(line, event),
            on_outcome=lambda outcome: show_outcome(line, outcome),
        )
    except ClipClaimed as error:
        return fail(EXIT_NOT_READY, f"Clip {clip_index}: {error}")
    finally:
        line.finish()
        service.close()
    if options.json:
        print(json_text(train_document(project, capture, [outcome]), indent=2))
    return _exit_code(outcome)


def _claim(service: TrainingService, clip_index: int, line: ProgressLine) -> None:
    """Claim the clip, after a minute also from a process that has died. Raises ClipClaimed: one trains it."""
    key, is_told = service.project.clip_name(clip_index), False
    while service.catalog[clip_index].state != "trained":
        try:
            service.claims.take(key)
            break
        except ClipClaimed as error:
            if error.is_sure:
                raise
            if not is_told:
                line.say(f"Clip {clip_index}: {error.message} Waiting for up to a minute for a sign of life.")
                service.claims.watch()
                is_told = True
            time.sleep(LOOK_EVERY_S)
            service.catalog.update(clip_index)


def _exit_code(outcome: ClipOutcome) -> int:
    code = exit_code([outcome])
    if code == EXIT_OK:
        return code
    said = " ".join(part for part in (outcome.message, outcome.hint) if part)
    if outcome.kind == ClipClaimed.__name__:
        return fail(EXIT_NOT_READY, said)
    if outcome.state == "stopped":
        return fail(EXIT_STOPPED, f"The training of clip {outcome.clip_index} was stopped; progress is kept.")
    return fail(code, said)
