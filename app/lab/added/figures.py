"""Adds tOF and LPIPS to the document of an evaluation, which has neither: they take long, and LPIPS an
optional package.

They are of held-out cameras, all where none is held out, and of evaluations with all metrics. They are kept in the
project (PROJECT/evaluations/lab-*.json) until a clip changes.
"""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from app.evaluation.headless import TrainedProject
from app.evaluation.kept_figures import EVALUATIONS
from app.lab.added import lpips
from app.lab.added.tof import MIN_SIDE_PX, Motion, motion_of, tof
from app.lab.pictures import Pictures
from engine.capture.exclusions import exclusion_key
from engine.metrics.clips.summary import GROUPS, mean_of
from engine.metrics.columns import Column
from engine.metrics.pictures.colors import as_shown, fit_colors
from engine.storage.json_files import JsonError, read_checked_json, write_checked_json

logger = logging.getLogger(__name__)

ADDED_SCHEMA = 1
TOF_DEFINITION = (
    "mean |optical flow of the render - that of the truth| from one frame to the next, px per frame, Farneback's flow "
    "and border as TecoGAN takes them; of held-out cameras, all where none is held out, and with all metrics"
)
_LPIPS = "LPIPS with VGG-16, version 0.1, inputs in -1..1"
COLUMNS = {
    column.name: column
    for column in (
        Column("lpips", "1", False, False, _LPIPS),
        Column("lpips_fit", "1", False, False, f"{_LPIPS}, after the colour fit"),
        Column("lpips_unscaled", "1", False, False, "the same with inputs left in 0..1, as many tables have it"),
    )
}
"""Columns added to the rows of pictures; `tof` is added to those of pairs."""
Found = dict[str, dict[str, dict[str, float | None]]]
"""Figures by camera and frame, the latter as text."""


def with_added_figures(
    document: dict[str, Any],
    opened: TrainedProject,
    pictures: Pictures,
    *,
    on_progress: Callable[[int, int], None] = lambda done, n: None,
) -> dict[str, Any]:
    """The document of an evaluation with LPIPS in its rows, means and columns, and tOF in its pairs and their means.

    Args:
        document: See app.evaluation.evaluation.evaluate_project; changed in place.
        pictures: Renders of the project.
        on_progress: Gets pictures done and pictures in all.
    Raises:
        ProjectError: A clip is damaged.
    """
    if document["metrics"] != "all":
        return document
    why_no_lpips = lpips.why_missing()
    rows = [row for row in document["rows"] if row["is_held_out"]] or document["rows"]
    path, key = _path(document, opened), _key(document, opened, has_lpips=why_no_lpips is None)
    found = _read(path, key)
    if found is None:
        found = _measured(rows, document, opened, pictures, on_progress, has_lpips=why_no_lpips is None)
        try:
            write_checked_json(path, {"key": key, "found": found})
        except OSError as error:
            logger.warning("tOF and LPIPS are not kept (%s) - %s", error.strerror or error, path)
    _add_lpips(document, found, why_no_lpips)
    _add_tof(document["seams"], found)
    return document


def _measured(
    rows: list[dict[str, Any]],
    document: dict[str, Any],
    opened: TrainedProject,
    pictures: Pictures,
    on_progress: Callable[[int, int], None],
    *,
    has_lpips: bool,
) -> Found:
    capture = opened.measured.capture
    found: Found = {}
    if not has_lpips and min(capture.picture_size) < MIN_SIDE_PX:
        return found
    last: dict[str, tuple[int, Motion | None]] = {}
    for n_done, row in enumerate(rows):  # clip by clip, each camera's frames in order
        camera, frame = row["camera"], row["frame_index"]
        pixels, image = pictures.pair(row["clip_index"], frame, camera)
        is_valid = capture.valid_in(capture.rig.names.index(camera), frame)
        shown = as_shown(image, document["precision"])
        black = shown if is_valid is None else np.where(is_valid[..., None], shown, np.float32(0.0))
        motion = motion_of(black, pixels, is_valid)
        frame_before, before = last.get(camera, (-1, None))
        is_pair = frame_before == frame - 1 and before is not None and motion is not None
        figures: dict[str, float | None] = {"tof": tof(before, motion) if is_pair and before and motion else None}
        last[camera] = frame, motion
        if has_lpips:
            figures |= _lpips_of(shown, pixels, is_valid)
        found.setdefault(camera, {})[str(frame)] = figures
        on_progress(n_done + 1, len(rows))
    return found


