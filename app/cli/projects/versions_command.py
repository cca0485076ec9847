"""clipgstream versions: earlier results of clips that were trained again, and the room that they take on the disk."""

from __future__ import annotations

import argparse
from datetime import datetime
from typing import Any

from app.cli.arguments import EXIT_OK, path_argument
from app.project.clips.clip_versions import ClipVersion, list_versions, restore_version, why_not
from app.project.disk.room import WHAT, make_room, room_of
from app.project.disk.use import DiskUse, disk_use
from app.project.opening.opening import open_capture_of
from app.project.opening.project_access import open_project
from app.project.project import Project
from app.psnr_words import psnr_words
from app.training.service import Launch
from engine.errors import ProjectError
from engine.storage.json_files import json_text
from engine.text import size_text

SCHEMA = 1


def add_arguments(command: argparse.ArgumentParser) -> None:
    """Arguments of `clipgstream versions`."""
    command.add_argument("project", type=path_argument, help="project folder")
    command.add_argument("--clip", type=int, metavar="N", help="only this clip")
    command.add_argument(
        "--restore", type=int, metavar="V", help="restore this version of --clip; the present clip becomes a version"
    )
    command.add_argument(
        "--free",
        choices=tuple(WHAT),
        help="delete for good: " + "; ".join(f"{name}: {words}" for name, words in WHAT.items()),
    )
    command.add_argument("--dry-run", action="store_true", help="with --free: only show what would be deleted")
    command.add_argument("--json", action="store_true", help="print everything as JSON")


def run(options: argparse.Namespace, launch: Launch) -> int:
    """Bring back or delete the requested versions, then list all. Returns the exit code."""
    if options.restore is not None and options.clip is None:
        raise ProjectError("--restore needs --clip.", hint="Say which clip's version it is.")
    is_change = options.restore is not None or (options.free is not None and not options.dry_run)
    project = open_project(options.project, is_writable=is_change)
    try:
        n_clips = count_clips(project)
        if options.clip is not None and not 0 <= options.clip < n_clips:
            raise ProjectError(f"There is no clip {options.clip}; clips are 0 to {n_clips - 1}.")
        if options.restore is not None and options.clip is not None:
            restore_version(project, options.clip, options.restore)
        room, freed = None, 0
        if options.free is not None:
            room = room_of(project, n_clips, options.free, options.clip)
            freed = 0 if options.dry_run else make_room(project, room)
        found = describe_versions(project, n_clips, options.clip)
    finally:
        project.close()
    if room is not None:
        found |= {"n_bytes_asked_for": room.n_bytes, "n_bytes_freed": freed}
    print(json_text(found, indent=2) if options.json else "\n".join(version_lines(found)))
    return EXIT_OK


def count_clips(project: Project) -> int:
    """How many clips a project has; asks the capture where the project does not say.

    Raises:
        CaptureError, ProjectError: The capture is gone or is another one.
    """
    settings = project.settings
    if settings.clip_bounds is not None:
        return len(settings.clip_bounds) - 1
    capture = open_capture_of(settings, project.folder)
    try:
        return len(project.clips(capture.n_frames))
    finally:
        capture.close()


def describe_versions(project: Project, n_clips: int, clip_index: int | None = None) -> dict[str, Any]:
    """Versions and room as plain data.

    Args:
        clip_index: Only of this clip; None for all.
    Returns:
        schema; path; clips, each with clip_index, state ("trained", "damaged" or "untrained"), n_bytes, versions
        (number, trained, step, held_out_psnr, held_out_whole, n_bytes, damage, why_not); disk: bytes of clips,
        versions, checkpoints, preparation, unused (see app.project.disk.use), other and total.
    """
    use = disk_use(project, n_clips)
    chosen = range(n_clips) if clip_index is None else (clip_index,)
    return {
        "schema": SCHEMA,
        "path": str(project.folder),
        "clips": [_describe_clip(project, index, use) for index in chosen],
        "disk": {
            "clips": sum(clip.clip for clip in use.clips),
            "versions": use.versions,
            "checkpoints": sum(clip.checkpoint for clip in use.clips),
            "preparation": use.preparation,
            "unused": use.unused,
            "other": use.other,
            "total": use.total,
        },
    }


def _describe_clip(project: Project, clip_index: int, use: DiskUse) -> dict[str, Any]:
    found = project.headers.read(project.clip_path(clip_index))
    return {
        "clip_index": clip_index,
        "state": "untrained" if found is None else "damaged" if found.header is None else "trained",
        "damage": "" if found is None else found.damage,
        "n_bytes": use.clips[clip_index].clip,
        "versions": [_describe_version(project, clip_index, one) for one in list_versions(project, clip_index)],
    }


def _describe_version(project: Project, clip_index: int, version: ClipVersion) -> dict[str, Any]:
    header = version.header
    return {
        "number": version.number,
        "trained": datetime.fromtimestamp(version.trained_s).astimezone().isoformat(timespec="seconds"),
        "step": None if header is None else header.step,
        "held_out_psnr": None if header is None else header.figures.held_out_psnr,
        "held_out_whole": header is not None and header.figures.held_out_whole,
        "n_bytes": version.n_bytes,
        "damage": version.damage,
        "why_not": version.damage if header is None else why_not(project, clip_index, header),
    }


def version_lines(found: dict[str, Any]) -> list[str]:
    """The same as text."""
    lines = []
    if "n_bytes_freed" in found:
        asked, freed = found["n_bytes_asked_for"], found["n_bytes_freed"]
        lines.append(f"Freed {_megabytes(freed)}." if freed or not asked else f"This would free {_megabytes(asked)}.")
    disk = found["disk"]
    parts = ", ".join(f"{name} {_megabytes(n)}" for name, n in disk.items() if n and name != "total")
    lines.append(f"{found['path']}: {_megabytes(disk['total'])}{f' ({parts})' if parts else ''}")
    for clip in found["clips"]:
        state = "" if clip["state"] == "trained" else f", {clip['state']}"
        lines.append(
            f"clip {clip['clip_index']}{state}: {_megabytes(clip['n_bytes'])}, {_count(len(clip['versions']))}"
        )
        lines += [f"  {clip['damage']}"] if clip["damage"] else []
        for version in clip["versions"]:
            psnr = version["held_out_psnr"]
            psnr = "" if psnr is None else f", {psnr_words(psnr, is_whole=version['held_out_whole'])}"
            steps = "" if version["step"] is None else f", {version['step']} steps"
            why = f"; cannot be restored: {version['why_not']}" if version["why_not"] else ""
            size = _megabytes(version["n_bytes"])
            lines.append(f"  version {version['number']}: trained {version['trained']}{steps}{psnr}, {size}{why}")
    return lines


def _count(n: int) -> str:
    return {0: "no earlier versions", 1: "1 earlier version"}.get(n, f"{n} earlier versions")


def _megabytes(n_bytes: int) -> str:
    return size_text(n_bytes / 1e6)
