"""The work of `clipgstream report`: measure missing figures, draw, and write the page with its files."""

from __future__ import annotations

import logging
import re
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import asdict, replace
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from app.evaluation.evaluation import Measuring
from app.evaluation.headless import TrainedProject, open_trained
from app.evaluation.speed.frame_rates import RatesOf
from app.lab.added.figures import with_added_figures
from app.lab.bench.rows import Trade
from app.lab.flicker import flicker_figures
from app.lab.pictures import Pictures, RenderedPictures
from app.lab.report.about import capture_section, settings_section, setup_section, split_section
from app.lab.report.beside_published import published_section
from app.lab.report.comparison import Compared, comparison_section, speed_section
from app.lab.report.costs import export_parts, storage_section, times_section, training_parts
from app.lab.report.length import length_section
from app.lab.report.measured import clips_section, time_section, worst_pictures, worst_section
from app.lab.report.measuring import evaluation_of
from app.lab.report.over_clips import exposures_of, over_clips_section
from app.lab.report.page.page import page_html
from app.lab.report.page.parts import Part, Section
from app.lab.report.paper_figures.by_hand import FigureOptions, Places, checked_places
from app.lab.report.paper_figures.sections import STEPS, paper_sections
from app.lab.report.rendering import rendering_section
from app.lab.report.seam_parts import seams_section, shown_boundaries
from app.project.project_facts import ProjectFacts, find_projects, read_facts, short_names
from engine.capture.capture_summary import describe
from engine.errors import CaptureError, ProjectError
from engine.storage.files import atomic_path
from engine.storage.json_files import JsonError, json_text, read_json_object

if TYPE_CHECKING:
    from engine.metrics.pictures.colors import Precision
    from engine.metrics.pictures.picture import Choice

logger = logging.getLogger(__name__)

REPORT_SCHEMA = 1
REPORTS = "reports"
"""Folder of a project for its reports."""
PAGE_FILE, NUMBERS_FILE = "report.html", "report.json"
FIGURES, TABLES = "figures", "tables"
_OWN_FILE = re.compile(rf"(?:{FIGURES}|{TABLES})/[\w-]+\.(?:png|csv)")
OnStage = Callable[[str, int, int], None]
"""Receives the present stage, and how many of how many pieces of it are finished."""


def write_report(
    folder: Path,
    *,
    compare: Sequence[Path] = (),
    out: Path | None = None,
    metrics: Choice | None = None,
    precision: Precision = "float",
    wishes: FigureOptions | None = None,
    beginning: Sequence[Section] = (),
    on_stage: OnStage,
    say: Callable[[str], None] = logger.warning,
    measuring: Measuring | None = None,
    make_pictures: Callable[[TrainedProject], Pictures] = RenderedPictures,
    rates_of: RatesOf = lambda opened: None,
    exports_of: Callable[[TrainedProject], Sequence[Trade]] = lambda opened: (),
) -> Path:
    """Write the report of a project.

    Files: report.html with everything in it, report.json with all numbers, figures/*.png, tables/*.csv. They are
    written when all of them are made; files of an earlier report that this one has not are removed.

    Args:
        folder: The project.
        compare: Other projects, or folders of projects, to compare with it.
        out: Folder of the report; PROJECT/reports when None.
        metrics: Columns of all projects; None measures all of the project and the quick ones of the others, or shows
            all where they were measured before.
        precision: Of all projects: pictures as rendered, or rounded to 8 bit.
        wishes: Places that figures are to show; chosen by their rules when None.
        beginning: Sections before all others.
        on_stage: Receives the present stage.
        say: Receives sentences for the user, see app.evaluation.evaluation.evaluate_project.
        measuring, make_pictures: Tests bring quick ones.
        rates_of: Measures how fast a project is rendered; left out by default.
        exports_of: Measures the formats of exports of the page's own project; likewise.
    Returns:
        The page.
    Raises:
        ProjectError, CaptureError: A folder is not a project, nothing is trained in it, its capture is gone, there
            is no such place as wished for, or the report cannot be written.
    """
    out = folder / REPORTS if out is None else out
    facts = read_facts(folder, short_names([folder])[0])
    others, left_out = _others(folder, compare)
    names = short_names([folder, *(one.project.folder for one, _ in others)])
    opened = open_trained(facts.project)
    places = checked_places(wishes or FigureOptions(), opened.capture, [facts, *(one for one, _ in others)])
    own: list[Choice] = ["all", "quick"] if metrics == "quick" else ["all"]
    rest: list[Choice] = ["all"] if metrics == "all" else ["all", "quick"]
    compared: list[Compared] = []
    for (one, is_named), name, choices in zip(
        [(facts, True), *others], names, [own, *(rest for _ in others)], strict=True
    ):
        try:
            trained = open_trained(one.project) if compared else opened
            document = evaluation_of(
                trained,
                choices=choices,
                precision=precision,
                is_held_out_enough=bool(compared),
                on_progress=_measuring(on_stage, name),
                say=say,
                measuring=measuring,
            )
            document = with_added_figures(
                document, trained, make_pictures(trained), on_progress=partial(on_stage, f"tOF of {name}")
            )
            rates = rates_of(trained)
        except (ProjectError, CaptureError) as error:
            if is_named:
                raise
            left_out.append(f"{name} is left out: {error.message}")
            continue
        compared.append(Compared(replace(one, name=name), document, rates))
    parts = [*training_parts(facts), *export_parts(exports_of(opened))]
    sections = _sections(compared, opened, make_pictures, places, left_out, on_stage, parts)
    return _write(out, compared, [*beginning, *sections])


