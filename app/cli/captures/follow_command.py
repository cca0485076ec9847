"""clipgstream follow: trains the clips of a capture while it is still being recorded."""

from __future__ import annotations

import argparse
import math
import time

from app.cli.arguments import EXIT_BAD_INPUT, EXIT_FAILED, EXIT_OK, add_follow_links, count_of, fail, path_argument
from app.cli.chosen_project import open_for_training
from app.cli.terminal.progress import ProgressLine
from app.cli.terminal.training_lines import PlanLines, show_event, show_outcome, show_status
from app.cli.training_settings import add_training_settings
from app.document.project_settings import ProjectSettings
from app.evaluation.headless import BAD_INPUT_KINDS, ClipOutcome, train_clips, train_document
from app.plan.speed import known_step_time
from app.project.opening.opening import is_project
from app.project.opening.project_access import DEFAULT_CLIP_LENGTH, read_settings
from app.project.project import Project
from app.status import TrainingStatus
from app.training.recording.followed_recording import FollowedRecording
from app.training.recording.intake import (
    UNTIL_IDLE_S,
    FollowLimits,
    Intake,
    TakenIn,
    base_of,
    check_can_follow,
    n_taken_of,
)
from app.training.service import Launch, TrainingService
from engine.capture.capture import Capture, open_capture
from engine.capture.growing.watch import END_FILE, PATIENCE_S
from engine.errors import CaptureError
from engine.storage.json_files import json_text
from engine.text import shown

OPEN_EVERY_S = 0.5
LOOK_EVERY_S = 0.1


def add_arguments(command: argparse.ArgumentParser) -> None:
    """Arguments of `clipgstream follow`."""
    command.add_argument("capture", type=path_argument, help="capture folder that is being recorded")
    command.add_argument("--project", type=path_argument, required=True, help="project folder; created if missing")
    command.add_argument(
        "--patience",
        type=_seconds,
        default=PATIENCE_S,
        metavar="S",
        help="seconds to wait for a frame that most cameras have, before training leaves it out "
        f"(default: {PATIENCE_S:g})",
    )
    command.add_argument(
        "--until-idle",
        type=_seconds,
        default=UNTIL_IDLE_S,
        metavar="S",
        help=f"the recording has ended after S seconds without a new frame (default: {UNTIL_IDLE_S:g}; inf: never); "
        f"a file called {END_FILE} in the capture folder ends it at once",
    )
    command.add_argument("--end-at", type=count_of("frames"), metavar="N", help="the recording ends after N frames")
    add_follow_links(command)
    add_training_settings(command)
    command.add_argument("--seed", type=int, help="seed of initial values and of the order of pictures (default: 0)")
    command.add_argument("--reference-clip", type=int, metavar="K", help="clip that others inherit from (default: 0)")
    command.add_argument("--json", action="store_true", help="print the outcome as JSON on standard output")
    command.add_argument("--quiet", action="store_true", help="show no progress")
    command.set_defaults(frames=None, clips=":", is_starting_over=False)


def run(options: argparse.Namespace, launch: Launch) -> int:
    """clipgstream follow: train clips as they become complete, until the recording ends. Returns the exit code."""
    if not any(one.replace(" ", "").startswith("backgrounds=") for one in options.assignments):
        options.assignments.append("backgrounds=clip")
    line = ProgressLine(is_quiet=options.quiet)
    limits = FollowLimits(options.patience, options.until_idle, options.end_at)
    try:
        stored = read_settings(options.project) if is_project(options.project) else None
        seen = _open_once_it_can_be(options, stored, line)
        n_complete = 0 if stored is None else n_taken_of(stored)
        first = TakenIn(n_complete) if n_complete else _first_frames(options, stored, seen, limits, line)
        seen.close()
        project, capture = open_for_training(options, line.say, n_complete=first.stop)
        try:
            outcomes = _follow(project, capture, first, limits, options, launch, line)
            if options.json:
                print(json_text(train_document(project, capture, outcomes), indent=2))
        finally:
            project.close()
    finally:
        line.finish()
    failed = [outcome for outcome in outcomes if outcome.state in ("failed", "damaged")]
    if failed:
        code = EXIT_BAD_INPUT if failed[-1].state == "failed" and failed[-1].kind in BAD_INPUT_KINDS else EXIT_FAILED
        return fail(code, " ".join(part for part in (failed[-1].message, failed[-1].hint) if part))
    return EXIT_OK


