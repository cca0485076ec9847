"""Evaluations are kept beside the project they are of, so that a second report measures nothing again."""

from __future__ import annotations

import hashlib
import json
import logging
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from app.evaluation import EVAL_SCHEMA, evaluate_project
from app.headless import TrainedProject, open_trained
from app.report.facts import ProjectFacts
from engine.json_files import JsonError, read_checked_json, write_checked_json

if TYPE_CHECKING:
    from engine.metrics.colors import Precision
    from engine.metrics.picture import Choice

logger = logging.getLogger(__name__)

CACHE_SCHEMA = 2
REPORTS = "reports"
"""Folder of a project for its reports."""
Measure = Callable[..., dict[str, Any]]


def evaluation_key(facts: ProjectFacts, metrics: Choice, precision: Precision) -> str:
    """Names everything that the figures depend on: clips, cameras, size, choices, what this machine measures."""
    from engine.metrics import lpips

    settings = facts.settings
    missing = [lpips.why_missing()] if metrics == "all" else []
    content = {
        "schemas": [CACHE_SCHEMA, EVAL_SCHEMA],
        "capture": settings.fingerprint,
        "scale": settings.scale,
        "holdout": sorted(settings.holdout),
        "clips": [[clip.clip_index, clip.start, clip.n_frames, clip.fingerprint] for clip in facts.clips],
        "metrics": metrics,
        "precision": precision,
        "missing": missing,
    }
    return hashlib.sha256(json.dumps(content).encode()).hexdigest()[:16]


def evaluation_of(
    facts: ProjectFacts,
    *,
    choices: Sequence[Choice],
    precision: Precision = "float",
    fallback_dir: Path,
    on_progress: Callable[[int, int, Any], None],
    measure: Measure = evaluate_project,
    opened: TrainedProject | None = None,
) -> dict[str, Any]:
    """The evaluation document of a project's trained clips, from a file when there is one that fits.

    Args:
        choices: Metrics that will do, the best first; the last is measured when none is there.
        precision: Pictures as rendered, or rounded to 8 bit.
        fallback_dir: Takes the file when the project's own folder cannot be written to.
        on_progress, measure: See app.evaluation.evaluate_project.
        opened: The project when it is open already.
    Raises:
        ProjectError, CaptureError: The project cannot be measured.
    """
    for choice in choices:
        key = evaluation_key(facts, choice, precision)
        for path in _places(facts, _name(choice, precision), key, fallback_dir):
            found = _read(path, key)
            if found is not None:
                return found
    choice = choices[-1]
    key = evaluation_key(facts, choice, precision)
    opened = open_trained(facts.project) if opened is None else opened
    document = measure(
        opened,
        clip_indices=[clip.clip_index for clip in facts.clips],
        metrics=choice,
        precision=precision,
        on_progress=on_progress,
    )
    kept = {"schema": CACHE_SCHEMA, "key": key, "evaluation": document}
    for path in _places(facts, _name(choice, precision), key, fallback_dir):
        try:
            write_checked_json(path, kept)
            break
        except OSError as error:  # a project may lie where nothing can be written
            logger.info("an evaluation was not kept (%s) - %s", error.strerror, path)
    return document


def _name(choice: Choice, precision: Precision) -> str:
    return f"eval-{choice}" if precision == "float" else f"eval-{choice}-{precision}"


def _places(facts: ProjectFacts, name: str, key: str, fallback_dir: Path) -> tuple[Path, Path]:
    own = facts.project.folder / REPORTS / f"{name}.json"
    return own, fallback_dir / "evaluations" / f"{name}-{key}.json"


def _read(path: Path, key: str) -> dict[str, Any] | None:
    try:
        content = read_checked_json(path)
    except (OSError, JsonError):
        return None
    if content.get("key") != key or not isinstance(content.get("evaluation"), dict):
        return None
    return content["evaluation"]