def _others(folder: Path, compare: Sequence[Path]) -> tuple[list[tuple[ProjectFacts, bool]], list[str]]:
    """Projects to compare with, each with whether it was named itself, and sentences on those that are left out."""
    found, left_out = [], []
    for path, is_named in find_projects(compare, besides=folder):
        try:
            facts = read_facts(path, path.name)
        except ProjectError as error:
            if is_named:
                raise
            left_out.append(f"{path.name} is left out: {error.message}")
        else:
            found.append((facts, is_named))
    return found, left_out


def _measuring(on_stage: OnStage, name: str) -> Callable[[int, int, Any], None]:
    return lambda done, n, _row: on_stage(f"Measuring {name}", done, n)


def _sections(
    compared: Sequence[Compared],
    opened: TrainedProject,
    make_pictures: Callable[[TrainedProject], Pictures],
    places: Places,
    left_out: Sequence[str],
    on_stage: OnStage,
    speed_parts: Sequence[Part],
) -> list[Section]:
    facts, evaluation = compared[0].facts, compared[0].evaluation
    n_pictures = len(worst_pictures(evaluation)) + len(shown_boundaries(evaluation["seams"])) + STEPS
    n_drawn = 0

    def tick() -> None:
        nonlocal n_drawn
        n_drawn += 1
        on_stage("Drawing", n_drawn, n_pictures)

    from app.lab.machine import describe_machine

    capture, pictures = describe(opened.capture), make_pictures(opened)
    speed, rendering = speed_section(compared), rendering_section(compared)
    speed = replace(speed, parts=[*speed.parts, *speed_parts])
    published = published_section(compared, capture)
    has_others = len(compared) > 1 or bool(left_out)
    return [
        *([comparison_section(compared, left_out), speed] if has_others else []),
        *paper_sections(compared, pictures, opened, make_pictures, places, tick),
        setup_section(facts, describe_machine(0), datetime.now(), evaluation),
        capture_section(facts, capture),
        split_section(facts, capture, len(opened.clips)),
        settings_section(facts),
        clips_section(evaluation),
        *([] if published is None else [published]),
        length_section(evaluation, facts.clips),
        over_clips_section(evaluation, exposures_of(opened, evaluation["clips"])),
        time_section(evaluation),
        worst_section(evaluation, pictures, tick),
        seams_section(evaluation, pictures, tick),
        storage_section(facts),
        times_section(facts),
        *([] if rendering is None else [rendering]),
        *([] if has_others else [speed]),
    ]


# ---------------------------------------------------------------- files


