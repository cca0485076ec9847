"""The command line without a window: train, eval, render, inspect, doctor, bench, report. The only place that prints.

Exit codes: 0 done, 1 failed, 2 bad input, 130 interrupted. One plain message each, details in the log file. Results
go to standard output, progress and messages to standard error.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import logging
import os
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from app.arguments import EXIT_BAD_INPUT, PlainParser
from app.evaluation import evaluate_project
from app.headless import (
    ClipOutcome,
    open_trained,
    render_frames,
    train_clips,
    train_document,
)
from app.logs import start_logging
from app.progress import ProgressLine, duration_text
from app.project import (
    PROJECT_FILE,
    Project,
    check_settings,
    create_project,
    default_settings,
    open_project,
    read_settings,
)
from app.status import TrainingStatus
from app.training.messages import Event, StageReported, WarningRaised
from app.training.process import ProcessWorker
from app.training.rate import Rate
from app.training.service import Launch, TrainingService
from engine.capture.capture import Capture, open_capture
from engine.errors import CaptureError, EngineError, ProjectError
from engine.files import atomic_path

logger = logging.getLogger(__name__)

EXIT_OK, EXIT_FAILED, EXIT_INTERRUPTED = 0, 1, 130
BAD_INPUT_KINDS = ("CaptureError", "ProjectError")
"""Failures of a worker that are the input's and not the program's."""
CHART_FILE = "speed_error.png"
VIDEO_SUFFIXES = (".mp4", ".m4v", ".mov")


def build_parser() -> argparse.ArgumentParser:
    """Arguments of every subcommand."""
    parser = PlainParser(prog="clipgstream", description="Train, measure and render dynamic captures without a window.")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")

    train = commands.add_parser("train", help="train clips of a capture", description="Train clips of a capture.")
    train.add_argument("capture", type=Path, help="capture folder")
    train.add_argument("--project", type=Path, required=True, help="project folder; made when it is not there")
    train.add_argument("--clips", default=":", metavar="A:B", help="clips A up to B, B not included (default: all)")
    _add_training_settings(train)
    train.add_argument("--seed", type=int, help="fixes initial values and order of pictures (default: 0)")
    train.add_argument("--reference-clip", type=int, metavar="K", help="clip that others inherit from (default: 0)")
    train.add_argument("--json", action="store_true", help="print the outcome as JSON on standard output")
    train.add_argument("--quiet", action="store_true", help="no progress")

    evaluate = commands.add_parser("eval", help="measure trained clips", description="Measure trained clips.")
    evaluate.add_argument("project", type=Path, help="project folder")
    evaluate.add_argument("--json", required=True, metavar="OUT", help="file for all rows and means; - prints them")
    evaluate.add_argument("--clips", default=":", metavar="A:B", help="clips to measure (default: all trained)")
    evaluate.add_argument(
        "--metrics", choices=("quick", "all"), default="all", help="quick: PSNR and SSIM only (default: all)"
    )
    evaluate.add_argument(
        "--precision",
        choices=("float", "8bit"),
        default="float",
        help="compare pictures as rendered, or rounded as in a PNG file (default: float)",
    )
    evaluate.add_argument("--quiet", action="store_true", help="no progress")

    render = commands.add_parser("render", help="render a camera", description="Render a camera of trained clips.")
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
        help="describe a capture or a project",
        description="Describe a capture, or what the trained clips of a project weigh.",
    )
    inspect.add_argument("path", type=Path, help="capture or project folder")
    inspect.add_argument("--json", action="store_true", help="print everything as JSON")

    doctor = commands.add_parser("doctor", help="look at this machine", description="Look at this machine.")
    doctor.add_argument("--json", action="store_true", help="print the findings as JSON")

    bench = commands.add_parser(
        "bench",
        help="measure the kernels on this machine",
        description="Measure the kernels on this machine: speed beside error, as a table and a picture.",
    )
    bench.add_argument("--out", type=Path, metavar="DIR", help=f"folder for the picture {CHART_FILE}")
    bench.add_argument("--json", metavar="FILE", help="file for all figures; - prints them instead of the table")
    bench.add_argument("--full", action="store_true", help="all scenes and sizes; takes some minutes, not one")
    bench.add_argument("--threads", type=int, metavar="N", help="threads to compute with (default: every core)")
    bench.add_argument("--quiet", action="store_true", help="no progress")

    ablate = commands.add_parser(
        "ablate",
        help="train variants of the method and compare them",
        description="Train the method, its ablations and baselines on a capture, and write the table.",
    )
    ablate.add_argument("capture", type=Path, nargs="?", help="capture folder")
    ablate.add_argument("--project", type=Path, help="folder for one project per variant and the table")
    ablate.add_argument("--variants", metavar="NAMES", help="separated by commas (default: all; --list names them)")
    ablate.add_argument("--list", action="store_true", help="say what the variants are and end")
    ablate.add_argument("--n-clips", type=int, metavar="N", help="clips from the first (default: up to 4)")
    ablate.add_argument("--seeds", default="0", help="separated by commas (default: 0)")
    ablate.add_argument("--metrics", choices=("quick", "all"), default="quick", help="quick: PSNR and SSIM only")
    _add_training_settings(ablate)
    ablate.add_argument("--json", action="store_true", help="print the table as JSON on standard output")
    ablate.add_argument("--quiet", action="store_true", help="no progress")

    report = commands.add_parser(
        "report",
        help="write a page about a project",
        description="Write one HTML page about a trained project, with its figures as PNG and numbers as CSV and JSON.",
    )
    report.add_argument("project", type=Path, help="project folder")
    report.add_argument(
        "--compare",
        type=Path,
        nargs="+",
        action="extend",
        default=[],
        metavar="OTHER",
        help="project folders, or folders of projects, to set beside it",
    )
    report.add_argument("--out", type=Path, metavar="DIR", help="folder for the page (default: PROJECT/reports)")
    report.add_argument(
        "--metrics",
        choices=("quick", "all"),
        help="quick: PSNR and SSIM only (default: all for the project, quick for the others)",
    )
    report.add_argument("--quiet", action="store_true", help="no progress")
    return parser


def _add_training_settings(command: argparse.ArgumentParser) -> None:
    command.add_argument("--holdout", metavar="NAMES", help="cameras to leave out, or 'none' (default: the capture's)")
    command.add_argument("--scale", type=float, help="working size, share of the original in (0, 1] (default: 1)")
    command.add_argument("--clip-length", type=int, metavar="M", help="frames per clip (default: 10)")
    command.add_argument("--preset", metavar="NAME", help="toy, small (the default), medium or paper")
    command.add_argument(
        "--set",
        dest="assignments",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="change a training setting, also one of the preset; may be given several times",
    )


def _overrides(options: argparse.Namespace) -> dict[str, Any]:
    from engine.training.config import parse_overrides
    from engine.training.presets import preset

    return (preset(options.preset) if options.preset else {}) | parse_overrides(options.assignments)


def main(argv: Sequence[str] | None = None, *, launch: Launch = ProcessWorker) -> int:
    """Run one subcommand.

    Args:
        argv: Arguments after the program's name; those of the process when None.
        launch: Starts a training worker; a process by default.
    Returns:
        The exit code.
    """
    try:
        options = build_parser().parse_args(argv)
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
        kept = "" if options.command == "bench" else " What was learned is kept; the same command goes on from there."
        return _fail(EXIT_INTERRUPTED, f"Interrupted.{kept}")
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


# ---------------------------------------------------------------- arguments


def parse_range(text: str, n: int, *, option: str, what: str) -> range:
    """ "A:B", "A:", ":B", ":" or "A" as a range inside range(n).

    Raises:
        ProjectError: It is malformed, empty or reaches outside; names what is allowed.
    """
    first, colon, last = text.partition(":")
    allowed = f"The capture has {what} 0 to {n - 1}; write {option} 0:{n} for all of them."
    try:
        start = int(first) if first.strip() else 0
        stop = (int(last) if last.strip() else n) if colon else start + 1
        if not colon and not first.strip():
            raise ValueError
    except ValueError as error:
        raise ProjectError(f"{option} is '{text}', which is no range A:B.", hint=allowed) from error
    if not 0 <= start < stop <= n:
        raise ProjectError(f"{option} is '{text}', which is empty or reaches outside.", hint=allowed)
    return range(start, stop)


def parse_cameras(text: str, capture: Capture) -> tuple[str, ...]:
    """Camera names separated by commas; numbers that are no names count cameras from 0. "none" is an empty choice.

    Raises:
        ProjectError: There is no such camera.
    """
    names = capture.rig.names
    chosen = []
    for part in (part.strip() for part in text.split(",")):
        if part in names:
            chosen.append(part)
        elif part.isdigit() and int(part) < len(names):
            chosen.append(names[int(part)])
        elif part and part.lower() != "none":
            shown = f"{', '.join(names[:6])}, ... {names[-1]}" if len(names) > 7 else ", ".join(names)
            raise ProjectError(
                f"There is no camera '{part}'.", hint=f"Cameras are {shown}, or numbers from 0 to {len(names) - 1}."
            )
    return tuple(dict.fromkeys(chosen))


def _open_for_training(options: argparse.Namespace) -> tuple[Project, Capture]:
    """The project of the arguments, made or opened; what was given has to agree with what is there."""
    overrides = _overrides(options)
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
        return create_project(options.project, settings), capture
    given = {
        "scale": options.scale,
        "clip_length": options.clip_length,
        "seed": options.seed,
        "holdout": holdout,
        "reference_clip": options.reference_clip,
    }
    changes: dict[str, Any] = {
        name: value for name, value in given.items() if value is not None and value != getattr(stored, name)
    }
    if stored.overrides | overrides != stored.overrides:
        changes["overrides"] = stored.overrides | overrides
    if capture.fingerprint != stored.fingerprint:
        raise ProjectError(
            "The project was made for another capture.", hint="Choose another --project folder.", path=options.project
        )
    changed = replace(stored, **changes)
    check_settings(changed, capture)
    project = open_project(options.project)
    if changes and project.has_progress:
        project.close()
        listed = ", ".join(f"{name} {getattr(stored, name)!r}" for name in changes)
        raise ProjectError(
            f"The project was trained with {listed}; that cannot change any more.",
            hint="Leave the option out, or choose another --project folder.",
            path=options.project,
        )
    if changes or stored.capture != str(Path(capture.path).resolve()):  # the capture may have moved
        project.update(replace(changed, capture=str(Path(capture.path).resolve())))
    return project, capture


# ---------------------------------------------------------------- commands


def _train(options: argparse.Namespace, launch: Launch) -> int:
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
        outcomes = train_clips(
            service,
            sorted(chosen, key=lambda clip_index: clip_index != first),
            on_status=lambda status: _show_status(line, status),
            on_event=lambda event: _show_event(line, event),
            on_outcome=lambda outcome: _show_outcome(line, outcome),
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


def _show_status(line: ProgressLine, status: TrainingStatus) -> None:
    if status.state == "running":
        parts = [f"step {status.step}/{status.n_steps}"]
        if status.steps_per_s:
            parts += [f"{status.steps_per_s:.1f} steps/s", f"{duration_text(status.eta_s)} left"]
        if status.loss_history:
            parts.append(f"loss {status.loss_history[-1][1]:.4f}")
        if status.psnr_history:
            parts.append(f"held-out PSNR {status.psnr_history[-1][1]:.2f} dB")
        line.update(f"Clip {status.clip_index}: training", status.progress, ", ".join(parts))
    elif status.state in ("starting", "preparing"):
        stage = status.stage.lower() if status.stage else "starting"
        line.update(f"Clip {status.clip_index}: {stage}", status.progress, "")


def _show_event(line: ProgressLine, event: Event) -> None:
    match event:
        case StageReported(message=message) if message:
            line.say(f"  {message}")
        case WarningRaised(title=title, detail=detail, hint=hint):
            line.say(". ".join(part for part in (title, detail, hint) if part))
        case _:
            pass


def _show_outcome(line: ProgressLine, outcome: ClipOutcome) -> None:
    figure = "" if outcome.held_out_psnr is None else f", held-out PSNR {outcome.held_out_psnr:.2f} dB"
    if outcome.state == "skipped":
        line.say(f"Clip {outcome.clip_index} is trained already: {outcome.step} steps{figure}")
    elif outcome.state == "trained":
        took = duration_text(outcome.seconds)
        line.say(f"Clip {outcome.clip_index} is trained: {outcome.step} steps in {took}{figure}")


def _evaluate(options: argparse.Namespace, launch: Launch) -> int:
    if options.json != "-":
        check_writable(Path(options.json))
    opened = open_trained(open_project(options.project, is_writable=False))
    chosen = list(parse_range(options.clips, len(opened.clips), option="--clips", what="clips"))
    if options.clips.strip() == ":":
        chosen = opened.trained
    line = ProgressLine(is_quiet=options.quiet)
    progress = _row_progress(line, "Measuring")
    document = evaluate_project(
        opened, clip_indices=chosen, metrics=options.metrics, precision=options.precision, on_progress=progress
    )
    line.finish()
    text = json.dumps(document, indent=1, allow_nan=False)
    if options.json == "-":
        print(text)
        return EXIT_OK
    _write_text(Path(options.json), text + "\n")
    _show_evaluation(line, document)
    line.say(f"{len(document['rows'])} rows in {options.json}")
    return EXIT_OK


def _show_evaluation(line: ProgressLine, document: dict[str, Any]) -> None:
    for clip, summary in document["means"]["clips"].items():
        for group, words in (("held_out", "held out"), ("trained_on", "trained on")):
            found = summary[group]
            if found:
                line.say(
                    f"Clip {clip}, {words}: PSNR {_figure(found['psnr'], 2)} dB, after colour fit "
                    f"{_figure(found['psnr_fit'], 2)} dB, SSIM {_figure(found['ssim'], 4)}"
                )
    for seam in document["seams"]["boundaries"]:
        line.say(
            f"Seam at frame {seam['frame_index']}: score {_figure(seam['score'], 2)}/255, change at the boundary "
            f"{_figure(seam['ratio_static'], 2)} times that inside the clips on static pixels, "
            f"{_figure(seam['ratio_moving'], 2)} times on moving ones (truth: {_figure(seam['truth_ratio_moving'], 2)})"
        )
    missing = document["columns"]["lpips"]["why_missing"]
    if document["metrics"] == "all" and missing:
        line.say(f"LPIPS is left empty: {'; '.join(missing)}")


def _figure(value: float | None, n_digits: int) -> str:
    return "-" if value is None else f"{value:.{n_digits}f}"


def check_writable(path: Path) -> None:
    """See that a result can be written, before the work that leads to it. Makes nothing.

    Raises:
        ProjectError: The path is a folder, or lies where nothing may be written.
    """
    if path.is_dir():
        raise ProjectError("This is a folder, not a file.", hint="Give the name of a file.", path=path)
    folder = next((parent for parent in path.absolute().parents if parent.exists()), Path(path.anchor))
    if not folder.is_dir() or not os.access(folder, os.W_OK):
        reason = "may not be written to" if folder.is_dir() else "is a file"
        raise ProjectError(f"{folder} {reason}.", hint="Choose another place.", path=path)


def _write_text(path: Path, text: str) -> None:
    with _named_failure(path), atomic_path(path) as partial:
        partial.write_text(text, encoding="utf-8")


@contextlib.contextmanager
def _named_failure(path: Path) -> Iterator[None]:
    """A result that cannot be written is the user's to mend."""
    try:
        yield
    except OSError as error:
        raise ProjectError(
            f"The file could not be written ({error.strerror}).", hint="Choose another place.", path=path
        ) from error


