"""clipgstream train: trains the clips of a project, or only prints their plan."""

from __future__ import annotations

import argparse
import contextlib
import math
from collections.abc import Sequence

from app.cli.arguments import (
    EXIT_BAD_INPUT,
    EXIT_FAILED,
    EXIT_NOT_READY,
    EXIT_OK,
    add_cluster,
    fail,
    parse_range,
)
from app.cli.chosen_project import add_project_arguments, open_for_training, project_to_plan, what_goes
from app.cli.single_clip import train_single_clip
from app.cli.terminal.progress import ProgressLine
from app.cli.terminal.training_lines import (
    PlanLines,
    SequenceTable,
    failure_text,
    show_event,
    show_outcome,
    show_status,
)
from app.cluster.cluster import Cluster
from app.cluster.joined import JoinedCluster
from app.document.storing.document_file import PROJECT_FILE
from app.evaluation.headless import BAD_INPUT_KINDS, ClipOutcome, train_clips, train_document
from app.plan.planning import clip_history, memory_text, plan_clip, plan_document, plan_text, totals
from app.plan.sequence import plan_sequence, sequence_text
from app.plan.side_by_side import PlannedClips, SideBySide, plan_here
from app.plan.speed import step_time
from app.project.clips.clip_catalog import ClipCatalog
from app.residuals.kept_reading import note_kept
from app.status import TrainingStatus
from app.training.due import is_due
from app.training.service import Launch, TrainingService
from engine.errors import CaptureError, DiskError, ProjectError
from engine.portable import NATIVE, PROCESSORS, environment_of
from engine.storage.json_files import json_text
from engine.text import duration_text, shown
from engine.training.config import parse_overrides


def add_arguments(command: argparse.ArgumentParser) -> None:
    """Arguments of `clipgstream train`."""
    add_project_arguments(command)
    command.add_argument(
        "--clip",
        type=int,
        metavar="K",
        help="train this clip only, beside other processes and computers that train others; does nothing if it is "
        f"trained. Exit code {EXIT_NOT_READY}: its reference is not trained yet, or another process trains it",
    )
    command.add_argument(
        "--workers",
        type=workers_argument,
        metavar="N",
        help="train N clips side by side, on as many cores and in as much memory as there is (default: 1); with "
        "--plan, what N machines would cost",
    )
    command.add_argument(
        "--again",
        action="store_true",
        help="train the chosen clips even if they are trained or damaged; the earlier result becomes a version",
    )
    command.add_argument(
        "--clip-set",
        dest="own_assignments",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="a training setting for the chosen clips only; may be given several times",
    )
    command.add_argument(
        "--start-over",
        dest="is_starting_over",
        action="store_true",
        help="first discard everything trained in the project, so that its settings can change; --plan shows what",
    )
    command.add_argument(
        "--cpu",
        choices=PROCESSORS,
        default=NATIVE,
        help="portable: the same result on every kind of x86-64 processor, slower (default: native, all instructions)",
    )
    add_cluster(command, does="train", things="clips")
    command.add_argument(
        "--plan", action="store_true", help="show what would be trained and what it costs; train nothing"
    )
    command.add_argument(
        "--price-per-hour", type=float, metavar="X", help="with --plan: price of a worker, in any unit, for the total"
    )
    command.add_argument(
        "--json", action="store_true", help="print the outcome, or the plan, as JSON on standard output"
    )
    command.add_argument("--quiet", action="store_true", help="show no progress")


def workers_argument(text: str) -> int:
    """A number of workers, at least one."""
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{shown(text)} is not a number of clips, 1 or more")
    return int(text)


def exit_code(outcomes: Sequence[ClipOutcome]) -> int:
    """Of a training that ended like this: bad input only where nothing else went wrong."""
    failed = [outcome for outcome in outcomes if outcome.state == "failed"]
    if failed and all(outcome.kind in BAD_INPUT_KINDS for outcome in failed):
        return EXIT_BAD_INPUT
    return EXIT_FAILED if any(outcome.state in ("failed", "damaged") for outcome in outcomes) else EXIT_OK