def report_document(compared: Sequence[Compared], sections: Sequence[Section]) -> dict[str, Any]:
    """Contents of report.json: schema, projects (name, folder, settings, clips, means, columns, seams and flicker of
    their evaluations, and frame_rates), tables by name as on the page and in the CSV files, and files (of figures and
    tables)."""
    tables = {table.name: table for section in sections for table in section.tables()}
    figures = [figure.name for section in sections for figure in section.figures()]
    return {
        "schema": REPORT_SCHEMA,
        "projects": [_project_document(one) for one in compared],
        "tables": {name: table.document() for name, table in tables.items()},
        "files": [*(f"{FIGURES}/{name}.png" for name in figures), *(f"{TABLES}/{name}.csv" for name in tables)],
    }


def _project_document(one: Compared) -> dict[str, Any]:
    facts, evaluation = one.facts, one.evaluation
    return {
        "name": facts.name,
        "folder": str(facts.project.folder),
        "capture_fingerprint": facts.settings.fingerprint,
        "settings": facts.settings.config().difference(),
        "holdout": list(facts.settings.holdout),
        "wall_s": facts.wall_s,
        "n_bytes": facts.n_bytes,
        "clips": [
            {
                "clip_index": clip.clip_index,
                "role": clip.role,
                "start": clip.start,
                "n_frames": clip.n_frames,
                "n_steps": clip.n_steps,
                "storage_bytes": clip.storage,
                "stages_s": clip.stages_s,
                "preparation_s": clip.preparation_s,
                "training_s": clip.training_s,
                "wall_s": clip.wall_s,
                "memory_mb": clip.memory_mb,
            }
            for clip in facts.clips
        ],
        "metrics": evaluation["metrics"],
        "precision": evaluation["precision"],
        "columns": evaluation["columns"],
        "means": evaluation["means"],
        "seams": {key: value for key, value in evaluation["seams"].items() if key != "rows"},
        "flicker": flicker_figures(evaluation["seams"]["rows"]),
        "frame_rates": None if one.rates is None else asdict(one.rates),
    }


def _write(out: Path, compared: Sequence[Compared], sections: Sequence[Section]) -> Path:
    document = report_document(compared, sections)
    facts = compared[0].facts
    lead = f"{len(facts.clips)} trained clips of {Path(facts.settings.capture).name}"
    lead += f", compared with {len(compared) - 1} other projects." if len(compared) > 1 else "."
    files = {f"{FIGURES}/{figure.name}.png": figure.png for section in sections for figure in section.figures()}
    for section in sections:
        for table in section.tables():
            files[f"{TABLES}/{table.name}.csv"] = table.csv_text().encode("utf-8", "replace")
    numbers = json_text(document, indent=1)
    files[NUMBERS_FILE] = numbers.encode()
    files[PAGE_FILE] = page_html(f"Report: {facts.name}", lead, sections).encode("utf-8", "replace")
    is_new_folder = not out.exists()
    old = _files_of_last_report(out)
    written: list[Path] = []
    try:
        for name, content in files.items():
            is_new = not (out / name).exists()
            with atomic_path(out / name) as partial:
                partial.write_bytes(content)
            if is_new:
                written.append(out / name)
    except OSError as error:
        _take_back(out, written, is_new_folder=is_new_folder)
        raise ProjectError(
            f"The report could not be written ({error.strerror}).", hint="Choose another place by --out.", path=out
        ) from error
    for name in old - files.keys():
        with suppress(OSError):
            (out / name).unlink()
    return out / PAGE_FILE


def _files_of_last_report(out: Path) -> set[str]:
    try:
        listed = read_json_object(out / NUMBERS_FILE)["files"]
        return {name for name in listed if isinstance(name, str) and _OWN_FILE.fullmatch(name)}
    except (OSError, JsonError, KeyError, TypeError):
        return set()


def _take_back(out: Path, written: Sequence[Path], *, is_new_folder: bool) -> None:
    """Half a report is none."""
    for path in written:
        with suppress(OSError):
            path.unlink()
    for folder in (out / FIGURES, out / TABLES, *([out] if is_new_folder else [])):
        with suppress(OSError):  # not empty: other files
            folder.rmdir()
