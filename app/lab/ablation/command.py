"""clipgstream ablate: arguments to variants, settings and seeds; progress, and the table."""

from __future__ import annotations

import argparse
from dataclasses import replace

from app.cli.arguments import (
    EXIT_OK,
    add_figure_choices,
    add_follow_links,
    parse_cameras,
    path_argument,
)
from app.cli.frame_rate_arguments import add_no_fps, wanted_rates
from app.cli.terminal.progress import ProgressLine, row_progress, stage_progress
from app.cli.terminal.training_lines import show_outcome, show_status
from app.cli.training_settings import add_training_settings, overrides_of
from app.export.staging import check_target
from app.project.opening.project_access import check_settings, default_settings
from app.training.service import Launch
from engine.capture.capture import open_capture
from engine.errors import ProjectError
from engine.storage.json_files import json_text


def add_arguments(command: argparse.ArgumentParser) -> None:
    """Arguments of `clipgstream ablate`."""
    command.add_argument("capture", type=path_argument, nargs="?", help="capture folder")
    command.add_argument("--project", type=path_argument, help="folder for one project per variant and the table")
    command.add_argument("--variants", metavar="NAMES", help="separated by commas (default: all; --list names them)")
    command.add_argument(
        "--row",
        action="append",
        default=[],
        metavar="'NAME: KEY=VALUE ...'",
        help="also train with these settings; may be repeated",
    )
    command.add_argument(
        "--validate",
        metavar="CAMERAS",
        help="train without these cameras, too, and measure on them instead of the held-out ones, to choose settings",
    )
    command.add_argument("--list", action="store_true", help="list the variants and exit")
    command.add_argument("--n-clips", type=int, metavar="N", help="clips from the first (default: up to 4)")
    command.add_argument(
        "--source-steps",
        metavar="N,M,...",
        help="train source clips with each of these numbers of steps: quality over time",
    )
    command.add_argument("--seeds", default="0", help="separated by commas (default: 0)")
    command.add_argument(
        "--reference-clip", type=int, default=0, metavar="K", help="clip that others inherit from (default: 0)"
    )
    add_figure_choices(command, default="quick", said="quick")
    add_follow_links(command)
    add_training_settings(command)
    add_no_fps(command)
    command.add_argument(
        "--report",
        action="store_true",
        help="write a page with the figures of the paper: all variants of the first seed side by side",
    )
    command.add_argument("--json", action="store_true", help="print the table as JSON on standard output")
    command.add_argument("--quiet", action="store_true", help="no progress")


