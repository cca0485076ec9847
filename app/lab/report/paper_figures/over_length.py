"""The sections on length: quality, instability and storage over frames per clip (M) and over frames in all (N)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from app.lab.flicker import OWN_BORDERS, definition_of, flicker_figures
from app.lab.report.about import all_settings
from app.lab.report.comparison import Compared, comparability
from app.lab.report.page.parts import Figure, Section
from app.lab.report.page.tables import Table, TableColumn
from app.lab.report.paper_figures.length_chart import LengthPanel, Series, draw_over_length
from app.lab.report.paper_figures.pictured import of_main_group
from engine.metrics.clips.summary import mean_of

MAX_ENDS = 40
"""Points of a line over the sequence; of more clips some are left out, evenly."""
_FIGURES = {
    "psnr": ("PSNR", "dB", 2),
    "flicker_inside": ("Flicker inside clips", "1/255", 3),
    "flicker_borders": ("Flicker at borders", "1/255", 3),
    "seam_ratio_static": ("Seam ratio, static (1: no seam)", "", 3),
    "score": ("Seam score (0: no seam)", "1/255", 3),
    "megabytes": ("Size", "MB", 2),
    "mb_per_frame": ("Size per frame", "MB", 3),
}
"""Name to heading, unit and decimals."""
_MINUTES = {"minutes": ("Time", "min", 2)}
_GOES_WITH_LENGTH = ("clip_length", "static_steps", "joint_steps", "source_steps", "seed")
"""Settings in which projects that differ by clip length only may differ: steps are those of the frames of a clip."""


# ---------------------------------------------------------------- over M


def clip_length_section(compared: Sequence[Compared]) -> Section | None:
    """Figures over frames per clip; None where all projects have clips of one length.

    Only projects that can be compared with the first one take part. Those that differ from another by the length of
    their clips alone are joined by a line; the others are marks by themselves.
    """
    chosen = [one for one in compared if not comparability(compared[0], one)]
    lengths = sorted({one.facts.settings.clip_length for one in chosen})
    if len(lengths) < 2:
        return None
    families: dict[str, list[Compared]] = {}
    for one in chosen:
        kept = {
            name: value for name, value in all_settings(one.facts.settings).items() if name not in _GOES_WITH_LENGTH
        }
        families.setdefault(repr(sorted(kept.items())), []).append(one)
    rows = [
        {"project": one.facts.name, "clip_length": one.facts.settings.clip_length, **_figures_of(one)} for one in chosen
    ]
    by_name = {row["project"]: row for row in rows}

    def series(name: str) -> list[Series]:
        found = []
        for family in families.values():
            in_order = sorted(family, key=lambda one: one.facts.settings.clip_length)
            points = [(one.facts.settings.clip_length, by_name[one.facts.name][name]) for one in in_order]
            found.append(Series(family[0].facts.name, points))
        return found

    n_frames = sum(clip.n_frames for clip in chosen[0].facts.clips)
    drawn = {name: words for name, words in _FIGURES.items() if name != "megabytes"}  # of equal frames: the same curve
    chart = draw_over_length(_panels(series, drawn), "M, frames per clip", ticks=lengths)
    caption = (
        f"Every project on the same {n_frames} frames. A line joins projects that differ by the length of their clips "
        "alone; it is called by the first of them. One clip for all frames has no borders."
    )
    alt = f"Figures of {len(chosen)} projects over frames per clip: {', '.join(map(str, lengths))}. {caption}"
    columns = (TableColumn("project", "Project"), TableColumn("clip_length", "M"), *_columns(_FIGURES))
    rows.sort(key=lambda row: row["clip_length"])
    table = Table("over_clip_length", "Figures over frames per clip", columns, rows)
    return Section(
        "over_clip_length",
        "Over clip length",
        [Figure("over_clip_length", chart, caption, alt), table, definition_of(OWN_BORDERS)],
    )


def _figures_of(one: Compared) -> dict[str, float | None]:
    size = {"megabytes": one.megabytes, "mb_per_frame": one.mb_per_frame}
    return {"psnr": one.figure("psnr")} | {name: one.seam(name) for name in _SEAMS} | size


_SEAMS = ("flicker_inside", "flicker_borders", "seam_ratio_static", "score")


# ---------------------------------------------------------------- over N


def sequence_length_section(compared: Sequence[Compared]) -> Section | None:
    """Means over the first n clips, for every n; None where nothing has two clips."""
    first = compared[0]
    chosen = [one for one in compared if one.facts.settings.fingerprint == first.facts.settings.fingerprint]
    longest = max(chosen, key=lambda one: len(one.facts.clips))
    if len(longest.facts.clips) < 2:
        return None
    ends = _ends(first if len(first.facts.clips) > 1 else longest)
    found = {one.facts.name: _over_sequence(one, ends) for one in chosen}

    def series(name: str) -> list[Series]:
        return [Series(project, [(row["n_frames"], row[name]) for row in rows]) for project, rows in found.items()]

    figures = _FIGURES | _MINUTES
    chart = draw_over_length(_panels(series, figures), "N, frames from the first")
    caption = (
        "Means over all frames up to N, and size and training time of the clips that show them. The models are those "
        "that were trained on everything: a project with one clip was not trained anew for each N, so its size and "
        "time are known at its end only. Borders are those of each project's own clips."
    )
    alt = f"Curves of {len(found)} projects over frames from the first. {caption}"
    columns = (
        TableColumn("project", "Project"),
        TableColumn("n_clips", "Clips"),
        TableColumn("n_frames", "N"),
        *_columns(figures),
    )
    rows = [{"project": project, **row} for project, part in found.items() for row in part]
    table = Table("over_sequence_length", "Means over the first n clips", columns, rows)
    figure = Figure("over_sequence_length", chart, caption, alt)
    return Section("over_sequence_length", "Over sequence length", [figure, table])


def _ends(one: Compared) -> list[int]:
    """Numbers of frames from the first trained one to the ends of clips."""
    counts, n = [], 0
    for clip in one.facts.clips:
        n += clip.n_frames
        counts.append(n)
    kept = min(len(counts), MAX_ENDS)
    return [counts[(i + 1) * len(counts) // kept - 1] for i in range(kept)]


def _over_sequence(one: Compared, ends: Sequence[int]) -> list[dict[str, Any]]:
    """Figures of the first n frames, at the ends of a project's clips; where it has one, at the given ones."""
    clips = one.facts.clips
    frames = [frame for clip in clips for frame in range(clip.start, clip.start + clip.n_frames)]
    rows = of_main_group(one, one.evaluation["rows"])
    pairs = of_main_group(one, one.evaluation["seams"]["rows"])
    boundaries = one.evaluation["seams"]["boundaries"]
    found = []
    for n in _ends(one) if len(clips) > 1 else sorted({*(n for n in ends if n < len(frames)), len(frames)}):
        last = frames[n - 1]
        done = [clip for clip in clips if clip.start + clip.n_frames - 1 <= last]
        is_whole = bool(done) and done[-1].start + done[-1].n_frames - 1 == last
        times = [clip.wall_s for clip in done]
        known = [time for time in times if time is not None]
        megabytes = sum(sum(clip.storage.values()) for clip in done) / 1e6 if is_whole else None
        flicker = flicker_figures([pair for pair in pairs if pair["frame_index"] <= last])
        before = [boundary for boundary in boundaries if boundary["frame_index"] <= last]
        found.append(
            {
                "n_clips": len(done) if is_whole else None,
                "n_frames": n,
                "psnr": mean_of([row["psnr"] for row in rows if row["frame_index"] <= last]),
                **{name: flicker[name] for name in _SEAMS if name in flicker},
                "score": mean_of([boundary[one.group]["score"] for boundary in before]),
                "megabytes": megabytes,
                "mb_per_frame": None if megabytes is None else megabytes / n,
                "minutes": sum(known) / 60.0 if is_whole and len(known) == len(times) else None,
            }
        )
    return found


# ---------------------------------------------------------------- both


def _panels(series: Callable[[str], list[Series]], figures: dict[str, tuple[str, str, int]]) -> list[LengthPanel]:
    return [
        LengthPanel(f"{title}, {unit}" if unit else title, series(name)) for name, (title, unit, _) in figures.items()
    ]


def _columns(figures: dict[str, tuple[str, str, int]]) -> list[TableColumn]:
    return [TableColumn(name, title, digits, unit=unit) for name, (title, unit, digits) in figures.items()]
