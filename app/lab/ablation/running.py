"""Trains and measures the variants of an ablation, each in its own project folder; resumes where it stopped.

FOLDER/full-seed0/ and so on are ordinary projects, to be opened, reported or compared like any other. Variants that
only change source clips take over the reference clip of "full" instead of training the same again.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from app.cli.terminal.results import write_text
from app.document.project_settings import ProjectSettings
from app.document.storing.document_file import PROJECT_FILE
from app.evaluation.headless import ClipOutcome, train_clips
from app.evaluation.speed.frame_rates import DEFINITION as DEFINITION_OF_RATES
from app.evaluation.speed.frame_rates import FrameRates, RatesOf
from app.lab.ablation.curves import curves_of
from app.lab.ablation.measuring import VariantFigures, VariantScope, kept_figures, measure
from app.lab.ablation.table import DEFINITION, VariantResult, as_csv, summarize
from app.lab.ablation.variants import Variant, rank, settings_of, variant_called
from app.lab.paper_tables import beside_ablations
from app.project.opening.project_access import check_settings, create_project, open_project
from app.project.project import Project
from app.status import TrainingStatus
from app.training.service import ClipEvent, Launch, TrainingService
from engine.capture.capture import Capture
from engine.capture.clip import Clip
from engine.errors import ProjectError, TrainingError
from engine.storage.files import atomic_path
from engine.storage.json_files import json_text
from engine.training.preparation.kept_clouds import CLOUD_FILES
from engine.training.preparation.picture_store import check_room

if TYPE_CHECKING:
    from engine.metrics.pictures.colors import Precision
    from engine.metrics.pictures.picture import Choice

ABLATION_SCHEMA = 1
RESULT_FILE = "ablation.json"
TABLE_FILE = "ablation.csv"


@dataclass(frozen=True, slots=True)
class Callbacks:
    """Receivers of progress.

    Attributes:
        on_variant: Name, seed, how many are done, and how many there are.
        on_status, on_event, on_outcome: Of the training, see app.evaluation.headless.train_clips.
        on_row: Rows measured, rows in all, the newest row.
    """

    on_variant: Callable[[str, int, int, int], None]
    on_status: Callable[[TrainingStatus], None]
    on_event: Callable[[ClipEvent], None]
    on_outcome: Callable[[ClipOutcome], None]
    on_row: Callable[[int, int, Any], None]


def run_ablation(
    folder: Path,
    capture: Capture,
    settings: ProjectSettings,
    *,
    variants: Sequence[Variant],
    n_clips: int,
    seeds: Sequence[int],
    validation: Sequence[str] | None = None,
    metrics: Choice,
    precision: Precision = "float",
    launch: Launch,
    callbacks: Callbacks,
    rates_of: RatesOf = lambda opened: None,
) -> dict[str, Any]:
    """Train and measure missing variants; writes the table after every one.

    Results of earlier calls in the folder with the same settings, of other variants and seeds too, are in the table
    from the start. Its lines are in the order of VARIANTS, results of a variant in that of the seeds.

    Args:
        folder: Gets one project per variant and seed, ablation.json and ablation.csv.
        settings: Of "full"; its seed is replaced.
        n_clips: From the first.
        validation: Names of the cameras to measure, which are among those held out; None for all of these.
        metrics, precision: See engine.metrics.pictures.picture.measure_picture.
        rates_of: Measures how fast a variant is rendered; nothing does by default.
    Returns:
        JSON-able: schema, capture, holdout, clip_length, n_clips, metrics, precision, seeds, words (what each variant
        is), definition (of flicker and seam ratios), rendering (`rendering_of`; null where no frame rates were
        measured), lines (`summarize`), curves (`curves_of`), paper (`beside_ablations`) and results per seed.
    Raises:
        ProjectError, CaptureError: Bad input, or pictures of a variant for which there is no room.
        TrainingError: A clip failed; what was finished is kept.
        KeyboardInterrupt: Likewise.
    """
    document: dict[str, Any] = {}
    rendering: dict[str, Any] | None = None
    if settings.config().field == "joint":
        raise ProjectError("field=joint leaves no clips to compare.", hint="Take the variant field-joint.")
    clips = settings.clips(capture.n_frames)[:n_clips]
    todo = [_Task(capture, settings, variant, seed, clips) for seed in seeds for variant in variants]
    borders = [clip.start for clip in clips[1:]]
    all_clips = VariantScope(
        range(n_clips), borders, metrics, precision, None if validation is None else tuple(validation)
    )
    found = _finished(folder, capture, settings, clips, all_clips)
    first_of: dict[tuple[str, int], Path] = {}  # project that trains the reference clip of a family
    for task in todo:
        if (task.variant.name, task.settings.seed) not in found:
            task.check_room(folder)
        first_of.setdefault((task.variant.family, task.settings.seed), task.place(folder))
    for n_done, task in enumerate(todo):
        variant, seed = task.variant, task.settings.seed
        callbacks.on_variant(variant.name, seed, n_done, len(todo))
        measured = _measured(
            task.place(folder), task, first_of[variant.family, seed], all_clips, launch, callbacks, rates_of
        )
        found[variant.name, seed] = VariantResult(variant.name, seed, measured.figures, measured.n_frames)
        rendering = rendering if measured.rates is None else rendering_of(measured.rates)
        results = [found[key] for key in sorted(found, key=lambda key: (rank(key[0]), key[1]))]
        shown = list(dict.fromkeys(result.variant for result in results))
        document = {
            "schema": ABLATION_SCHEMA,
            "capture": str(capture.path),
            "holdout": list(settings.holdout),
            "measured_on": list(settings.holdout if validation is None else validation),
            "clip_length": settings.clip_length,
            "n_clips": n_clips,
            "metrics": metrics,
            "precision": precision,
            "seeds": sorted({*seeds, *(result.seed for result in results)}),
            "words": {name: item.words for name in shown if (item := variant_called(name)) is not None},
            "definition": DEFINITION,
            "rendering": rendering,
            "lines": (lines := summarize(results)),
            "curves": curves_of(lines),
            "paper": beside_ablations(lines),
            "results": [{"variant": r.variant, "seed": r.seed, "n_frames": r.n_frames, **r.figures} for r in results],
        }
        write_text(folder / RESULT_FILE, json_text(document, indent=1) + "\n")
        write_text(folder / TABLE_FILE, as_csv(document["lines"]))
    return document


def rendering_of(rates: FrameRates) -> dict[str, Any]:
    """The conditions of a table's frame rates, the same for all its lines: width, height, camera, back end, words."""
    drawn_by = [rate.drawn_by for rate in (rates.cpu, rates.gl) if rate is not None]
    missing = f" No OpenGL: {rates.why_no_gl}." if rates.why_no_gl else ""
    words = f"{DEFINITION_OF_RATES} Here {rates.size} px, by {' and '.join(drawn_by) or 'nothing'}.{missing}"
    found = {"width": rates.width, "height": rates.height, "camera": rates.camera}
    return found | {"drawn_by": drawn_by, "why_no_gl": rates.why_no_gl, "words": words}