def _row_progress(line: ProgressLine, stage: str) -> Callable[[int, int, Any], None]:
    import time

    rate = Rate()

    def show(done: int, n: int, _row: Any) -> None:
        rate.update(done, time.monotonic())
        line.update(stage, done / max(n, 1), f"{done}/{n}, {duration_text(rate.eta_s(n - done))} left")

    return show


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
    progress = _row_progress(line, "Rendering")

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


def _bench(options: argparse.Namespace, launch: Launch) -> int:
    chart = None if options.out is None else options.out / CHART_FILE
    table_file = None if options.json in (None, "-") else Path(options.json)
    for path in (chart, table_file):  # said before a minute is spent
        if path is not None:
            check_writable(path)
    if options.threads is not None and options.threads < 1:
        raise ProjectError(f"--threads is {options.threads}; at least one is needed.")
    from app.bench.suite import FULL, QUICK, document, run_plan
    from app.bench.table import report_text

    line = ProgressLine(is_quiet=options.quiet)
    try:
        report = run_plan(
            FULL if options.full else QUICK,
            n_threads=options.threads,
            say=lambda what, done: line.update(f"Measuring: {what}", done),
        )
    finally:
        line.finish()
    text = json.dumps(document(report), indent=1, allow_nan=False)
    print(text if options.json == "-" else report_text(report))
    if table_file is not None:
        _write_text(table_file, text + "\n")
    if chart is not None:
        from app.bench.chart import draw_speed_error

        with _named_failure(chart), atomic_path(chart) as partial:
            draw_speed_error(report.marks, partial, footer=str(report.machine))
        line.say(f"Speed against error: {chart}")
    return EXIT_OK


