"""Sections that compare projects: one line each, and speed against error."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from app.evaluation.source_clip_means import LATER_MOVING, LATER_PSNR, LATER_S, later_figures
from app.evaluation.speed.frame_rates import FIGURES as FIGURES_OF_RATES
from app.evaluation.speed.frame_rates import FrameRates
from app.lab.flicker import FIGURES, definition_of, flicker_figures
from app.lab.report.about import all_settings
from app.lab.report.charts import SpeedPanel, draw_speed_error
from app.lab.report.page.parts import Figure, Section
from app.lab.report.page.tables import Table, TableColumn
from app.lab.report.pareto import pareto_front
from app.project.project_facts import ProjectFacts

_PAPER = (
    ("psnr", "PSNR", "dB", 2),
    ("ssim", "SSIM", "", 4),
    ("dssim1", "DSSIM1", "", 4),
    ("dssim_range2", "DSSIM2, range 2", "", 4),
    ("dssim_ms", "DSSIM2, multi-scale", "", 4),
    ("lpips", "LPIPS", "", 4),
)
"""Figures of pictures that the paper has, too; it does not say which of two its DSSIM2 is."""
_OTHERS = (
    ("cc_psnr", "cc PSNR", "dB", 2),
    ("psnr_moving", "PSNR, moving", "dB", 2),
    ("flip", "FLIP", "", 4),
)
_SEAMS = (
    ("flicker_inside", "Flicker inside clips", "1/255", 3),
    ("flicker_borders", "Flicker at borders", "1/255", 3),
    ("seam_ratio_static", "Seam ratio, static", "", 2),
    ("seam_ratio_moving", "Seam ratio, moving", "", 2),
    ("score", "Seam score", "1/255", 3),
    ("tof", "tOF", "px", 3),
    ("tof_borders", "tOF at borders", "px", 3),
    ("tof_inside", "tOF inside clips", "px", 3),
)


@dataclass(frozen=True, slots=True)
class Compared:
    """One project of a comparison: its files, its evaluation document, and how fast it is rendered, if measured."""

    facts: ProjectFacts
    evaluation: dict[str, Any]
    rates: FrameRates | None = None

    @property
    def group(self) -> str:
        """Cameras that its figures are of: held-out ones where there are any."""
        return main_group(self.evaluation)

    def figure(self, name: str) -> float | None:
        """Mean of a column over all clips."""
        return self.evaluation["means"][self.group].get(name)

    def seam(self, name: str) -> float | None:
        """A figure of flicker_figures, or of seams.means, of the same cameras as `figure`."""
        if name in FIGURES:
            return flicker_figures(self.evaluation["seams"]["rows"])[name]
        return self.evaluation["seams"]["means"][self.group].get(name)

    @property
    def later(self) -> dict[str, float | None]:
        """Figures of its later clips, see app.evaluation.source_clip_means."""
        seconds = {clip.clip_index: clip.wall_s for clip in self.facts.clips if clip.role == "source"}
        return later_figures(self.evaluation["means"]["clips"], self.group, seconds)

    @property
    def frame_rates(self) -> dict[str, float | None]:
        """How fast it is rendered, see app.evaluation.speed.frame_rates.FIGURES."""
        return dict.fromkeys(FIGURES_OF_RATES) if self.rates is None else self.rates.figures()

    @property
    def minutes(self) -> float | None:
        """Wall time of all clips; None when not recorded."""
        return None if self.facts.wall_s is None else self.facts.wall_s / 60.0

    @property
    def megabytes(self) -> float:
        """Size of all clip files."""
        return self.facts.n_bytes / 1e6

    @property
    def mb_per_frame(self) -> float:
        """Size per trained frame."""
        return self.megabytes / sum(clip.n_frames for clip in self.facts.clips)


def main_group(evaluation: dict[str, Any]) -> str:
    """held_out, or trained_on where nothing was held out."""
    return "held_out" if evaluation["means"].get("held_out") else "trained_on"


def comparison_section(compared: Sequence[Compared], left_out: Sequence[str]) -> Section:
    """One line per project, the page's own first. left_out: sentences on projects that could not be compared."""
    columns = (
        TableColumn("project", "Project"),
        *_figure_columns(_PAPER),
        TableColumn("mb_per_frame", "Size per frame", 3, False, "MB"),
        TableColumn("minutes", "Time", 2, False, "min"),
        TableColumn("fps_cpu", "FPS, CPU", 1, True),
        TableColumn("fps_gl", "FPS, OpenGL", 1, True),
        *_figure_columns(_OTHERS),
        *(TableColumn(key, title, n, False, unit) for key, title, unit, n in _SEAMS),
        TableColumn("megabytes", "Size", 1, False, "MB"),
        TableColumn("n_gaussians", "Gaussians drawn"),
        TableColumn("clips", "Clips"),
        TableColumn("settings", "Settings that differ from the first"),
        TableColumn("columns", "Columns"),
    )
    first = compared[0]
    rows = [
        {
            "project": one.facts.name,
            "settings": _settings_text(first, one),
            **{key: one.figure(key) for key, *_ in (*_PAPER, *_OTHERS)},
            **{key: one.seam(key) for key, *_ in _SEAMS},
            "minutes": one.minutes,
            "megabytes": one.megabytes,
            "mb_per_frame": one.mb_per_frame,
            **one.frame_rates,
            "clips": len(one.facts.clips),
            "columns": one.evaluation["metrics"],
        }
        for one in compared
    ]
    said = (
        f"Means over all clips and frames of the {first.group.replace('_', '-')} cameras, raw colours. The best value "
        "of a column is bold. Projects measured quickly have PSNR, SSIM and DSSIM1 only; --metrics "
        "all measures the rest."
    )
    notes = [note for one in compared[1:] if (note := comparability(first, one))]
    table = Table("comparison", "All projects", columns, rows)
    return Section("comparison", "Comparison", [said, table, definition_of(), *notes, *left_out])