def project_folder(folder: Path, name: str, seed: int) -> Path:
    """The folder of a variant."""
    return folder / f"{name}-seed{seed}"


def _finished(
    folder: Path, capture: Capture, base: ProjectSettings, clips: Sequence[Clip], scope: VariantScope
) -> dict[tuple[str, int], VariantResult]:
    """Measured results in the folder that fit the settings, by variant and seed."""
    found = {}
    for place in sorted(folder.glob("*-seed*")):
        name, _, text = place.name.rpartition("-seed")
        variant = variant_called(name)
        if variant is None or not text.isdecimal():
            continue
        try:
            task = _Task(capture, replace(base, seed=int(text)), variant, int(text), clips)
        except ProjectError:  # the settings of this call have no such variant
            continue
        kept = kept_figures(place, task.settings, replace(scope, clips=task.chosen))
        if kept is not None:
            found[name, int(text)] = VariantResult(name, int(text), kept.figures, kept.n_frames)
    return found


class _Task:
    """One variant with one seed, its settings checked: nothing is trained before all of them are right."""

    def __init__(
        self, capture: Capture, base: ProjectSettings, variant: Variant, seed: int, clips: Sequence[Clip]
    ) -> None:
        n_cameras = len(capture.rig) - len(base.holdout)
        overrides, clip_length, chosen = settings_of(
            variant, base.overrides, clips=clips, n_cameras=n_cameras, n_capture_frames=capture.n_frames
        )
        reference_clip = base.reference_clip if variant.cut == "clips" else 0
        if variant.is_reference_moved:
            reference_clip = len(clips) // 2
        self.variant, self.chosen, self.capture = variant, chosen, capture
        self.settings = replace(
            base, seed=seed, overrides=overrides, clip_length=clip_length, reference_clip=reference_clip
        )
        check_settings(self.settings, capture)

    def check_room(self, folder: Path) -> None:
        """Check that there is room for the pictures of its longest clip.

        Raises:
            ProjectError, DiskError: There is not.
        """
        width, height = self.capture.picture_size
        n_frames = max(clip.n_frames for clip in self.settings.clips(self.capture.n_frames))
        n_cameras = len(self.capture.rig) - len(self.settings.holdout)
        try:
            check_room((n_cameras, n_frames, height, width), self.place(folder))
        except ProjectError as error:
            hint = f"Leave {self.variant.name} out. {error.hint}"
            raise type(error)(f"{self.variant.name}: {error.message}", hint=hint, path=error.path) from error

    def place(self, folder: Path) -> Path:
        """The folder of its project."""
        return project_folder(folder, self.variant.name, self.settings.seed)


