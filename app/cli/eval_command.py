"""clipgstream eval: figures of trained clips as JSON, and the means as text."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

from app.cli.arguments import EXIT_OK, add_figure_choices, add_measuring_places, parse_range, path_argument
from app.cli.terminal.progress import ProgressLine, row_progress
from app.cli.terminal.results import write_text
from app.document.changes.object_changes import object_named
from app.evaluation.cluster_measuring import measuring_at
from app.evaluation.evaluation import evaluate_project
from app.evaluation.headless import open_trained
from app.evaluation.speed.frame_rates import DEFINITION, frame_rates
from app.export.staging import check_target
from app.objects.object_figures import object_figures
from app.project.opening.project_access import open_project
from app.training.service import Launch
from engine.storage.json_files import json_text


def add_arguments(command: argparse.ArgumentParser) -> None:
    """Arguments of `clipgstream eval`."""
    command.add_argument("project", type=path_argument, help="project folder")
    command.add_argument("--json", required=True, metavar="OUT", help="file for all rows and means; - prints them")
    command.add_argument("--clips", default=":", metavar="A:B", help="clips to measure (default: all trained)")
    add_figure_choices(command, default="all", said="all")
    add_measuring_places(command)
    command.add_argument(
        "--fps",
        action="store_true",
        help="also measure how many pictures are rendered per second, which takes some seconds",
    )
    command.add_argument("--object", metavar="NAME", help="also measure PSNR over the pixels of an object alone")
    command.add_argument("--quiet", action="store_true", help="show no progress")


def run(options: argparse.Namespace, launch: Launch) -> int:
    """clipgstream eval: measure trained clips, into a JSON document. Returns the exit code."""
    if options.json != "-":
        check_target(Path(options.json))
    opened = open_trained(open_project(options.project, is_writable=False))
    one = None if options.object is None else object_named(opened.project.document, options.object)
    chosen = list(parse_range(options.clips, len(opened.clips), option="--clips", what="clips"))
    if options.clips.strip() == ":":
        chosen = opened.trained
    line = ProgressLine(is_quiet=options.quiet)
    progress = row_progress(line, "Measuring")
    with measuring_at(options.n_workers, options.cluster, line.say) as measuring:
        document = evaluate_project(
            opened,
            clip_indices=chosen,
            metrics=options.metrics,
            precision=options.precision,
            on_progress=progress,
            say=line.say,
            measuring=measuring,
        )
    if one is not None:
        document["object"] = object_figures(opened, one, chosen, _object_progress(line, one.name))
    line.finish()
    rates = frame_rates(opened) if options.fps else None
    if rates is not None:
        document["frame_rates"] = {**asdict(rates), "definition": DEFINITION}
    text = json_text(document, indent=1)
    if options.json == "-":
        print(text)
        return EXIT_OK
    write_text(Path(options.json), text + "\n")
    _show_evaluation(line, document)
    if one is not None:
        _show_object(line, document["object"])
    if rates is not None:
        line.say(f"{rates.words()}.")
    line.say(f"{len(document['rows'])} rows in {options.json}")
    return EXIT_OK


def _show_evaluation(line: ProgressLine, document: dict[str, Any]) -> None:
    for clip, summary in document["means"]["clips"].items():
        for group, words in (("held_out", "held out"), ("trained_on", "trained on")):
            found = summary[group]
            if found:
                of = _pictures_text(document["rows"], int(clip), is_held_out=group == "held_out")
                line.say(
                    f"Clip {clip}, {words} ({of}): PSNR {_figure(found['psnr'], 2)} dB, cc_psnr "
                    f"{_figure(found['cc_psnr'], 2)} dB, after colour fit {_figure(found['psnr_fit'], 2)} dB, "
                    f"SSIM {_figure(found['ssim'], 4)}"
                )
    for seam in document["seams"]["boundaries"]:
        line.say(
            f"Seam at frame {seam['frame_index']}: score {_figure(seam['score'], 2)}/255, change at the boundary "
            f"{_figure(seam['ratio_static'], 2)} times that inside the clips on static pixels, "
            f"{_figure(seam['ratio_moving'], 2)} times on moving ones (truth: {_figure(seam['truth_ratio_moving'], 2)})"
        )


def _object_progress(line: ProgressLine, name: str) -> Callable[[int, int], None]:
    return lambda n_done, n_all: line.update(f"Measuring {name}", n_done / max(n_all, 1), f"{n_done}/{n_all}")


def _show_object(line: ProgressLine, found: dict[str, Any]) -> None:
    for clip, groups in found["clips"].items():
        held_out, trained_on = (_figure(groups[group]["psnr"], 2) for group in ("held_out", "trained_on"))
        line.say(f"Clip {clip}, {found['object']} alone: PSNR {held_out} dB held out, {trained_on} dB trained on")


def _pictures_text(rows: list[dict[str, Any]], clip_index: int, *, is_held_out: bool) -> str:
    """Which pictures a mean is over."""
    found = [row for row in rows if (row["clip_index"], row["is_held_out"]) == (clip_index, is_held_out)]
    frames, cameras = ({row[name] for row in found} for name in ("frame_index", "camera"))
    return f"{len(frames)} frames, {len(cameras)} {'camera' if len(cameras) == 1 else 'cameras'}"


def _figure(value: float | None, n_digits: int) -> str:
    return "-" if value is None else f"{value:.{n_digits}f}"