def _figure_columns(figures: Sequence[tuple[str, str, str, int]]) -> list[TableColumn]:
    is_higher_better = ("psnr", "cc_psnr", "ssim")
    return [TableColumn(key, title, n, key.startswith(is_higher_better), unit) for key, title, unit, n in figures]


def comparability(first: Compared, other: Compared) -> str:
    """The reasons why the figures of two projects are hard to compare, as a sentence; empty when nothing does."""
    a, b = first.facts.settings, other.facts.settings
    reasons = []
    if a.fingerprint != b.fingerprint:
        reasons.append("is of another capture")
    elif set(a.holdout) != set(b.holdout):
        reasons.append(f"holds out other cameras ({', '.join(b.holdout) or 'none'})")
    if a.scale != b.scale:
        reasons.append(f"works at scale {b.scale:g}, not {a.scale:g}")
    frames = [{f for c in one.facts.clips for f in range(c.start, c.start + c.n_frames)} for one in (first, other)]
    if a.fingerprint == b.fingerprint and frames[0] != frames[1]:
        reasons.append(f"is measured on {len(frames[1])} frames, not the same {len(frames[0])}")
    if first.group != other.group:
        reasons.append("has figures of other kinds of cameras: held out here, trained on there or the other way round")
    if not reasons:
        return ""
    return f"{other.facts.name} {' and '.join(reasons)}; its figures cannot be compared with the first one's directly."


def _settings_text(first: Compared, one: Compared) -> str:
    if one is first:
        changed = one.facts.settings.config().difference()
        return ", ".join(f"{name}={value}" for name, value in changed.items()) or "defaults"
    usual, own = all_settings(first.facts.settings), all_settings(one.facts.settings)
    return ", ".join(f"{name}={value}" for name, value in own.items() if value != usual[name]) or "none"