def _measured(
    place: Path, task: _Task, first: Path, scope: VariantScope, launch: Launch, callbacks: Callbacks, rates_of: RatesOf
) -> VariantFigures:
    """Train missing clips and measure. first: the project whose reference clip this one takes over."""
    variant, settings, capture, seed = task.variant, task.settings, task.capture, task.settings.seed
    project = _open(place, settings)
    try:
        if place != first:
            _take_reference(project, first)
        _take_clouds(project)
        service = TrainingService(
            project,
            project.clips(capture.n_frames),
            holdout=capture.camera_indices(settings.holdout),
            launch=launch,
            is_window_open=False,
        )
        try:
            outcomes = train_clips(
                service,
                project.training_order(len(task.chosen)),
                on_status=callbacks.on_status,
                on_event=callbacks.on_event,
                on_outcome=callbacks.on_outcome,
            )
        finally:
            service.close()
        failed = next((outcome for outcome in outcomes if outcome.state == "failed"), None)
        if failed is not None:
            raise TrainingError(f"{variant.name}, seed {seed}: {failed.message}", hint=failed.hint)
    finally:
        project.close()
    return measure(place, replace(scope, clips=task.chosen), callbacks.on_row, rates_of)


def _open(place: Path, settings: ProjectSettings) -> Project:
    if not (place / PROJECT_FILE).is_file():
        return create_project(place, settings)
    project = open_project(place)
    if project.settings != settings:
        project.close()
        raise ProjectError(
            "The folder holds this variant with other settings.",
            hint="Choose another folder by --project, or by --out of bench.",
            path=place,
        )
    return project


def _take_clouds(project: Project) -> None:
    """Copy clouds of frames that other variants and seeds have made; their names identify them."""
    project.prep_dir.mkdir(parents=True, exist_ok=True)
    for path in sorted(project.folder.parent.glob(f"*/{project.prep_dir.name}/{CLOUD_FILES}")):
        if (project.prep_dir / path.name).exists():
            continue
        try:
            (project.prep_dir / path.name).hardlink_to(path)  # such files are never changed in place
        except OSError:  # of a disk without links
            with atomic_path(project.prep_dir / path.name) as partial:
                shutil.copyfile(path, partial)


def _take_reference(project: Project, first: Path) -> None:
    """Copy the reference clip, and files that clips share, of a finished project."""
    source = open_project(first, is_writable=False)
    if project.is_trained(project.settings.reference_clip) or not source.reference_path.is_file():
        return
    project.prep_dir.mkdir(parents=True, exist_ok=True)
    for path in source.prep_dir.glob("*"):
        with atomic_path(project.prep_dir / path.name) as partial:
            shutil.copyfile(path, partial)
    project.reference_path.parent.mkdir(parents=True, exist_ok=True)
    with atomic_path(project.reference_path) as partial:
        shutil.copyfile(source.reference_path, partial)