def run(options: argparse.Namespace, launch: Launch) -> int:
    """clipgstream ablate: train variants and compare them; prints the table. Returns the exit code."""
    from app.lab.ablation.curves import curve_lines
    from app.lab.ablation.report import REPORT, write_ablation_report
    from app.lab.ablation.running import RESULT_FILE, TABLE_FILE, Callbacks, run_ablation
    from app.lab.ablation.table import as_text, paper_text
    from app.lab.ablation.variants import VARIANTS, chosen_variants, own_row, with_source_steps
    from app.lab.report.write import PAGE_FILE

    if options.list:
        width = max(len(variant.name) for variant in VARIANTS)
        for variant in VARIANTS:
            kind = "baseline: " if variant.is_baseline else ""
            end = " (only when named)" if variant.is_on_request else ""
            print(f"{variant.name:<{width}}  {kind}{variant.words}{end}")
        return EXIT_OK
    if options.capture is None or options.project is None:
        raise ProjectError("A capture folder and --project are needed.", hint="Only --list does without.")
    names = (
        None if options.variants is None else [name for part in options.variants.split(",") if (name := part.strip())]
    )
    if names == []:
        raise ProjectError(
            f"--variants is '{options.variants}', which names none.", hint="Leave it out for all of them."
        )
    variants = chosen_variants(names) + [own_row(text) for text in options.row]
    if len({variant.name for variant in variants}) < len(variants):
        raise ProjectError("Two rows have the same name.", hint="Give every --row a name of its own.")
    seeds = _whole_numbers("--seeds", options.seeds)
    if options.source_steps is not None:
        lengths = sorted(_whole_numbers("--source-steps", options.source_steps))
        if lengths[0] < 1:
            raise ProjectError(f"--source-steps is '{options.source_steps}'; a clip needs at least one step.")
        variants = [with_source_steps(variant, n_steps) for variant in variants for n_steps in lengths]
    scale = options.scale if options.scale is not None else 1.0
    capture = open_capture(options.capture, scale=scale, follow_links=options.follow_links)
    settings = default_settings(
        capture,
        clip_length=options.clip_length,
        holdout=None if options.holdout is None else parse_cameras(options.holdout, capture),
        seed=seeds[0],
        overrides=overrides_of(options),
        reference_clip=options.reference_clip,
    )
    validation = None
    if options.validate is not None:
        validation = parse_cameras(options.validate, capture)
        settings = replace(settings, holdout=tuple(dict.fromkeys((*settings.holdout, *validation))))
        check_settings(settings, capture)
    for seed in seeds[1:]:
        check_settings(replace(settings, seed=seed), capture)
    most = len(settings.clips(capture.n_frames))
    n_clips = min(most, 4) if options.n_clips is None else options.n_clips
    if not 1 <= n_clips <= most:
        raise ProjectError(f"--n-clips is {n_clips}; the capture has {most} clips of {settings.clip_length} frames.")
    if settings.reference_clip >= n_clips:
        raise ProjectError(
            f"--reference-clip is {settings.reference_clip}, which is none of the {n_clips} clips of the ablation.",
            hint=f"Choose one from 0 to {n_clips - 1}, or raise --n-clips.",
        )
    check_target(options.project / RESULT_FILE)
    if options.report:
        check_target(options.project / REPORT / PAGE_FILE)
    line = ProgressLine(is_quiet=options.quiet)

    def show_variant(name: str, seed: int, n_done: int, n: int) -> None:
        line.say(f"{name}, seed {seed} ({n_done + 1} of {n})")

    callbacks = Callbacks(
        on_variant=show_variant,
        on_status=lambda status: show_status(line, status),
        on_event=lambda event: None,
        on_outcome=lambda outcome: show_outcome(line, outcome),
        on_row=row_progress(line, "Measuring"),
    )
    page = None
    try:
        document = run_ablation(
            options.project,
            capture,
            settings,
            variants=variants,
            n_clips=n_clips,
            seeds=seeds,
            validation=validation,
            metrics=options.metrics,
            precision=options.precision,
            launch=launch,
            callbacks=callbacks,
            rates_of=wanted_rates(options),
        )
        if options.report:
            page = write_ablation_report(
                options.project,
                document,
                seed=seeds[0],
                metrics=options.metrics,
                precision=options.precision,
                on_stage=stage_progress(line),
                say=line.say,
                rates_of=wanted_rates(options),
            )
    finally:
        line.finish()
    if options.json:
        print(json_text(document, indent=1))
    else:
        compared = "".join(f"\n{sentence}" for sentence in curve_lines(document["curves"]))
        print(f"{as_text(document['lines'])}\n{compared}\n{document['definition']}")
        if document["paper"]:
            print(f"\n{paper_text(document['paper'])}\n")
        if document["rendering"] is not None:
            print(document["rendering"]["words"])
    line.say(f"All figures: {options.project / RESULT_FILE} and {TABLE_FILE}")
    if page is not None:
        line.say(f"Report: {page}")
    return EXIT_OK


def _whole_numbers(option: str, text: str) -> list[int]:
    """An option's numbers, each of which counts once."""
    try:
        numbers = [int(number) for number in text.split(",")]
    except ValueError as error:
        raise ProjectError(f"{option} is '{text}'; write whole numbers separated by commas.") from error
    if len(set(numbers)) < len(numbers):
        raise ProjectError(f"{option} is '{text}'; a number counts only once.")
    return numbers
