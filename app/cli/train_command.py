"""clipgstream train: trains the clips of a project, or only prints their plan."""

from __future__ import annotations

import argparse
import math
from contextlib import ExitStack, suppress

from app.cli.arguments import (
    EXIT_BAD_INPUT,
    EXIT_NOT_READY,
    EXIT_OK,
    EXIT_STOPPED,
    add_cluster,
    count_of,
    fail,
    parse_range,
)
from app.cli.chosen_project import add_project_arguments, open_for_training, project_to_plan, what_goes
from app.cli.single_clip import train_single_clip
from app.cli.terminal.exit_codes import exit_code
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
from app.evaluation.headless import ClipOutcome, train_clips, train_document
from app.plan.planning import clip_history, memory_text, plan_clip, plan_document, plan_text, totals
from app.plan.sequence import plan_sequence, sequence_text
from app.plan.side_by_side import PlannedClips, SideBySide, plan_here
from app.plan.speed import step_time
from app.project.clips.clip_catalog import ClipCatalog
from app.project.project import Project
from app.residuals.kept_reading import note_kept
from app.status import TrainingStatus
from app.training.due import is_due
from app.training.service import Launch, TrainingService
from engine.capture.capture import Capture
from engine.errors import DiskError, EngineError, ProjectError
from engine.parallel import n_cores
from engine.portable import NATIVE, PROCESSORS, environment_of
from engine.storage.json_files import json_text
from engine.text import duration_text
from engine.training.config import parse_overrides


def add_arguments(command: argparse.ArgumentParser) -> None:
    """Arguments of `clipgstream train`."""
    add_project_arguments(command)
    command.add_argument(
        "--clip",
        type=int,
        metavar="K",
        help="train this clip only, while other processes and computers train others; nothing happens if it is "
        f"trained. Exit code {EXIT_NOT_READY}: its reference is not trained yet, or another process trains it; "
        f"{EXIT_STOPPED}: somebody stopped it",
    )
    command.add_argument(
        "--workers",
        type=count_of("clips"),
        metavar="N",
        help="train N clips side by side, at most one per core, if memory suffices (default: 1); with --plan, forecast "
        "what N workers cost",
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


def run(options: argparse.Namespace, launch: Launch) -> int:
    """clipgstream train: train clips, or print their plan. Returns the exit code."""
    _check_price(options)
    if options.plan:
        _check_plan(options)
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
    try:
        outcomes = _train(options, launch, project, capture, line)
        is_refused = exit_code(outcomes) == EXIT_BAD_INPUT
    except EngineError as error:  # also a cluster that does not answer
        is_refused = not isinstance(error, DiskError)
        raise
    finally:
        has_learned = project.has_progress or any(outcome.step for outcome in outcomes)
        if is_refused and not was_project and not has_learned:  # bad input leaves nothing behind
            project.remove_files()
        project.close()
        if is_refused and not was_folder:
            with suppress(OSError):  # not empty: something was learned
                options.project.rmdir()
    code = exit_code(outcomes)
    return code if code == EXIT_OK else fail(code, failure_text(outcomes))


def _train(
    options: argparse.Namespace, launch: Launch, project: Project, capture: Capture, line: ProgressLine
) -> list[ClipOutcome]:
    clips = project.clips(capture.n_frames)
    chosen = parse_range(options.clips, len(clips), option="--clips", what="clips")
    first = project.settings.reference_clip  # the others cannot begin before it
    order = sorted(chosen, key=lambda clip_index: clip_index != first)
    catalog = ClipCatalog(project, len(clips))
    to_train = [clips[i] for i in order if options.again or is_due(catalog, i)]
    cluster: Cluster | None = None
    with ExitStack() as kept:
        kept.callback(line.finish)
        if options.cluster is None:
            sequence = plan_here(project, capture, to_train, catalog, options.workers or 1)
        else:
            joined = JoinedCluster(options.cluster, project, capture, to_train, catalog, cpu=options.cpu)
            kept.callback(joined.close)
            cluster, launch = joined.cluster, joined.launch
            n_slots = joined.n_slots
            sequence = PlannedClips(SideBySide(n_slots), joined.kinds, n_slots * n_cores() / cluster.n_cores)
        service = TrainingService(
            project,
            clips,
            holdout=capture.camera_indices(project.settings.holdout),
            launch=launch,
            is_window_open=False,
            catalog=catalog,
            n_workers=sequence.together.n_workers,
            cpu=options.cpu,
        )
        kept.callback(service.close)
        service.set_live_view("off")
        note_kept(catalog, project, capture)
        names = ", ".join(project.settings.holdout) or "none"
        line.say(
            f"{capture.path}: {len(capture.rig)} cameras (held out: {names}), {capture.n_frames} frames, "
            f"clips {chosen.start} to {chosen.stop - 1} of {len(clips)}"
        )
        notes = (*capture.warnings, *(() if cluster is None else cluster.words), sequence.together.why_fewer)
        for sentence in filter(None, notes):
            line.say(f"Note: {sentence}")
        table = SequenceTable(line, project, to_train, sequence)
        has_others = cluster is not None or sequence.together.n_workers > 1
        is_quiet = options.quiet or has_others  # plans look at pictures, and are of clips that have all cores
        plans = PlanLines(line, project, capture, catalog=catalog, step_time=step_time, is_quiet=is_quiet)

        def show(status: TrainingStatus) -> None:
            if cluster is not None:
                service.n_workers = cluster.n_slots  # computers come and go
            if has_others:
                table.show(status)
            else:
                show_status(line, status)

        outcomes = train_clips(
            service,
            order,
            on_begin=lambda clip_index: plans.begin(clips[clip_index]),
            is_again=options.again,
            own=parse_overrides(options.own_assignments) or None,
            on_status=show,
            on_event=lambda event: show_event(line, event, has_others=has_others),
            on_outcome=lambda outcome: (
                show_outcome(line, outcome, has_others=len(order) > 1),
                plans.end(outcome),
                table.end(outcome),
            ),
        )
        line.finish()
        if options.json:
            document = train_document(project, capture, outcomes)
            print(json_text(document if cluster is None else document | {"cluster": cluster.document()}, indent=2))
    return outcomes


def _check_price(options: argparse.Namespace) -> None:
    price = options.price_per_hour
    if price is not None and not (options.plan and 0 <= price < math.inf):
        problem = f"is {price}" if options.plan else "is of a plan"
        raise ProjectError(f"--price-per-hour {problem}.", hint="Give a price of 0 or more together with --plan.")


def _check_plan(options: argparse.Namespace) -> None:
    instead = {
        "clip": f"Write --clips {options.clip} for the plan of that clip.",
        "cluster": "Write --workers N for what N workers cost.",
    }
    for name, hint in instead.items():
        if getattr(options, name) is not None:
            raise ProjectError(f"--plan cannot be combined with --{name}.", hint=hint)


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
