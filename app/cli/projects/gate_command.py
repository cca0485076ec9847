"""clipgstream gate: the gate's decisions in each trained clip, why, and where the user overrules it."""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from app.cli.arguments import EXIT_OK, path_argument
from app.project.opening.project_access import open_project
from app.project.project import Project
from app.session.marking import after_marking, effect_text, region_text
from app.training.service import Launch
from engine.clip_files.anchor_record import AnchorRecord
from engine.clip_files.clip_state import ClipState, read_clip_state
from engine.errors import ProjectError
from engine.gate.reasons import REASONS
from engine.gate.regions import parse_region
from engine.storage.json_files import json_text

SCHEMA = 1
_SHAPES = {"box": (("X0", "Y0", "Z0", "X1", "Y1", "Z1"), "two corners"), "sphere": (("X", "Y", "Z", "R"), "and radius")}


def add_arguments(command: argparse.ArgumentParser) -> None:
    """Arguments of `clipgstream gate`."""
    command.add_argument("project", type=path_argument, help="project folder")
    for treat, meaning in (("static", "nothing inside moves"), ("dynamic", "everything inside may change")):
        for shape, (names, what) in _SHAPES.items():
            command.add_argument(
                f"--{treat}-{shape}",
                dest="marks",
                action=_MarkAction,
                nargs=len(names),
                type=float,
                default=[],
                metavar=names,
                help=f"{meaning}: {'centre ' if shape == 'sphere' else ''}{what}, scene units; may be given often",
            )
    command.add_argument("--forget", action="store_true", help="forget the regions marked before")
    command.add_argument("--json", action="store_true", help="print everything as JSON")


class _MarkAction(argparse.Action):
    """Collects regions in the order in which they were given: later ones overrule earlier ones."""

    def __call__(
        self, parser: argparse.ArgumentParser, namespace: argparse.Namespace, values: Any, option_string: Any = None
    ) -> None:
        treat, shape = str(option_string).removeprefix("--").split("-")
        given = [values[:3], values[3:]] if shape == "box" else [values[:3], values[3]]
        setattr(namespace, self.dest, [*getattr(namespace, self.dest), {"treat": treat, shape: given}])


def run(options: argparse.Namespace, launch: Launch) -> int:
    """Mark regions if any are given, then list marks and decisions."""
    marks = [parse_region(values) for values in options.marks]
    is_change = bool(marks) or options.forget
    project = open_project(options.project, is_writable=is_change)
    try:
        if is_change:
            kept = () if options.forget else project.document.regions
            marked = replace(project.document, regions=after_marking(kept, marks))
            project.change(marked, "forget regions" if not marks else "mark regions")
        found = describe_gate(project)
    finally:
        project.close()
    print(json_text(found, indent=2) if options.json else "\n".join(gate_lines(found)))
    return EXIT_OK


def describe_gate(project: Project) -> dict[str, Any]:
    """Regions and decisions of a project as plain data.

    Returns:
        schema; path; gate (the setting); regions; clips, each with clip_index, role, sets (role of anchors to how
        many the clip stores), n_hidden (inherited static anchors it replaces), reasons (words to how many static
        anchors; empty where the clip was trained without a decision from pictures or regions); damaged, files of
        clips that cannot be read, each with path and reason.
    """
    clips, damaged = [], []
    for clip_index, path in project.finished_clips():
        try:
            clips.append(_describe_clip(read_clip_state(path), clip_index))
        except ProjectError as error:
            damaged.append({"path": str(path), "reason": error.message})
        except (KeyError, TypeError, ValueError, IndexError) as error:  # whole, but not as this version writes them
            damaged.append({"path": str(path), "reason": f"The clip file holds unexpected arrays ({error})."})
    return {
        "schema": SCHEMA,
        "path": str(project.folder),
        "gate": project.settings.config().gate,
        "regions": [region.as_dict() for region in project.document.regions],
        "clips": clips,
        "damaged": damaged,
    }


def _describe_clip(state: ClipState, clip_index: int) -> dict[str, Any]:
    records = state.anchors
    return {
        "clip_index": clip_index,
        "role": state.header.role,
        "sets": {role: len(record.own) for role, record in sorted(records.items()) if record.own is not None},
        "n_hidden": sum(int(record.is_hidden.sum()) for record in records.values() if record.is_hidden is not None),
        "reasons": _reasons(records.values()),
    }


def _reasons(records: Iterable[AnchorRecord]) -> dict[str, int]:
    codes = [record.reasons for record in records if record.reasons is not None]
    counts = np.bincount(np.concatenate([np.zeros(0, np.uint8), *codes]), minlength=len(REASONS))
    return {words: int(n) for words, n in zip(REASONS, counts, strict=True) if n}


def gate_lines(found: dict[str, Any]) -> list[str]:
    """The same as text."""
    lines = [f"{found['path']}: gate={found['gate']}"]
    lines += [f"  marked: {region_text(parse_region(values))}" for values in found["regions"]]
    if found["regions"]:
        lines.append(f"  {effect_text([clip['clip_index'] for clip in found['clips']], gate=found['gate'])}")
    for clip in found["clips"]:
        sets = ", ".join(f"{n} {name}" for name, n in clip["sets"].items()) or "no"
        hidden = f"; {clip['n_hidden']} inherited static anchors are replaced" if clip["n_hidden"] else ""
        lines.append(f"{clip['role']} {clip['clip_index']}: {sets} anchors of its own{hidden}")
        lines += [f"  {n:>7}  {words}" for words, n in clip["reasons"].items()]
    lines += [f"{clip['path']}: {clip['reason']}" for clip in found["damaged"]]
    return lines
