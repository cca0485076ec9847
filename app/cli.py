"""The command line without a window: train, eval, render, inspect, gate, doctor, bench, ablate, report.

Parser and dispatch; larger commands lie with what they run.
Exit codes: 0 done, 1 failed, 2 bad input, 130 interrupted. One plain message each, details in the log file. Results
go to standard output, progress and messages to standard error.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import logging
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from app.ablation.command import ablate
from app.arguments import (
    COMMANDS,
    EXIT_BAD_INPUT,
    EXIT_OK,
    PlainParser,
    add_figure_choices,
    add_training_settings,
    overrides_of,
    parse,
    parse_cameras,
    parse_range,
)
from app.bench.command import CHART_FILE, DEFAULT_OUT, bench
from app.bench.speed import known_machine_speed
from app.evaluation_command import evaluate
from app.gate_command import add_gate_arguments, gate
from app.headless import (
    open_trained,
    render_frames,
    train_clips,
    train_document,
)
from app.logs import start_logging
from app.planning import plan_clip, plan_document, plan_text, totals
from app.progress import ProgressLine, duration_text, row_progress
from app.project import (
    PROJECT_FILE,
    Project,
    ProjectSettings,
    check_settings,
    create_project,
    default_settings,
    open_project,
    read_settings,
)
from app.report.command import report
from app.results import check_writable
from app.training.lines import PlanLines, show_event, show_outcome, show_status
from app.training.process import ProcessWorker
from app.training.service import Launch, TrainingService
from engine.capture.capture import Capture, open_capture
from engine.errors import CaptureError, EngineError, ProjectError

logger = logging.getLogger(__name__)

EXIT_FAILED, EXIT_INTERRUPTED = 1, 130
BAD_INPUT_KINDS = ("CaptureError", "ProjectError")
"""Failures of a worker that are the input's and not the program's."""
_GOES_ON = "What was learned is kept; the same command goes on from there."
_INTERRUPTED = {
    "train": _GOES_ON,
    "ablate": _GOES_ON,
    "eval": "Nothing was written.",
    "report": "The page was not written; projects that were measured to the end need not be measured again.",
    "render": "A video was not written; single pictures that were finished are there.",
}
"""What has become of the work, by command."""
VIDEO_SUFFIXES = (".mp4", ".m4v", ".mov")


def build_parser() -> argparse.ArgumentParser:
    """Arguments of every subcommand."""
    parser = PlainParser(prog="clipgstream", description="Train, measure and render dynamic captures without a window.")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")

    train = commands.add_parser("train", help=COMMANDS["train"], description="Train clips of a capture.")
    train.add_argument("capture", type=Path, help="capture folder")
    train.add_argument("--project", type=Path, required=True, help="project folder; made when it is not there")
    train.add_argument("--clips", default=":", metavar="A:B", help="clips A up to B, B not included (default: all)")
    add_training_settings(train)
    train.add_argument("--seed", type=int, help="fixes initial values and order of pictures (default: 0)")
    train.add_argument("--reference-clip", type=int, metavar="K", help="clip that others inherit from (default: 0)")
    train.add_argument(
        "--plan", action="store_true", help="say what would be trained, why, and what it takes; train nothing"
    )
    train.add_argument("--json", action="store_true", help="print the outcome, or the plan, as JSON on standard output")
    train.add_argument("--quiet", action="store_true", help="no progress")

    eval_parser = commands.add_parser("eval", help=COMMANDS["eval"], description="Measure trained clips.")
    eval_parser.add_argument("project", type=Path, help="project folder")
    eval_parser.add_argument("--json", required=True, metavar="OUT", help="file for all rows and means; - prints them")
    eval_parser.add_argument("--clips", default=":", metavar="A:B", help="clips to measure (default: all trained)")
    add_figure_choices(eval_parser, default="all", said="all")
    eval_parser.add_argument("--quiet", action="store_true", help="no progress")

    render = commands.add_parser("render", help=COMMANDS["render"], description="Render a camera of trained clips.")
    render.add_argument("project", type=Path, help="project folder")
    render.add_argument("--camera", required=True, metavar="NAME", help="camera of the capture")
    render.add_argument("--frames", default=":", metavar="A:B", help="frames A up to B, B not included (default: all)")
    render.add_argument("--out", type=Path, required=True, metavar="FILE.mp4|DIR", help="video, or folder for PNGs")
    render.add_argument(
        "--features",
        choices=("both", "static", "dynamic"),
        default="both",
        help="show what the static or the dynamic features of the anchors carry (default: both)",
    )
    render.add_argument("--quiet", action="store_true", help="no progress")

    inspect = commands.add_parser(
        "inspect",
        help=COMMANDS["inspect"],
        description="Describe a capture, or what the trained clips of a project weigh.",
    )
    inspect.add_argument("path", type=Path, help="capture or project folder")
    inspect.add_argument("--json", action="store_true", help="print everything as JSON")

    add_gate_arguments(
        commands.add_parser(
            "gate",
            help=COMMANDS["gate"],
            description="Say what the gate decided in each trained clip, and mark regions that clips trained from now "
            "on take as static or as dynamic.",
        )
    )

    doctor = commands.add_parser("doctor", help=COMMANDS["doctor"], description="Look at this machine.")
    doctor.add_argument("--json", action="store_true", help="print the findings as JSON")

    bench_parser = commands.add_parser(
        "bench",
        help=COMMANDS["bench"],
        description="Measure the kernels on this machine: speed beside error, as a table and a picture.",
    )
    bench_parser.add_argument(
        "--out",
        type=Path,
        default=DEFAULT_OUT,
        metavar="DIR",
        help=f"folder for the picture {CHART_FILE} (default: {DEFAULT_OUT})",
    )
    bench_parser.add_argument("--json", metavar="FILE", help="file for all figures; - prints them instead of the table")
    bench_parser.add_argument("--full", action="store_true", help="all scenes and sizes; takes some minutes, not one")
    bench_parser.add_argument("--threads", type=int, metavar="N", help="threads to compute with (default: every core)")
    bench_parser.add_argument("--quiet", action="store_true", help="no progress")

    ablate_parser = commands.add_parser(
        "ablate",
        help=COMMANDS["ablate"],
        description="Train the method, its ablations and baselines on a capture, and write the table.",
    )
    ablate_parser.add_argument("capture", type=Path, nargs="?", help="capture folder")
    ablate_parser.add_argument("--project", type=Path, help="folder for one project per variant and the table")
    ablate_parser.add_argument(
        "--variants", metavar="NAMES", help="separated by commas (default: all; --list names them)"
    )
    ablate_parser.add_argument("--list", action="store_true", help="say what the variants are and end")
    ablate_parser.add_argument("--n-clips", type=int, metavar="N", help="clips from the first (default: up to 4)")
    ablate_parser.add_argument(
        "--source-steps",
        metavar="N,M,...",
        help="train source clips with each of these numbers of steps: quality over time",
    )
    ablate_parser.add_argument("--seeds", default="0", help="separated by commas (default: 0)")
    ablate_parser.add_argument(
        "--reference-clip", type=int, default=0, metavar="K", help="clip that others inherit from (default: 0)"
    )
    add_figure_choices(ablate_parser, default="quick", said="quick")
    add_training_settings(ablate_parser)
    ablate_parser.add_argument("--json", action="store_true", help="print the table as JSON on standard output")
    ablate_parser.add_argument("--quiet", action="store_true", help="no progress")

    report_parser = commands.add_parser(
        "report",
        help=COMMANDS["report"],
        description="Write one HTML page about a trained project, with its figures as PNG and numbers as CSV and JSON.",
    )
    report_parser.add_argument("project", type=Path, help="project folder")
    report_parser.add_argument(
        "--compare",
        type=Path,
        nargs="+",
        action="extend",
        default=[],
        metavar="OTHER",
        help="project folders, or folders of projects, to set beside it",
    )
    report_parser.add_argument("--out", type=Path, metavar="DIR", help="folder for the page (default: PROJECT/reports)")
    add_figure_choices(report_parser, default=None, said="all for the project, quick for the others")
    report_parser.add_argument("--quiet", action="store_true", help="no progress")
    return parser


def main(argv: Sequence[str] | None = None, *, launch: Launch = ProcessWorker) -> int:
    """Run one subcommand.

    Args:
        argv: Arguments after the program's name; those of the process when None.
        launch: Starts a training worker; a process by default.
    Returns:
        The exit code.
    """
    try:
        options = parse(build_parser(), argv)
    except SystemExit as error:  # argparse has said what is wrong
        return int(error.code or 0)
    log_file = start_logging()
    try:
        with _terminating_like_ctrl_c():
            return _COMMANDS[options.command](options, launch)
    except (CaptureError, ProjectError) as error:
        return _fail(EXIT_BAD_INPUT, str(error))
    except EngineError as error:
        return _fail(EXIT_FAILED, str(error))
    except PermissionError as error:  # a path of the command line below a folder that may not even be looked into
        return _fail(EXIT_BAD_INPUT, f"{error.strerror}. Choose a folder you may use. - {error.filename}")
    except KeyboardInterrupt:
        return _fail(EXIT_INTERRUPTED, f"Interrupted. {_INTERRUPTED.get(options.command, '')}".rstrip())
    except BrokenPipeError:  # whoever read our output has left
        return EXIT_FAILED
    except Exception as error:  # the edge of the command line: one line, no traceback
        logger.exception("%s failed", options.command)
        where = f" Details are in {log_file}." if log_file else ""
        return _fail(EXIT_FAILED, f"{type(error).__name__}: {error}. This is a fault of the program.{where}")


def _fail(code: int, message: str) -> int:
    logger.error("exit %d: %s", code, message)
    print(f"clipgstream: {message}", file=sys.stderr)
    return code


@contextlib.contextmanager
def _terminating_like_ctrl_c() -> Iterator[None]:
    """SIGTERM stops as cleanly as Ctrl+C does."""

    def interrupt(signum: int, frame: object) -> None:
        raise KeyboardInterrupt

    try:
        before = signal.signal(signal.SIGTERM, interrupt)
    except ValueError:  # not the main thread
        yield
        return
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def _open_for_training(options: argparse.Namespace) -> tuple[Project, Capture]:
    """The project of the arguments, made or opened; what was given has to agree with what is there."""
    settings, stored, capture = _chosen_settings(options)
    if stored is None:
        return create_project(options.project, settings), capture
    project = open_project(options.project)
    try:
        _check_changes(options, project, settings)
    except ProjectError:
        project.close()
        raise
    if settings != stored:
        project.update(settings)
    return project, capture


def _project_to_plan(options: argparse.Namespace) -> tuple[Project, Capture]:
    """Likewise, for looking only: nothing is made, changed or locked."""
    settings, stored, capture = _chosen_settings(options)
    project = Project(options.project, settings, None)
    if stored is not None:
        _check_changes(options, Project(options.project, stored, None), settings)
    return project, capture


def _chosen_settings(options: argparse.Namespace) -> tuple[ProjectSettings, ProjectSettings | None, Capture]:
    """Settings that the arguments ask for, those of the project where there is one, and the capture."""
    overrides = overrides_of(options)
    exists = (options.project / PROJECT_FILE).is_file()
    stored = read_settings(options.project) if exists else None
    scale = options.scale if options.scale is not None else 1.0 if stored is None else stored.scale
    capture = open_capture(options.capture, scale=scale)
    holdout = None if options.holdout is None else parse_cameras(options.holdout, capture)
    if stored is None:
        settings = default_settings(
            capture,
            clip_length=options.clip_length,
            holdout=holdout,
            seed=options.seed or 0,
            overrides=overrides,
            reference_clip=options.reference_clip or 0,
        )
        n_clips = len(settings.clips(capture.n_frames))
        parse_range(options.clips, n_clips, option="--clips", what="clips")  # said before the folder is made
        return settings, None, capture
    given = {
        "scale": options.scale,
        "clip_length": options.clip_length,
        "seed": options.seed,
        "holdout": holdout,
        "reference_clip": options.reference_clip,
    }
    changes: dict[str, Any] = {name: value for name, value in given.items() if value is not None}
    if capture.fingerprint != stored.fingerprint:
        raise ProjectError(
            "The project was made for another capture.", hint="Choose another --project folder.", path=options.project
        )
    place = str(Path(capture.path).resolve())  # the capture may have moved
    settings = replace(stored, **changes, overrides=stored.overrides | overrides, capture=place)
    check_settings(settings, capture)
    return settings, stored, capture


def _check_changes(options: argparse.Namespace, project: Project, settings: ProjectSettings) -> None:
    """See that nothing was learned with other settings."""
    stored = project.settings
    names = ("scale", "clip_length", "seed", "holdout", "reference_clip", "overrides")
    changed = [name for name in names if getattr(settings, name) != getattr(stored, name)]
    if changed and project.has_progress:
        listed = ", ".join(f"{name} {getattr(stored, name)!r}" for name in changed)
        raise ProjectError(
            f"The project was trained with {listed}; that cannot change any more.",
            hint="Leave the option out, or choose another --project folder.",
            path=options.project,
        )


# ---------------------------------------------------------------- commands


def _plan(options: argparse.Namespace) -> int:
    project, capture = _project_to_plan(options)
    clips = project.clips(capture.n_frames)
    chosen = parse_range(options.clips, len(clips), option="--clips", what="clips")
    order = [i for i in project.training_order(len(clips)) if i in chosen]
    trained = [clip_index for clip_index in order if project.is_trained(clip_index)]
    plans = [
        plan_clip(project, capture, clips[i], measure_machine=known_machine_speed) for i in order if i not in trained
    ]
    if options.json:
        print(json.dumps(plan_document(project, capture, plans, trained), indent=2))
        return EXIT_OK
    for plan in plans:
        print("\n".join(plan_text(plan)))
    if trained:
        print(f"Trained already: clip {', '.join(str(clip_index) for clip_index in trained)}")
    if len(plans) > 1:
        sums = totals(plans)
        print(
            f"All {len(plans)} clips: about {duration_text(sums['preparation_s'] + sums['training_s'])}, "
            f"at most {sums['memory_mb'] / 1e3:.1f} GB of memory, {sums['disk_mb']:.2g} MB stored"
        )
    return EXIT_OK


def _train(options: argparse.Namespace, launch: Launch) -> int:
    if options.plan:
        return _plan(options)
    was_folder, was_project = options.project.exists(), (options.project / PROJECT_FILE).is_file()
    project, capture = _open_for_training(options)
    is_refused = False
    line = ProgressLine(is_quiet=options.quiet)
    service: TrainingService | None = None
    try:
        clips = project.clips(capture.n_frames)
        chosen = parse_range(options.clips, len(clips), option="--clips", what="clips")
        holdout = capture.camera_indices(project.settings.holdout)
        service = TrainingService(project, clips, holdout=holdout, launch=launch, is_window_open=False)
        names = ", ".join(project.settings.holdout) or "none"
        line.say(
            f"{capture.path}: {len(capture.rig)} cameras (held out: {names}), {capture.n_frames} frames, "
            f"clips {chosen.start} to {chosen.stop - 1} of {len(clips)}"
        )
        first = project.settings.reference_clip  # the others cannot begin before it
        plans = PlanLines(line, project, capture, measure_machine=known_machine_speed, is_quiet=options.quiet)
        outcomes = train_clips(
            service,
            sorted(chosen, key=lambda clip_index: clip_index != first),
            on_begin=lambda clip_index: plans.begin(clips[clip_index]),
            on_status=lambda status: show_status(line, status),
            on_event=lambda event: show_event(line, event),
            on_outcome=lambda outcome: (show_outcome(line, outcome), plans.end(outcome)),
        )
        is_refused = outcomes[-1].kind in BAD_INPUT_KINDS
        line.finish()
        if options.json:
            print(json.dumps(train_document(project, capture, outcomes), indent=2))
    except (CaptureError, ProjectError):
        is_refused = True
        raise
    finally:
        line.finish()
        if service is not None:
            service.close()
        if is_refused and not was_project and not project.has_progress:  # bad input leaves nothing behind
            project.remove_files()
        project.close()
        if is_refused and not was_folder:
            with contextlib.suppress(OSError):  # not empty: something was learned
                options.project.rmdir()
    last = outcomes[-1]
    if last.state == "failed":
        code = EXIT_BAD_INPUT if last.kind in BAD_INPUT_KINDS else EXIT_FAILED
        return _fail(code, " ".join(part for part in (last.message, last.hint) if part))
    return EXIT_OK


def _render(options: argparse.Namespace, launch: Launch) -> int:
    from app.video import write_pictures, write_video

    opened = open_trained(open_project(options.project, is_writable=False))
    capture = opened.capture
    chosen = parse_cameras(options.camera, capture)
    if len(chosen) != 1:
        raise ProjectError(f"--camera is '{options.camera}'; one camera can be rendered at a time.")
    camera_index = capture.rig.names.index(chosen[0])
    frames = parse_range(options.frames, capture.n_frames, option="--frames", what="frames")
    if options.frames.strip() == ":":
        frames = [f for i in opened.trained for f in opened.clips[i].frame_indices()]
    line = ProgressLine(is_quiet=options.quiet)
    progress = row_progress(line, "Rendering")

    def images() -> Iterator[tuple[int, Any]]:
        rendered = render_frames(opened, camera_index=camera_index, frame_indices=frames, features=options.features)
        for done, item in enumerate(rendered, start=1):
            yield item
            progress(done, len(frames), None)

    out: Path = options.out
    if out.suffix.lower() in VIDEO_SUFFIXES:
        check_writable(out)
        n_images = write_video(out, (image for _, image in images()), fps=capture.fps)
    elif out.suffix and not out.is_dir():
        raise ProjectError(
            f"--out ends in '{out.suffix}', which is no known video.", hint="Write FILE.mp4 or a folder.", path=out
        )
    else:
        check_writable(out / "frame.png")
        n_images = write_pictures(out, images())
    line.say(f"{n_images} frames of camera {chosen[0]} in {out}")
    return EXIT_OK


def _inspect(options: argparse.Namespace, launch: Launch) -> int:
    from app.inspection import describe_project, is_project, project_lines
    from engine.capture.inspect import describe

    is_one = is_project(options.path)
    found = describe_project(options.path) if is_one else describe(open_capture(options.path))
    if options.json:
        print(json.dumps(found, indent=2))
        return EXIT_OK
    if is_one:
        print("\n".join(project_lines(found)))
        return EXIT_OK
    print(
        f"{found['path']}: {found['format']} layout, {found['n_cameras']} cameras, {found['n_frames']} frames at "
        f"{found['fps']:g} per second ({found['duration_s']:.1f} s)"
    )
    for camera in found["cameras"]:
        held_out = "  suggested as hold-out" if camera["is_default_holdout"] else ""
        print(
            f"  {camera['name']:>8}  {camera['width']}x{camera['height']}  view {camera['fov_x_deg']:.0f} x "
            f"{camera['fov_y_deg']:.0f} degrees{held_out}"
        )
    print(f"The cameras are up to {found['rig_extent']:.3g} scene units apart.")
    for warning in found["warnings"]:
        print(f"Note: {warning}")
    return EXIT_OK


def _doctor(options: argparse.Namespace, launch: Launch) -> int:
    from app.doctor import examine

    findings = examine()
    if options.json:
        rows = [{"subject": f.subject, "text": f.text, "is_fine": f.is_fine} for f in findings]
        print(json.dumps({"schema": 1, "findings": rows}, indent=2))
    else:
        for finding in findings:
            print(f"{'ok ' if finding.is_fine else '!! '} {finding.subject:<9} {finding.text}")
    return EXIT_OK


_COMMANDS: dict[str, Callable[[argparse.Namespace, Launch], int]] = {
    "train": _train,
    "eval": evaluate,
    "render": _render,
    "inspect": _inspect,
    "gate": gate,
    "doctor": _doctor,
    "bench": bench,
    "report": report,
    "ablate": ablate,
}