def speed_section(compared: Sequence[Compared]) -> Section:
    """PSNR and flicker against wall time, with the Pareto front."""
    timed = [(one, one.minutes) for one in compared if one.minutes is not None]
    unknown = [one.facts.name for one in compared if one.minutes is None]
    parts: list = []
    if unknown:
        parts.append(f"Not drawn, because no wall time was recorded when it was trained: {', '.join(unknown)}.")
    if not timed:
        return Section("speed", "Speed against error", parts)
    minutes = [time for _, time in timed]
    panels = (
        SpeedPanel(f"PSNR, {timed[0][0].group.replace('_', '-')} cameras, raw, dB", _of(timed, "psnr"), True),
        SpeedPanel("seam ratio on static pixels", [one.seam("seam_ratio_static") for one, _ in timed], False),
        SpeedPanel("flicker inside clips, 1/255", [one.seam("flicker_inside") for one, _ in timed], False),
    )
    names = [one.facts.name for one, _ in timed]
    own = next((i for i, (one, _) in enumerate(timed) if one is compared[0]), None)
    on_front = []
    for panel in panels:
        known = [i for i, value in enumerate(panel.values) if value is not None]
        points = [(minutes[i], float(panel.values[i] or 0.0)) for i in known]
        front = pareto_front(points, is_higher_better=panel.is_higher_better)
        on_front.append({known[i] for i in front})
    columns = (
        TableColumn("mark", "Mark"),
        TableColumn("project", "Project"),
        TableColumn("minutes", "Time", 2, unit="min"),
        TableColumn("psnr", "PSNR", 2, unit="dB"),
        TableColumn("is_front_psnr", "On its front"),
        TableColumn("seam_ratio_static", "Seam ratio, static", 2),
        TableColumn("is_front_ratio", "On its front"),
        TableColumn("flicker_inside", "Flicker inside clips", 3, unit="1/255"),
        TableColumn("is_front_flicker", "On its front"),
    )
    rows = [
        {
            "mark": i + 1,
            "project": name,
            "minutes": minutes[i],
            "psnr": panels[0].values[i],
            "is_front_psnr": i in on_front[0],
            "seam_ratio_static": panels[1].values[i],
            "is_front_ratio": i in on_front[1],
            "flicker_inside": panels[2].values[i],
            "is_front_flicker": i in on_front[2],
        }
        for i, name in enumerate(names)
    ]
    caption = (
        "Each mark is one project, the diamond the one of this page; filled marks lie on the Pareto front: no other is "
        "both faster and better. The time is that of preparation and training of all its clips on the machine that "
        "trained."
    )
    alt = f"PSNR, seam ratio and flicker of {len(names)} projects against minutes"
    label = "preparation + training, minutes"
    chart = Figure("speed_error", draw_speed_error(names, minutes, panels, own, label), caption, alt)
    table = Table("speed_error", "The marks", columns, rows)
    return Section("speed", "Speed against error", [*parts, chart, table, definition_of(), *_later_parts(compared)])


def _later_parts(compared: Sequence[Compared]) -> list:
    """PSNR of the clips that inherit against the time one of them takes. Nothing for fewer than two projects."""
    timed = [(one, one.later) for one in compared]
    timed = [(one, later) for one, later in timed if later[LATER_S] and later[LATER_PSNR] is not None]
    if len(timed) < 2:
        return []
    names, seconds = [one.facts.name for one, _ in timed], [float(later[LATER_S] or 0.0) for _, later in timed]
    panels = (
        SpeedPanel(f"PSNR, {timed[0][0].group.replace('_', '-')} cameras, raw, dB", _values(timed, LATER_PSNR), True),
        SpeedPanel("PSNR of moving pixels, dB", _values(timed, LATER_MOVING), True),
    )
    own = next((i for i, (one, _) in enumerate(timed) if one is compared[0]), None)
    caption = "The same for a clip that inherits: means over the clips after the reference clip, which is not counted."
    alt = f"PSNR of later clips of {len(names)} projects against seconds"
    label = "preparation + training of a later clip, seconds"
    chart = Figure("later_clips", draw_speed_error(names, seconds, panels, own, label), caption, alt)
    columns = (
        TableColumn("mark", "Mark"),
        TableColumn("project", "Project"),
        TableColumn(LATER_S, "A later clip", 1, unit="s"),
        TableColumn(LATER_PSNR, "PSNR", 2, unit="dB"),
        TableColumn(LATER_MOVING, "PSNR, moving", 2, unit="dB"),
    )
    rows = [{"mark": i + 1, "project": one.facts.name, **later} for i, (one, later) in enumerate(timed)]
    return [chart, Table("later_clips", "Later clips", columns, rows)]


def _values(timed: Sequence[tuple[Compared, dict[str, float | None]]], name: str) -> list[float | None]:
    return [later[name] for _, later in timed]


def _of(timed: Sequence[tuple[Compared, float]], name: str) -> list[float | None]:
    return [one.figure(name) for one, _ in timed]