def run(options: argparse.Namespace, launch: Launch) -> int:
    """clipgstream train: train clips, or print their plan. Returns the exit code."""
    _check_price(options)
    if options.plan:
        return _plan(options)
    environment_of(options.cpu)  # refused before a project is made
    if options.clip is not None:
        return train_single_clip(options, launch)
    if options.cluster is not None and options.workers is not None:
        raise ProjectError("--cluster cannot be combined with --workers.", hint="Write --cluster local:N for N clips.")
    was_folder, was_project = options.project.exists(), (options.project / PROJECT_FILE).is_file()
    line = ProgressLine(is_quiet=options.quiet)
    project, capture = open_for_training(options, line.say)
    is_refused, outcomes = False, []
    service: TrainingService | None = None
    cluster: Cluster | None = None
    try:
        clips = project.clips(capture.n_frames)
        chosen = parse_range(options.clips, len(clips), option="--clips", what="clips")
        holdout = capture.camera_indices(project.settings.holdout)
        first = project.settings.reference_clip  # the others cannot begin before it
        order = sorted(chosen, key=lambda clip_index: clip_index != first)
        catalog = ClipCatalog(project, len(clips))
        to_train = [clips[i] for i in order if options.again or is_due(catalog, i)]
        if options.cluster is None:
            sequence = plan_here(project, capture, to_train, catalog, options.workers or 1)
        else:
            joined = JoinedCluster(options.cluster, project, capture, to_train, catalog)
            cluster, launch = joined.cluster, joined.launch
            sequence = PlannedClips(SideBySide(joined.n_slots), joined.kinds)
        n_workers = sequence.together.n_workers
        service = TrainingService(
            project,
            clips,
            holdout=holdout,
            launch=launch,
            is_window_open=False,
            catalog=catalog,
            n_workers=n_workers,
            cpu=options.cpu,
        )
        service.set_live_view("off")
        note_kept(catalog, project, capture)
        names = ", ".join(project.settings.holdout) or "none"
        line.say(
            f"{capture.path}: {len(capture.rig)} cameras (held out: {names}), {capture.n_frames} frames, "
            f"clips {chosen.start} to {chosen.stop - 1} of {len(clips)}"
        )
        for sentence in (*capture.warnings, *(() if cluster is None else cluster.words)):
            line.say(f"Note: {sentence}")
        first = project.settings.reference_clip  # the others cannot begin before it
        plans = PlanLines(
            line,
            project,
            capture,
            catalog=service.catalog,
            step_time=step_time,
            is_quiet=options.quiet,
        )

        def follow(status: TrainingStatus) -> None:
            show_status(line, status)
            if cluster is not None and service is not None:
                service.n_workers = cluster.n_slots  # computers come and go

        if sequence.together.why_fewer:
            line.say(f"Note: {sequence.together.why_fewer}")
        plans = PlanLines(line, project, capture, catalog=catalog, step_time=step_time, is_quiet=options.quiet)
        table = SequenceTable(line, project, to_train, sequence)
        outcomes = train_clips(
            service,
            order,
            on_begin=lambda clip_index: plans.begin(clips[clip_index]),
            is_again=options.again,
            own=parse_overrides(options.own_assignments) or None,
            on_status=follow,
            on_event=lambda event: show_event(line, event, has_others=n_workers > 1),
            on_outcome=lambda outcome: (
                show_outcome(line, outcome, has_others=len(order) > 1),
                plans.end(outcome),
                table.end(outcome),
            ),
        )
        is_refused = exit_code(outcomes) == EXIT_BAD_INPUT
        line.finish()
        if options.json:
            document = train_document(project, capture, outcomes)
            print(json_text(document if cluster is None else document | {"cluster": cluster.document()}, indent=2))
    except (CaptureError, ProjectError) as error:
        is_refused = not isinstance(error, DiskError)
        raise
    finally:
        line.finish()
        if service is not None:
            service.close()
        if cluster is not None:
            cluster.close()
        has_learned = project.has_progress or any(outcome.step for outcome in outcomes)
        if is_refused and not was_project and not has_learned:  # bad input leaves nothing behind
            project.remove_files()
        project.close()
        if is_refused and not was_folder:
            with contextlib.suppress(OSError):  # not empty: something was learned
                options.project.rmdir()
    code = exit_code(outcomes)
    return code if code == EXIT_OK else fail(code, failure_text(outcomes))


def _check_price(options: argparse.Namespace) -> None:
    price = options.price_per_hour
    if price is not None and not (options.plan and 0 <= price < math.inf):
        problem = f"is {price}" if options.plan else "is of a plan"
        raise ProjectError(f"--price-per-hour {problem}.", hint="Give a price of 0 or more together with --plan.")


def _plan(options: argparse.Namespace) -> int:
    project, capture = project_to_plan(options)
    clips = project.clips(capture.n_frames)
    chosen = parse_range(options.clips, len(clips), option="--clips", what="clips")
    discarded = what_goes(project, options)
    catalog = ClipCatalog(project, len(clips))
    order = [i for i in catalog.order if i in chosen]
    is_afresh = options.is_starting_over
    kept = [] if is_afresh else order
    trained = [i for i in kept if catalog[i].state == "trained"]
    damaged = [i for i in kept if catalog[i].state == "damaged" or catalog[i].blocked_by is not None]
    history = clip_history(project, len(clips), catalog)
    plans = [
        plan_clip(
            project, capture, clips[i], step_time=step_time, history=history, catalog=catalog, is_afresh=is_afresh
        )
        for i in order
        if i not in trained and i not in damaged
    ]
    sequence = None
    if plans and (options.workers is not None or options.price_per_hour is not None):
        n_workers, price = options.workers or 1, options.price_per_hour
        sequence = plan_sequence(project, capture, plans, n_workers=n_workers, price_per_hour=price)
    if options.json:
        document = plan_document(project, capture, plans, trained, damaged, sequence) | {"discards": discarded}
        print(json_text(document, indent=2))
        return EXIT_OK
    if discarded:
        print(f"Discards {discarded}")
    for plan in plans:
        print("\n".join(plan_text(plan)))
    if trained:
        print(f"Already trained: clip {', '.join(str(clip_index) for clip_index in trained)}")
    if damaged:
        listed = ", ".join(str(clip_index) for clip_index in damaged)
        print(f"Skipped, because damaged or in need of a damaged clip: clip {listed}")
    if len(plans) > 1:
        sums = totals(plans)
        times = (sums["preparation_s"], sums["training_s"])
        seconds = None if None in times else sum(value or 0.0 for value in times)
        stored = "" if sums["disk_mb"] is None else f", {sums['disk_mb']:.2g} MB stored"
        print(
            f"All {len(plans)} clips: about {duration_text(seconds)}, at most {memory_text(sums['memory_mb'])}{stored}"
        )
    if sequence is not None:
        print("\n".join(sequence_text(sequence)))
    return EXIT_OK
