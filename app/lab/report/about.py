"""Sections on the measured project: set-up, capture, split, settings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import datetime
from typing import Any

from msgspec import structs

from app.document.project_settings import ProjectSettings
from app.lab.machine import Machine
from app.lab.report.page.parts import Section
from app.lab.report.page.tables import Table, TableColumn
from app.project.project_facts import ClipFacts, ProjectFacts
from app.spans import MAX_SPANS, spans_text
from engine.own_modules import program_version
from engine.training.config import SETTINGS

_PAIR = (TableColumn("what", "Name"), TableColumn("value", "Value"))


def setup_section(facts: ProjectFacts, machine: Machine, now: datetime, evaluation: Mapping[str, Any]) -> Section:
    """Where and when the page was written."""
    choice = evaluation["metrics"]
    rows = {
        "Project": str(facts.project.folder),
        "Written": now.strftime("%Y-%m-%d %H:%M"),
        "Program": f"ClipGStream Studio {program_version()}",
        "Processor": f"{machine.cpu}, {machine.n_cores} cores, {machine.vectors}",
        "System": machine.system,
        "Versions": f"Python {machine.python}, torch {machine.torch}, numba {machine.numba}",
        "Figures": f"{choice} columns, pictures compared as {evaluation['precision']}",
    }
    said = "The machine is the one that wrote this page; training times are of the machine that trained."
    return Section("setup", "Set-up", [_pairs("setup", "Machine, versions and date", rows), said])


def capture_section(facts: ProjectFacts, capture: Mapping[str, Any]) -> Section:
    """The section on the capture. capture: see engine.capture.capture_summary.describe."""
    sizes = sorted({(camera["working_width"], camera["working_height"]) for camera in capture["cameras"]})
    stored = sorted({(camera["width"], camera["height"]) for camera in capture["cameras"]})
    rows = {
        "Folder": capture["path"],
        "Layout": capture["format"],
        "Cameras": capture["n_cameras"],
        "Frames": f"{capture['n_frames']} at {capture['fps']:g} per second, {capture['duration_s']:.1f} s",
        "Size, pixels": ", ".join(f"{w} x {h}" for w, h in sizes),
        "Stored size, pixels": ", ".join(f"{w} x {h}" for w, h in stored),
        "Scale": facts.settings.scale,
        "Fingerprint": capture["fingerprint"],
    }
    parts: list[Any] = [_pairs("capture", "The capture", rows)]
    parts += [f"Note: {warning}" for warning in capture["warnings"]]
    return Section("capture", "Capture", parts)


def split_section(facts: ProjectFacts, capture: Mapping[str, Any], n_clips: int) -> Section:
    """Which cameras and frames were trained on."""
    held_out = set(facts.settings.holdout)
    names = [camera["name"] for camera in capture["cameras"]]
    trained_on = [name for name in names if name not in held_out]
    measured = [clip.clip_index for clip in facts.clips]
    rows = {
        "Held out": ", ".join(name for name in names if name in held_out) or "none",
        "Trained on": f"{len(trained_on)}: {', '.join(trained_on)}",
        "Clip length, frames": facts.settings.clip_length,
        "Clips": f"{len(measured)} of {n_clips} trained: " + _clips_text(facts.clips),
    }
    parts: list[Any] = [_pairs("split", "Cameras and clips", rows)]
    covered = [{"clip": clip.clip_index, **structs.asdict(clip.coverage)} for clip in facts.clips if clip.coverage]
    if covered:
        columns = (
            TableColumn("clip", "Clip"),
            TableColumn("n_points", "Moving points"),
            TableColumn("n_inherited", "On inherited anchors"),
            TableColumn("n_residual", "Residual anchors"),
            TableColumn("n_left_out", "Beyond the budget"),
            TableColumn("share", "Within reach of an anchor", 3),
            TableColumn("reason", "Budget"),
        )
        parts.append(Table("coverage", "Moving points of later clips, and anchors near them", columns, covered))
    if len(measured) < n_clips:
        left = [index for index in range(n_clips) if index not in measured]
        parts.append(f"Not trained, and so in no figure of this page: clip {spans_text(left)}.")
    if not held_out:
        parts.append("No camera was held out: every figure is of pictures that the training has seen.")
    return Section("split", "Split", parts)


def _clips_text(clips: Sequence[ClipFacts]) -> str:
    """Clips with their frames; of many, runs of clips and runs of frames."""
    if len(clips) <= MAX_SPANS:
        return ", ".join(f"{c.clip_index} (frames {c.start} to {c.start + c.n_frames - 1})" for c in clips)
    frames = [frame for clip in clips for frame in range(clip.start, clip.start + clip.n_frames)]
    return f"{spans_text([clip.clip_index for clip in clips])} (frames {spans_text(frames)})"


def settings_section(facts: ProjectFacts) -> Section:
    """Training settings that differ from the defaults."""
    rows = [
        {"setting": name, "value": value, "default": SETTINGS[name].default}
        for name, value in facts.settings.config().difference().items()
    ]
    said = f"Seed {facts.settings.seed}, reference clip {facts.settings.reference_clip}."
    columns = (TableColumn("setting", "Setting"), TableColumn("value", "Value"), TableColumn("default", "Default"))
    if not rows:
        return Section("settings", "Settings", [f"All training settings are the defaults. {said}"])
    table = Table("settings", "Training settings that differ from the defaults", columns, rows)
    return Section("settings", "Settings", [table, said])


def all_settings(settings: ProjectSettings) -> dict[str, Any]:
    """Everything a project was trained with, one plain value per name."""
    names = ("scale", "clip_length", "seed", "reference_clip")
    return {
        **{name: getattr(settings, name) for name in names},
        "holdout": ",".join(settings.holdout) or "none",
        **structs.asdict(settings.config()),
    }


def _pairs(name: str, caption: str, rows: Mapping[str, Any]) -> Table:
    return Table(name, caption, _PAIR, [{"what": what, "value": value} for what, value in rows.items()])
