"""The ledger: files in docs/results, each written by the command that it names, and what the documents show of them."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import msgspec

from app.lab.published import N_FRAMES, published_of
from tests.documents.table import table

LEDGER = Path(__file__).resolve().parents[2] / "docs" / "results"
SCHEMA = 2


class ClipRow(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Figures of one clip over its held-out pictures: dB, seconds, bytes. Kinds of pixels as in docs/results.md."""

    clip_index: int
    is_reference: bool
    n_pictures: int
    psnr: float
    psnr_fit: float
    psnr_moving: float
    psnr_rest: float
    psnr_fit_rest: float
    ssim: float
    flip: float
    preparation_s: float
    training_s: float
    n_bytes: int


class Calm(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How much held-out pictures change from one frame to the next, in 1/255, inside clips and at boundaries.

    Attributes:
        render, truth: Still pixels of the render and of the capture: inside, at boundaries.
        moving_ratio, moving_ratio_truth: The change of moving pixels at boundaries over that inside.
        boundaries: The change of still pixels at each boundary over that in the two clips next to it, all cameras.
    """

    render: tuple[float, float]
    truth: tuple[float, float]
    moving_ratio: float
    moving_ratio_truth: float
    boundaries: list[float]


class _Measured(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field="kind", kw_only=True):
    """What every file of the ledger says.

    Attributes:
        title: Of the capture, or of what was measured.
        commands: What was run, one after the other; SAMPLE, BASKETBALL, CAPTURE, DIR, OUT and FILE stand for paths.
        commit: Of the code; "" where it was not written down.
        day: ISO date.
        machine: Processor, cores and versions, one line.
        seeds: Of the trainings; empty where nothing was trained.
        took_s: Seconds from the first command to the end of the last one, for a forecast; None is not known.
        remark: What else has to be known, such as other work on the machine; may be empty.
        is_copied: The file was made from a printed table, before there was a ledger, and not by its command.
    """

    schema: int = SCHEMA
    title: str
    commands: list[str]
    commit: str
    day: str
    machine: str
    seeds: list[int]
    took_s: float | None = None
    remark: str = ""
    is_copied: bool = False


class ClipsEntry(_Measured, frozen=True, forbid_unknown_fields=True, tag="clips", kw_only=True):
    """Clips of one capture with the default settings.

    Attributes:
        fingerprint, settings: Of the same code, see `tests.documents.fingerprint`.
    """

    rows: list[ClipRow]
    calm: Calm | None = None
    fingerprint: dict[str, tuple[int, float]] = {}
    settings: dict[str, Any] = {}

    @property
    def later(self) -> list[ClipRow]:
        """Clips after the reference clip."""
        return [row for row in self.rows if not row.is_reference]

    def mean(self, name: str) -> float:
        """Of a figure, every picture counting the same."""
        n_pictures = sum(row.n_pictures for row in self.rows)
        return sum(getattr(row, name) * row.n_pictures for row in self.rows) / n_pictures

    def total(self, name: str) -> float:
        """Sum of a figure over the clips."""
        return sum(getattr(row, name) for row in self.rows)


class TableEntry(_Measured, frozen=True, forbid_unknown_fields=True, tag="table", kw_only=True):
    """A table as its command printed it: headings, and cells of every row."""

    columns: list[str]
    rows: list[list[str]]

    def cell(self, row: str, column: str) -> str:
        """The cell of a row that starts with these words. Raises LookupError where there is none."""
        found = [cells for cells in self.rows if cells[0] == row]
        if len(found) != 1 or column not in self.columns:
            raise LookupError(f"no cell in row '{row}' and column '{column}'")
        return found[0][self.columns.index(column)]


Entry = ClipsEntry | TableEntry


def names() -> list[str]:
    """All files of the ledger."""
    return sorted(path.stem for path in LEDGER.glob("*.json"))


def entry(name: str) -> Entry:
    """A file of the ledger. Raises ValueError for one that is damaged, or of another schema."""
    read = msgspec.json.decode((LEDGER / f"{name}.json").read_bytes(), type=Entry)
    if read.schema != SCHEMA:
        raise ValueError(f"{name}.json has schema {read.schema}, not {SCHEMA}; measure it again with make figures")
    return read


def clips_entry(name: str) -> ClipsEntry:
    """A file with figures of clips. Raises ValueError as `entry`, and for one of another kind."""
    found = entry(name)
    if not isinstance(found, ClipsEntry):
        raise ValueError(f"{name}.json holds a table, not clips")
    return found


def table_entry(name: str) -> TableEntry:
    """A file with a table. Raises ValueError as `entry`, and for one of another kind."""
    found = entry(name)
    if not isinstance(found, TableEntry):
        raise ValueError(f"{name}.json holds clips, not a table")
    return found


def write_entry(name: str, made: Entry) -> Path:
    """Add a file to the ledger, or replace it; returns its path."""
    path = LEDGER / f"{name}.json"
    LEDGER.mkdir(exist_ok=True)
    fields = (f" {json.dumps(key)}: {_lines(value)}" for key, value in msgspec.to_builtins(made).items())
    path.write_text("{\n" + ",\n".join(fields) + "\n}\n", "utf-8")
    return path


def _lines(value: Any) -> str:
    """JSON with a line for each item of a list or object, so that changes can be read line by line."""
    if isinstance(value, dict) and value:
        return "{\n" + ",\n".join(f"  {json.dumps(key)}: {json.dumps(one)}" for key, one in value.items()) + "\n }"
    if isinstance(value, list) and value:
        return "[\n" + ",\n".join(f"  {json.dumps(one)}" for one in value) + "\n ]"
    return json.dumps(value)


HEADLINE = ("sample", "basketball")
"""Files whose figures come first, in this order."""
IN_LAB = ("ablation", "paper", "equal")
"""How files begin whose tables are in docs/lab."""


PAPER_PRESET = ("paper-sample", "paper-equal-steps", "paper-basketball", "paper-basketball-default")
"""Files of the published method next to this program's defaults."""


def quality_table() -> str:
    """The clips of the headline."""
    return _clips_table(HEADLINE)


def paper_preset_table() -> str:
    """The published method and this program's defaults."""
    return _clips_table(PAPER_PRESET)


def _clips_table(names: Sequence[str]) -> str:
    """A row per clip, and one per capture of more than two; below it where they come from."""
    header = "capture", "clip", "PSNR", "PSNR fit", "moving pixels", "other pixels", "other, fit", "SSIM", "FLIP"
    lines: list[tuple[str, ...]] = []
    for name in names:
        found = clips_entry(name)
        for row in found.rows:
            title = found.title if row is found.rows[0] else ""
            clip = f"{row.clip_index} (reference)" if row.is_reference else str(row.clip_index)
            seconds = f"{row.preparation_s:.0f}", f"{row.training_s:.0f}"
            lines.append((title, clip, *_figures(partial(getattr, row)), *seconds, f"{row.n_bytes / 1e6:.2f}"))
        if len(found.rows) > 2:
            seconds = tuple(f"{found.total(kind):.0f}" for kind in ("preparation_s", "training_s"))
            lines.append(("", "all", *_figures(found.mean), *seconds, f"{found.total('n_bytes') / 1e6:.2f}"))
    sources = "\n".join(source(name) for name in names)
    return f"{table((*header, 'preparation s', 'training s', 'MB'), lines)}\n\n{sources}"


def headline_table() -> str:
    """A row per capture: what a reader wants to know first."""
    header = "capture", "PSNR", "after a fit of each camera's colours", "moving pixels", "SSIM"
    lines = []
    for name in HEADLINE:
        found = clips_entry(name)
        decibels = [f"{found.mean(kind):.1f} dB" for kind in ("psnr", "psnr_fit", "psnr_moving")]
        minutes = (found.total("preparation_s") + found.total("training_s")) / 60
        seconds = _span([row.preparation_s + row.training_s for row in found.later], 0, "s")
        size = _span([row.n_bytes / 1e6 for row in found.later], 1, "MB")
        title = f"{found.title}, {len(found.rows)} clips of ten frames"
        lines.append((title, *decibels, f"{found.mean('ssim'):.3f}", f"{minutes:.1f} min", seconds, size))
    return table((*header, "all trained in", "a later clip takes", "and is stored in"), lines)


def calm_table() -> str:
    """How calm still parts of the basketball are, in words and figures."""
    calm = clips_entry("basketball").calm
    if calm is None:
        raise ValueError("basketball.json says nothing of seams")
    lines = [
        (what, f"{inside:.2f}", f"{at:.2f}", f"{at / inside:.1f}")
        for what, (inside, at) in (("render", calm.render), ("capture", calm.truth))
    ]
    shown = table(("still pixels, held-out cameras, 1/255", "inside clips", "at boundaries", "ratio"), lines)
    ratios = ", ".join(f"{ratio:.1f}" for ratio in calm.boundaries)
    return (
        f"{shown}\n\nAt the boundaries one by one, over all cameras, still pixels change {ratios} times as much as in "
        f"the clips next to them. Moving pixels change {calm.moving_ratio:.2f} times as much at boundaries as inside, "
        f"in the capture {calm.moving_ratio_truth:.2f} times."
    )


def beside_published_table() -> str:
    """Figures that others published of the basketball, next to those of this program."""
    ours = clips_entry("basketball")
    n_frames = f"{10 * len(ours.rows)} of {N_FRAMES}"
    words = f"this program, the first {len(ours.rows)} clips"
    figures = f"{ours.mean('psnr'):.2f}", f"{ours.mean('ssim'):.3f}", "not measured"
    lines: list[tuple[str, ...]] = [(words, n_frames, *figures, "[basketball.json](results/basketball.json)")]
    for one in published_of("basketball"):
        others = ("" if value is None else f"{value:.3f}" for value in (one.ssim, one.lpips))
        method = f"{one.method}, {one.caveat}" if one.caveat else one.method
        lines.append((method, str(one.n_frames or "not said"), f"{one.psnr:.2f}", *others, one.source))
    return table(("", "frames", "PSNR", "SSIM", "LPIPS", "source"), lines)


def ledger_table(name: str) -> str:
    """The table of a file, and where it comes from."""
    found = entry(name)
    if isinstance(found, ClipsEntry):
        return _clips_table((name,))
    return f"{table(found.columns, found.rows)}\n\n{source(name)}"


def source(name: str) -> str:
    """Where a file's figures come from, as a line of a list."""
    found = entry(name)
    commands = "`, then `".join(found.commands)
    commit = f"commit {found.commit}" if found.commit else "commit not written down"
    up = "../" if name.startswith(IN_LAB) else ""
    seeds = "" if not found.seeds else f", seed {', '.join(map(str, found.seeds))}"
    remark = f" {found.remark}" if found.remark else ""
    copied = " Copied from the table as it was printed." if found.is_copied else ""
    machine = "" if found.machine == entry(HEADLINE[0]).machine and name != HEADLINE[0] else f"; {found.machine}"
    when = f"{commit}, {found.day}{seeds}{machine}.{remark}{copied}"
    return f"- [{name}.json]({up}results/{name}.json): `{commands}`; {when}"


def _figures(of: Callable[[str], float]) -> list[str]:
    decibels = [f"{of(kind):.2f}" for kind in ("psnr", "psnr_fit", "psnr_moving", "psnr_rest", "psnr_fit_rest")]
    return [*decibels, *(f"{of(kind):.3f}" for kind in ("ssim", "flip"))]


def _span(values: list[float], digits: int, unit: str) -> str:
    low, high = (f"{value:.{digits}f}" for value in (min(values), max(values)))
    return f"{low} {unit}" if low == high else f"{low} to {high} {unit}"
