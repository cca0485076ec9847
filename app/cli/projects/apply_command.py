"""clipgstream apply: anchors that edits delete are taken out of the clips for good."""

from __future__ import annotations

import argparse

from app.cli.arguments import EXIT_OK, path_argument
from app.cli.terminal.progress import ProgressLine
from app.project.opening.opening import open_capture_of
from app.project.opening.project_access import open_project
from app.training.service import Launch
from engine.storage.json_files import json_text

APPLY_SCHEMA = 1


def add_arguments(command: argparse.ArgumentParser) -> None:
    """Arguments of `clipgstream apply`."""
    command.add_argument("project", type=path_argument, help="project folder")
    command.add_argument("--dry-run", action="store_true", help="only show what would be removed")
    command.add_argument("--json", action="store_true", help="print what was done as JSON on standard output")
    command.add_argument("--quiet", action="store_true", help="show no progress")


def run(options: argparse.Namespace, launch: Launch) -> int:
    """clipgstream apply: write clips again without deleted anchors. Returns the exit code."""
    from app.applying.applying import apply_permanently
    from app.applying.deletions import find_deletions

    line = ProgressLine(is_quiet=options.quiet)

    def report(n_done: int, n_all: int) -> None:
        line.update("Reading clips", n_done / max(n_all, 1), f"{n_done}/{n_all}")

    project = open_project(options.project, is_writable=not options.dry_run)
    try:
        capture = open_capture_of(project.settings, project.folder)
        clips = project.clips(capture.n_frames)
        capture.close()
        if options.dry_run:
            found = find_deletions(project, clips, report)
            indices = [clip_index for clip_index, clip in found.clips.items() if clip.n_anchors]
            said, n_anchors, kept = f"{found.n_anchors:,} anchors can be removed.", found.n_anchors, None
        else:
            done = apply_permanently(project, clips, report)
            said, n_anchors, indices = done.text(), done.n_anchors, list(done.clip_indices)
            kept = [edit.edit_id for edit in done.kept]
    finally:
        project.close()
    line.finish()
    line.say(said)
    if options.json:
        content = {"schema": APPLY_SCHEMA, "n_anchors": n_anchors, "clips": indices, "kept_edits": kept}
        print(json_text(content, indent=1))
    return EXIT_OK