def _lpips_of(shown: np.ndarray, pixels: np.ndarray, is_valid: np.ndarray | None) -> dict[str, float | None]:
    """Means over the valid pixels: both pictures show the truth elsewhere, where they do not differ then."""
    truth = pixels.astype(np.float32) / np.float32(255.0)
    if not np.isfinite(shown).all() or (is_valid is not None and not is_valid.any()):
        return {}
    share = 1.0 if is_valid is None else float(is_valid.mean())
    valid = np.True_ if is_valid is None else is_valid[..., None]
    fitted = np.clip(fit_colors(shown, truth, is_valid), 0.0, 1.0).astype(np.float32)
    raw, fitted = (np.where(valid, picture, truth) for picture in (shown, fitted))
    distances = lpips.lpips(raw, truth), lpips.lpips(fitted, truth), lpips.lpips_unscaled(raw, truth)
    return {
        name: None if distance is None or not np.isfinite(distance) else distance / share
        for name, distance in zip(COLUMNS, distances, strict=True)
    }


def _add_lpips(document: dict[str, Any], found: Found, why_missing: str | None) -> None:
    rows, means = document["rows"], document["means"]
    for row in rows:
        figures = found.get(row["camera"], {}).get(str(row["frame_index"]), {})
        row |= {name: figures.get(name) for name in COLUMNS}

    def add(place: dict[str, Any], part: list[dict[str, Any]]) -> None:
        if place:
            place |= {name: mean_of([row[name] for row in part]) for name in COLUMNS}

    add(means["all"], rows)
    for group in GROUPS:
        of_group = [row for row in rows if row["is_held_out"] == (group == "held_out")]
        add(means[group], of_group)
        for clip, groups in means["clips"].items():
            add(groups[group], [row for row in of_group if row["clip_index"] == int(clip)])
    reason = why_missing or "not measured: a camera that was trained on, or a picture without finite values"
    for name, column in COLUMNS.items():
        n_missing = Counter(row[name] for row in rows)[None]
        document["columns"][name] = {
            "definition": column.definition,
            "unit": column.unit,
            "is_higher_better": column.is_higher_better,
            "n_rows": len(rows) - n_missing,
            "n_missing": n_missing,
            "why_missing": {reason: n_missing} if n_missing else {},
        }


def _add_tof(seams: dict[str, Any], found: Found) -> None:
    rows = seams["rows"]
    for row in rows:
        row["tof"] = found.get(row["camera"], {}).get(str(row["frame_index"]), {}).get("tof")
    for group, means in seams["means"].items():
        part = [row for row in rows if group == "all" or row["is_held_out"] == (group == "held_out")]
        means["tof"] = mean_of([row["tof"] for row in part])
        for place, is_boundary in (("boundary", True), ("interior", False)):
            means[place]["tof"] = mean_of([row["tof"] for row in part if row["is_boundary"] == is_boundary])
    seams["definitions"] = {**seams["definitions"], "tof": TOF_DEFINITION}


# ---------------------------------------------------------------- kept


def _path(document: dict[str, Any], opened: TrainedProject) -> Path:
    return opened.project.folder / EVALUATIONS / f"lab-{document['precision']}.json"


def _key(document: dict[str, Any], opened: TrainedProject, *, has_lpips: bool) -> dict[str, Any]:
    """Everything that the figures depend on."""
    reference = opened.reference
    exclusions = opened.project.document.exclusions
    return {
        "schema": ADDED_SCHEMA,
        "capture": opened.project.settings.fingerprint,
        "scale": opened.capture.scale,
        "clips": {str(i): opened.header(i).fingerprint for i in document["clips"]},
        "last": opened.header(opened.last_trained).fingerprint,
        "reference": reference and reference.header.fingerprint,
        "holdout": sorted(document["holdout"]),
        "precision": document["precision"],
        "excluded": exclusion_key(exclusions, (0, opened.capture.n_frames)),
        "missing": [] if has_lpips else ["lpips"],
    }


def _read(path: Path, key: dict[str, Any]) -> Found | None:
    try:
        content = read_checked_json(path)
    except (OSError, JsonError):
        return None
    return content.get("found") if content.get("key") == key else None