def _ablate(options: argparse.Namespace, launch: Launch) -> int:
    from app.ablation.running import RESULT_FILE, TABLE_FILE, Callbacks, run_ablation
    from app.ablation.table import as_text
    from app.ablation.variants import VARIANTS, chosen_variants

    if options.list:
        width = max(len(variant.name) for variant in VARIANTS)
        for variant in VARIANTS:
            print(f"{variant.name:<{width}}  {'baseline: ' if variant.is_baseline else ''}{variant.words}")
        return EXIT_OK
    if options.capture is None or options.project is None:
        raise ProjectError("A capture folder and --project are needed.", hint="Only --list does without.")
    names = None if options.variants is None else [name.strip() for name in options.variants.split(",")]
    variants = chosen_variants(names)
    try:
        seeds = [int(seed) for seed in options.seeds.split(",")]
    except ValueError as error:
        raise ProjectError(f"--seeds is '{options.seeds}'; write whole numbers separated by commas.") from error
    if len(set(seeds)) < len(seeds):
        raise ProjectError(f"--seeds is '{options.seeds}'; a seed counts only once.")
    capture = open_capture(options.capture, scale=options.scale if options.scale is not None else 1.0)
    settings = default_settings(
        capture,
        clip_length=options.clip_length,
        holdout=None if options.holdout is None else parse_cameras(options.holdout, capture),
        seed=seeds[0],
        overrides=_overrides(options),
    )
    for seed in seeds[1:]:
        check_settings(replace(settings, seed=seed), capture)
    most = len(settings.clips(capture.n_frames))
    n_clips = min(most, 4) if options.n_clips is None else options.n_clips
    if not 1 <= n_clips <= most:
        raise ProjectError(f"--n-clips is {n_clips}; the capture has {most} clips of {settings.clip_length} frames.")
    check_writable(options.project / RESULT_FILE)
    line = ProgressLine(is_quiet=options.quiet)

    def show_variant(name: str, seed: int, n_done: int, n: int) -> None:
        line.say(f"{name}, seed {seed} ({n_done + 1} of {n})")

    callbacks = Callbacks(
        on_variant=show_variant,
        on_status=lambda status: _show_status(line, status),
        on_event=lambda event: None,
        on_outcome=lambda outcome: _show_outcome(line, outcome),
        on_row=_row_progress(line, "Measuring"),
    )
    try:
        document = run_ablation(
            options.project,
            capture,
            settings,
            variants=variants,
            n_clips=n_clips,
            seeds=seeds,
            metrics=options.metrics,
            launch=launch,
            callbacks=callbacks,
        )
    finally:
        line.finish()
    if options.json:
        print(json.dumps(document, indent=1, allow_nan=False))
    else:
        print(as_text(document["lines"]))
    line.say(f"All figures: {options.project / RESULT_FILE} and {TABLE_FILE}")
    return EXIT_OK


def _report(options: argparse.Namespace, launch: Launch) -> int:
    from app.report.cache import REPORTS
    from app.report.write import PAGE_FILE, write_report

    read_settings(options.project)  # a folder that is no project is said first
    check_writable((options.project / REPORTS if options.out is None else options.out) / PAGE_FILE)
    line = ProgressLine(is_quiet=options.quiet)
    shown: dict[str, Callable[[int, int, Any], None]] = {}

    def show(stage: str, done: int, n: int) -> None:
        shown.setdefault(stage, _row_progress(line, stage))(done, n, None)

    try:
        page = write_report(
            options.project, compare=options.compare, out=options.out, metrics=options.metrics, on_stage=show
        )
    finally:
        line.finish()
    line.say(f"Report: {page}")
    return EXIT_OK


_COMMANDS: dict[str, Callable[[argparse.Namespace, Launch], int]] = {
    "train": _train,
    "eval": _evaluate,
    "render": _render,
    "inspect": _inspect,
    "doctor": _doctor,
    "bench": _bench,
    "report": _report,
    "ablate": _ablate,
}
