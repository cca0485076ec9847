"""clipgstream clips: the clips of a project; splits and merges them, and chooses the one that others inherit from."""

from __future__ import annotations

import argparse
from dataclasses import replace
from typing import Any

from app.cli.arguments import EXIT_OK, path_argument
from app.document.changes.clip_changes import with_merge, with_reference, with_split
from app.project.clips.clip_catalog import ClipCatalog
from app.project.opening.opening import open_capture_of
from app.project.opening.project_access import open_project
from app.project.project import Project
from app.psnr_words import psnr_words
from app.residuals.kept_reading import note_kept
from app.training.service import Launch
from engine.capture.capture import Capture
from engine.capture.formats.imported import finished_word
from engine.storage.json_files import json_text

SCHEMA = 1


def add_arguments(command: argparse.ArgumentParser) -> None:
    """Arguments of `clipgstream clips`."""
    command.add_argument("project", type=path_argument, help="project folder")
    command.add_argument(
        "--split", type=int, metavar="FRAME", action="append", default=[], help="let a clip begin at this frame"
    )
    command.add_argument("--merge", type=int, metavar="N", help="merge clip N with the next one, after --split")
    command.add_argument("--reference", type=int, metavar="N", help="make clip N the reference clip")
    command.add_argument("--dry-run", action="store_true", help="only show what would happen to the clips")
    command.add_argument("--json", action="store_true", help="print everything as JSON")


def run(options: argparse.Namespace, launch: Launch) -> int:
    """Make the requested changes, then list the clips. Returns the exit code."""
    is_change = bool(options.split) or options.merge is not None or options.reference is not None
    project = open_project(options.project, is_writable=is_change and not options.dry_run)
    try:
        capture = open_capture_of(project.settings, project.folder)
        try:
            if is_change:
                capture.check_pictures()
            _change(project, capture.n_frames, options)
            found = describe_clips(project, capture)
        finally:
            capture.close()
    finally:
        project.close()
    word = finished_word(has_pictures=capture.has_pictures)
    print(json_text(found, indent=2) if options.json else "\n".join(clip_lines(found, word)))
    return EXIT_OK


def _change(project: Project, n_frames: int, options: argparse.Namespace) -> None:
    document = project.document
    for frame_index in options.split:
        document = with_split(document, frame_index, n_frames)
    if options.merge is not None:
        document = with_merge(document, options.merge, n_frames)
    if options.reference is not None:
        document = with_reference(document, options.reference, n_frames)
    if document == project.document:
        return
    if options.dry_run:
        project.history = replace(project.history, present=document)  # the report describes this state
    else:
        project.change(document, "change the clips")


def describe_clips(project: Project, capture: Capture) -> dict[str, Any]:
    """Clips as plain data.

    Args:
        capture: Of the project.
    Returns:
        schema; path; clip_length; reference_clip; clips, each with clip_index, start, stop, file (its name in the
        folder "clips"), state, reason, held_out_psnr and held_out_whole.
    """
    clips = project.clips(capture.n_frames)
    catalog = ClipCatalog(project, len(clips))
    note_kept(catalog, project, capture)
    return {
        "schema": SCHEMA,
        "path": str(project.folder),
        "clip_length": project.settings.clip_length,
        "reference_clip": project.settings.reference_clip,
        "clips": [
            {
                "clip_index": clip.clip_index,
                "start": clip.start,
                "stop": clip.stop,
                "file": project.clip_path(clip.clip_index).name,
                "state": catalog[clip.clip_index].state,
                "reason": catalog[clip.clip_index].reason,
                "held_out_psnr": catalog[clip.clip_index].held_out_psnr,
                "held_out_whole": catalog[clip.clip_index].held_out_whole,
            }
            for clip in clips
        ],
    }


def clip_lines(found: dict[str, Any], word: str) -> list[str]:
    """The same as text. word: For clips that are finished."""
    lines = [f"{found['path']}: {len(found['clips'])} clips, usually {found['clip_length']} frames each"]
    for clip in found["clips"]:
        reference = ", reference" if clip["clip_index"] == found["reference_clip"] else ""
        psnr = clip["held_out_psnr"]
        psnr = "" if psnr is None else f", {psnr_words(psnr, is_whole=clip['held_out_whole'])}"
        state = word if clip["state"] == "trained" else clip["state"]
        reason = f". {clip['reason']}" if clip["reason"] else ""
        frames = f"frames {clip['start']} to {clip['stop'] - 1}"
        lines.append(f"clip {clip['clip_index']}{reference}: {frames}, {state}{psnr}{reason}")
    return lines
