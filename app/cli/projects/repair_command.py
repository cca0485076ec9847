"""clipgstream repair: the rest of a project whose document or journal is damaged, and continuing with it."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import Any

from app.cli.arguments import EXIT_BAD_INPUT, EXIT_OK, path_argument
from app.document.storing.recovery import Recovery, look_for_recovery
from app.document.storing.replay import replayed
from app.project.opening.project_access import repair_project
from app.training.service import Launch
from engine.storage.json_files import json_text

SCHEMA = 1


def add_arguments(command: argparse.ArgumentParser) -> None:
    """Arguments of `clipgstream repair`."""
    command.add_argument("project", type=path_argument, help="project folder")
    command.add_argument(
        "--keep-good-steps",
        action="store_true",
        help="continue with all that can be read; damaged files are kept in the project folder",
    )
    command.add_argument("--json", action="store_true", help="print everything as JSON")


def run(options: argparse.Namespace, launch: Launch) -> int:
    """Print the rest, and repair the project where that was asked for. Bad input where it stays damaged."""
    found = look_for_recovery(options.project)
    aside = repair_project(options.project) if found is not None and options.keep_good_steps else None
    missing = replayed(options.project).notes if found is None else ()
    place = {"path": str(options.project), "kept_aside": None if aside is None else str(aside)}
    result = described(found, missing) | place
    print(json_text(result, indent=2) if options.json else "\n".join(repair_lines(result)))
    return EXIT_OK if found is None or aside is not None else EXIT_BAD_INPUT


def described(found: Recovery | None, missing: Sequence[str]) -> dict[str, Any]:
    """Remaining steps, as plain data.

    Args:
        found: None where nothing is damaged.
        missing: Missing things although nothing is damaged, in sentences.
    Returns:
        schema; is_damaged; missing; of a damaged project also problem; step, the last one that can be kept, null where
        nothing can be read; step_name, what it did; n_replayed, steps of those that come from the journal;
        is_from_backup, whether the document comes from the backup of project.json.
    """
    if found is None:
        return {"schema": SCHEMA, "is_damaged": False, "missing": list(missing)}
    return {
        "schema": SCHEMA,
        "is_damaged": True,
        "missing": list(missing),
        "problem": found.problem,
        "step": found.step,
        "step_name": found.step_name,
        "n_replayed": found.n_replayed,
        "is_from_backup": found.is_from_backup,
    }


def repair_lines(result: dict[str, Any]) -> list[str]:
    """The same as text."""
    if result["missing"]:
        found = [f"{result['path']}: {note}" for note in result["missing"]]
        return [*found, "Everything present can be read, and the project continues from it. A backup may hold more."]
    if not result["is_damaged"]:
        return [f"{result['path']}: the document and its journal are whole."]
    lines = [f"{result['path']}: {result['problem']}"]
    if result["step"] is None:
        return [
            *lines,
            "The document cannot be read. Restore project.json from a backup; clips are not affected.",
        ]
    source = "the backup of the project file" if result["is_from_backup"] else "the project file"
    last = f" ({result['step_name']})" if result["step_name"] else ""
    lines.append(f"Everything up to step {result['step']}{last} can be read, from {source} and the journal.")
    if result["kept_aside"] is None:
        return [*lines, "With --keep-good-steps the project continues from there."]
    return [*lines, f"The project continues from there. Damaged files are kept in {result['kept_aside']}."]
