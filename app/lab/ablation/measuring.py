"""Figures of one trained variant, kept next to it: the same settings are measured once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from app.cli.terminal.results import named_failure
from app.document.project_settings import ProjectSettings
from app.evaluation.evaluation import evaluate_project
from app.evaluation.headless import open_trained
from app.evaluation.source_clip_means import later_figures
from app.evaluation.speed.frame_rates import FrameRates, RatesOf, kept_rates
from app.lab.added.figures import with_added_figures
from app.lab.added.lpips import why_missing
from app.lab.flicker import flicker_figures
from app.lab.pictures import RenderedPictures
from app.project.opening.project_access import open_project
from app.project.project import Project
from app.project.project_facts import read_facts
from engine.clip_files.clip_state import read_clip_header
from engine.errors import CaptureError, ProjectError
from engine.storage.json_files import JsonError, read_checked_json, write_checked_json

if TYPE_CHECKING:
    from engine.metrics.pictures.colors import Precision
    from engine.metrics.pictures.picture import Choice

MEASURED_SCHEMA = 6
MEASURED_FILE = "measured.json"


@dataclass(frozen=True, slots=True)
class VariantFigures:
    """Figures of a trained variant, None where one does not exist; on how many frames of each camera; and its frame
    rates, None where not measured."""

    figures: dict[str, float | None]
    n_frames: int
    rates: FrameRates | None = None

    def with_rates(self, rates: FrameRates | None) -> VariantFigures:
        """The same with its frame rates, which no file of figures holds: times differ from run to run."""
        return self if rates is None else replace(self, figures=self.figures | rates.figures(), rates=rates)


@dataclass(frozen=True, slots=True)
class VariantScope:
    """The clips, borders and figures to measure of a variant.

    Attributes:
        clips: Indices of its clips.
        borders: Frames at which a clip of "full" starts.
        metrics, precision: See app.evaluation.evaluation.evaluate_project.
        cameras: Names of those to measure; None for all that are held out.
    """

    clips: Sequence[int]
    borders: Sequence[int]
    metrics: Choice
    precision: Precision
    cameras: tuple[str, ...] | None = None


def measure(
    place: Path, scope: VariantScope, on_row: Callable[[int, int, Any], None], rates_of: RatesOf
) -> VariantFigures:
    """Figures of a trained variant, from its file when that is of these clips and this scope.

    Args:
        place: The variant's project.
        on_row: Gets rows measured, rows in all and the newest row.
        rates_of: Measures how fast it is rendered.
    Raises:
        ProjectError, CaptureError: It cannot be measured, or the figures cannot be written.
    """
    project = open_project(place, is_writable=False)
    key = _key(project, scope)
    kept = _read(place / MEASURED_FILE, key)
    opened = open_trained(project)
    if kept is not None:
        return kept.with_rates(rates_of(opened))
    holdout = opened.capture.camera_indices(project.settings.holdout if scope.cameras is None else scope.cameras)
    document = evaluate_project(
        opened,
        clip_indices=scope.clips,
        metrics=scope.metrics,
        precision=scope.precision,
        cameras=holdout or None,
        on_progress=on_row,
    )
    if scope.metrics == "all":
        document = with_added_figures(document, opened, RenderedPictures(opened))
    group = "held_out" if document["means"]["held_out"] else "trained_on"
    means = document["means"][group]
    figures: dict[str, float | None] = {name: value for name, value in means.items() if not isinstance(value, dict)}
    figures |= flicker_figures(document["seams"]["rows"], scope.borders)
    clips = [clip for clip in read_facts(place, place.name).clips if clip.clip_index in scope.clips]
    known = [clip.wall_s for clip in clips if clip.wall_s is not None]
    figures["minutes"] = sum(known) / 60 if len(known) == len(clips) else None
    source_s = {clip.clip_index: clip.wall_s for clip in clips if clip.role == "source"}
    figures |= later_figures(document["means"]["clips"], group, source_s)
    figures["megabytes"] = sum(project.clip_path(i).stat().st_size for i in scope.clips) / 1e6
    measured = _measured(figures, sum(opened.clips[i].n_frames for i in scope.clips))
    with named_failure(place / MEASURED_FILE):
        content = {"key": key, "figures": measured.figures, "n_frames": measured.n_frames}
        write_checked_json(place / MEASURED_FILE, content)
    return measured.with_rates(rates_of(opened))


def kept_figures(place: Path, settings: ProjectSettings, scope: VariantScope) -> VariantFigures | None:
    """Figures that an earlier call has measured with these settings; None where there are none."""
    try:
        project = open_project(place, is_writable=False)
    except ProjectError:  # damaged, or another file of that name
        return None
    if project.settings != settings:
        return None
    kept = _read(place / MEASURED_FILE, _key(project, scope))
    if kept is None:
        return None
    try:
        return kept.with_rates(kept_rates(open_trained(project)))
    except (CaptureError, ProjectError):  # of the capture, or a clip; the figures are there all the same
        return kept


def _key(project: Project, scope: VariantScope) -> dict[str, Any]:
    """Everything that the figures depend on."""
    has_lpips = scope.metrics == "all" and why_missing() is None
    headers = [read_clip_header(project.clip_path(i)) for i in scope.clips]
    return {
        "clips": [None if header is None else header.fingerprint for header in headers],
        "borders": list(scope.borders),
        "metrics": scope.metrics,
        "precision": scope.precision,
        **({} if scope.cameras is None else {"cameras": list(scope.cameras)}),
        "schema": MEASURED_SCHEMA,
        **({"lpips": True} if has_lpips else {}),
    }


def _read(path: Path, key: dict[str, Any]) -> VariantFigures | None:
    try:
        content = read_checked_json(path)
    except (OSError, JsonError):
        return None
    if content.get("key") != key:
        return None
    figures, n_frames = content.get("figures"), content.get("n_frames")
    return _measured(figures, n_frames) if isinstance(figures, dict) and isinstance(n_frames, int) else None


def _measured(figures: dict[str, float | None], n_frames: int) -> VariantFigures:
    """Figures of a variant with those derived from them."""
    size = figures.get("megabytes")
    return VariantFigures(figures | {"mb_per_frame": None if size is None else size / n_frames}, n_frames)
