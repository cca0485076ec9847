"""The ledger: files in docs/results, each written by a command, and the tables of the documents that come from them."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import partial
from pathlib import Path

import msgspec

from tests.documents.table import table

LEDGER = Path(__file__).resolve().parents[2] / "docs" / "results"
SCHEMA = 1


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


class Entry(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One file of the ledger.

    Attributes:
        title: Of the capture, for a table.
        commands: What was run, one after the other; CAPTURE, DIR and FILE stand for paths.
        commit: Of the code.
        day: ISO date.
        machine: Processor, cores and versions, one line.
        remark: What else has to be known, such as other work on the machine; may be empty.
    """

    schema: int
    title: str
    commands: list[str]
    commit: str
    day: str
    machine: str
    seed: int
    remark: str
    rows: list[ClipRow]

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


def entry(name: str) -> Entry:
    """A file of the ledger. Raises ValueError for one that is damaged, or of another schema."""
    read = msgspec.json.decode((LEDGER / f"{name}.json").read_bytes(), type=Entry)
    if read.schema != SCHEMA:
        raise ValueError(f"{name}.json has schema {read.schema}, not {SCHEMA}; measure it again with make figures")
    return read


def write_entry(name: str, made: Entry) -> Path:
    """Add a file to the ledger, or replace it; returns its path."""
    path = LEDGER / f"{name}.json"
    LEDGER.mkdir(exist_ok=True)
    path.write_text(json.dumps(msgspec.to_builtins(made), indent=1) + "\n", "utf-8")
    return path


NAMES = ("sample", "basketball")
"""Files that the documents show, in this order."""


def quality_table() -> str:
    """A row per clip, and one per capture of more than two; below it where they come from."""
    header = "capture", "clip", "PSNR", "PSNR fit", "moving pixels", "other pixels", "other, fit", "SSIM", "FLIP"
    lines: list[tuple[str, ...]] = []
    for name in NAMES:
        found = entry(name)
        for row in found.rows:
            title = found.title if row is found.rows[0] else ""
            clip = f"{row.clip_index} (reference)" if row.is_reference else str(row.clip_index)
            seconds = f"{row.preparation_s:.0f}", f"{row.training_s:.0f}"
            lines.append((title, clip, *_figures(partial(getattr, row)), *seconds, f"{row.n_bytes / 1e6:.2f}"))
        if len(found.rows) > 2:
            seconds = tuple(f"{found.total(kind):.0f}" for kind in ("preparation_s", "training_s"))
            lines.append(("", "all", *_figures(found.mean), *seconds, f"{found.total('n_bytes') / 1e6:.2f}"))
    sources = "\n".join(_source(name) for name in NAMES)
    return f"{table((*header, 'preparation s', 'training s', 'MB'), lines)}\n\n{sources}"


def headline_table() -> str:
    """A row per capture: what a reader wants to know first."""
    header = "capture", "PSNR", "after a fit of each camera's colours", "moving pixels", "SSIM"
    lines = []
    for name in NAMES:
        found = entry(name)
        decibels = [f"{found.mean(kind):.1f} dB" for kind in ("psnr", "psnr_fit", "psnr_moving")]
        minutes = (found.total("preparation_s") + found.total("training_s")) / 60
        seconds = _span([row.preparation_s + row.training_s for row in found.later], 0, "s")
        size = _span([row.n_bytes / 1e6 for row in found.later], 1, "MB")
        title = f"{found.title}, {len(found.rows)} clips of ten frames"
        lines.append((title, *decibels, f"{found.mean('ssim'):.3f}", f"{minutes:.1f} min", seconds, size))
    return table((*header, "all trained in", "a later clip takes", "and is stored in"), lines)


def _figures(of: Callable[[str], float]) -> list[str]:
    decibels = [f"{of(kind):.2f}" for kind in ("psnr", "psnr_fit", "psnr_moving", "psnr_rest", "psnr_fit_rest")]
    return [*decibels, *(f"{of(kind):.3f}" for kind in ("ssim", "flip"))]


def _span(values: list[float], digits: int, unit: str) -> str:
    low, high = (f"{value:.{digits}f}" for value in (min(values), max(values)))
    return f"{low} {unit}" if low == high else f"{low} to {high} {unit}"


def _source(name: str) -> str:
    found = entry(name)
    commands = "`, then `".join(found.commands)
    remark = f" {found.remark}" if found.remark else ""
    return (
        f"- [{name}.json](results/{name}.json): `{commands}`; commit {found.commit}, {found.day}, seed {found.seed}; "
        f"{found.machine}.{remark}"
    )