def _follow(
    project: Project,
    capture: Capture,
    first: TakenIn,
    limits: FollowLimits,
    options: argparse.Namespace,
    launch: Launch,
    line: ProgressLine,
) -> list[ClipOutcome]:
    settings = project.settings
    check_can_follow(settings)
    names = capture.rig.names
    document = first.without_lost(project.document, capture)
    if document != project.document:
        project.change(document, "exclude frames that did not come")
    intake = Intake(
        capture,
        first.stop,
        settings.clip_length,
        base=base_of(settings),
        is_wanted=lambda camera, frame: not project.document.exclusions.leaves_out(names[camera], frame),
        limits=limits,
    )
    clips = project.clips(first.stop)
    service = TrainingService(
        project, clips, holdout=capture.camera_indices(settings.holdout), launch=launch, is_window_open=False
    )
    plans = PlanLines(
        line, project, capture, catalog=service.catalog, step_time=known_step_time, is_quiet=options.quiet
    )
    held_out = ", ".join(settings.holdout) or "none"
    line.say(f"{capture.path}: {len(names)} cameras (held out: {held_out}), {first.stop} frames so far")

    def on_taken(taken: TakenIn) -> None:
        plans.capture = following.capture
        for sentence in taken.words(limits.patience_s):
            line.say(sentence)

    following = FollowedRecording(project, capture, service, intake, on_taken=on_taken)

    def on_status(status: TrainingStatus) -> None:
        if service.is_busy:
            show_status(line, status)
        elif not intake.has_ended:
            line.update(f"Clip {len(service.clips)}", None, intake.words)

    try:
        untrained = [i for i in service.catalog.order if service.catalog[i].state != "trained"]
        outcomes = train_clips(
            service,
            untrained,
            more=following.more,
            on_begin=lambda clip_index: plans.begin(service.clips[clip_index]),
            on_status=on_status,
            on_event=lambda event: show_event(line, event),
            on_outcome=lambda outcome: (show_outcome(line, outcome, has_others=True), plans.end(outcome)),
        )
        line.finish()
        if not any(outcome.state == "failed" for outcome in outcomes):
            line.say(f"The recording has ended: {intake.n_taken} frames, {len(service.clips)} clips")
        return outcomes
    finally:
        service.close()


def _open_once_it_can_be(options: argparse.Namespace, stored: ProjectSettings | None, line: ProgressLine) -> Capture:
    """The capture once its calibration and the first frames of every camera are there."""
    follow_links = options.follow_links or (stored is not None and stored.follow_links)
    until_s = time.monotonic() + options.patience
    while True:
        try:
            return open_capture(options.capture, follow_links=follow_links, is_growing=True)
        except CaptureError as error:
            if not options.capture.is_dir() or time.monotonic() > until_s:
                raise
            line.update("Waiting for the first frames", None, error.message)
        time.sleep(OPEN_EVERY_S)


def _first_frames(
    options: argparse.Namespace,
    stored: ProjectSettings | None,
    capture: Capture,
    limits: FollowLimits,
    line: ProgressLine,
) -> TakenIn:
    """The frames up to the end of the reference clip, once they are there: all other clips need it."""
    length = options.clip_length or (DEFAULT_CLIP_LENGTH if stored is None else stored.clip_length)
    reference = options.reference_clip or (0 if stored is None else stored.reference_clip)
    intake = Intake(capture, 0, length, limits=limits)
    while not intake.has_ended and intake.ready() < (reference + 1) * length:
        line.update("Reference clip", None, intake.words)
        time.sleep(LOOK_EVERY_S)
    taken = intake.take()
    if taken is None:
        raise CaptureError(
            "The recording has ended before any frame was complete on all cameras.",
            hint="Check the cameras: " + intake.words + ".",
            path=capture.path,
        )
    return taken


def _seconds(text: str) -> float:
    try:
        seconds = float(text)
    except ValueError:
        seconds = math.nan
    if not seconds > 0.0:
        raise argparse.ArgumentTypeError(f"{shown(text)} is not a number of seconds above 0")
    return seconds
