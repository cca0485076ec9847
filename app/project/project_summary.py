"""The size of a project folder, in bytes, for `clipgstream inspect PROJECT`: per clip and component, and that
of a minute of video. Reads headers only; the figures are those of the report page."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from msgspec.structs import asdict

from app.project.clips.clip_bytes import COMPONENT_NAMES
from app.project.opening.opening import open_capture_of
from app.project.project_facts import ClipFacts, read_facts
from engine.capture.formats.imported import finished_word
from engine.errors import CaptureError, ProjectError
from engine.text import rate_text

SCHEMA = 1
_MB = 1e6


def describe_project(folder: Path) -> dict[str, Any]:
    """Bytes of a project's trained clips as plain data.

    Returns:
        schema; kind "project"; path; capture; is_imported, whether another program made its clips; fps (None when the
        capture is not there); clips, each with clip_index,
        role, start, n_frames, components (name to bytes), n_bytes and coverage (moving things and the share with an
        anchor near, see engine.clip_files.clip_header.Coverage; None where not known); damaged, files of
        clips that cannot be read, each with path and reason; components and n_bytes of all clips;
        reference_bytes and reference_share, of the clip that others inherit from; bytes_per_frame and mb_per_minute,
        of all others: what video costs once the reference is there. None where there are none, or where the frame
        rate is not known.
    Raises:
        ProjectError: It is not a project, nothing is trained yet, or none of what is trained can be read.
    """
    facts = read_facts(folder, folder.name, leave_out_damaged=True)
    try:
        fps = float(open_capture_of(facts.settings, folder).fps)
    except (CaptureError, ProjectError):  # bytes can be counted without it
        fps = None
    is_alone = facts.settings.config().independent
    repeated = [clip for clip in facts.clips if is_alone or clip.role != "reference"]
    n_reference_bytes = facts.n_bytes - _n_bytes(repeated)
    per_frame = _n_bytes(repeated) / sum(clip.n_frames for clip in repeated) if repeated else None
    return {
        "schema": SCHEMA,
        "kind": "project",
        "path": str(folder),
        "capture": facts.settings.capture,
        "is_imported": facts.clips[0].is_imported,
        "fps": fps,
        "clips": [
            {
                "clip_index": clip.clip_index,
                "role": clip.role,
                "start": clip.start,
                "n_frames": clip.n_frames,
                "components": clip.storage,
                "n_bytes": sum(clip.storage.values()),
                "coverage": None if clip.coverage is None else asdict(clip.coverage),
            }
            for clip in facts.clips
        ],
        "damaged": [{"path": str(clip.path), "reason": clip.reason} for clip in facts.damaged],
        "components": {name: sum(clip.storage[name] for clip in facts.clips) for name in COMPONENT_NAMES},
        "n_bytes": facts.n_bytes,
        "reference_bytes": n_reference_bytes,
        "reference_share": n_reference_bytes / facts.n_bytes,
        "bytes_per_frame": per_frame,
        "mb_per_minute": None if per_frame is None or fps is None else per_frame * fps * 60 / _MB,
    }


def project_lines(found: dict[str, Any]) -> list[str]:
    """The same as text: a line of sums, then one column per clip and one row per component, in kilobytes."""
    clips = found["clips"]
    n_frames = sum(clip["n_frames"] for clip in clips)
    word = finished_word(has_pictures=not found["is_imported"])
    line = f"{found['path']}: {len(clips)} {word} clips, {n_frames} frames, {found['n_bytes'] / _MB:.2f} MB"
    if found["reference_bytes"]:
        line += f", of which {100 * found['reference_share']:.0f} % are the reference clip"
    lines = [line]
    heads = ["kB", *(f"{clip['role']} {clip['clip_index']}" for clip in clips), "all"]
    columns = [*(clip["components"] for clip in clips), found["components"]]
    rows = [
        [name, *(f"{column[name] / 1e3:.1f}" for column in columns)]
        for name in COMPONENT_NAMES
        if found["components"][name]
    ]
    rows.append(["sum", *(f"{sum(column.values()) / 1e3:.1f}" for column in columns)])
    widths = [max(len(row[i]) for row in (heads, *rows)) for i in range(len(heads))]
    for row in (heads, *rows):
        cells = [row[0].ljust(widths[0]), *(cell.rjust(width) for cell, width in zip(row[1:], widths[1:], strict=True))]
        lines.append("  " + "  ".join(cells))
    lines += [f"Damaged, and not counted ({clip['reason']}): {clip['path']}" for clip in found["damaged"]]
    covered = [f"clip {clip['clip_index']} {_covered(clip['coverage'])}" for clip in clips if clip["coverage"]]
    if covered:
        lines.append(f"Moving points within reach of an anchor: {'; '.join(covered)}.")
    if found["bytes_per_frame"] is not None:
        which = "Clips after the reference" if found["reference_bytes"] else "Clips"
        line = f"{which} take {found['bytes_per_frame'] / 1e3:.1f} kB per frame"
        if found["mb_per_minute"] is None:
            lines.append(f"{line}; the capture is missing, so its frame rate is unknown.")
        else:
            lines.append(
                f"{line}: {found['mb_per_minute']:.1f} MB per minute at {rate_text(found['fps'])} frames per second."
            )
    return lines


def _covered(coverage: dict[str, Any]) -> str:
    said = f"{100 * coverage['share']:.1f} % with {coverage['n_residual']:,} residual anchors"
    if coverage["n_left_out"]:
        said += f", {coverage['n_left_out']:,} points beyond the budget left to their neighbours"
    return said


def _n_bytes(clips: list[ClipFacts]) -> int:
    return sum(sum(clip.storage.values()) for clip in clips)
