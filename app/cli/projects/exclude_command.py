"""clipgstream exclude: cameras and pictures that training never sees, in addition to held-out cameras."""

from __future__ import annotations

import argparse
from typing import Any

from app.cli.arguments import EXIT_OK, parse_cameras, parse_range, path_argument
from app.document.changes.exclusion_changes import (
    with_cameras_excluded,
    with_frames_excluded,
    without_exclusions,
    without_masks,
)
from app.document.project_document import ProjectDocument
from app.project.opening.opening import open_capture_of
from app.project.opening.project_access import open_project
from app.training.service import Launch
from engine.capture.capture import Capture
from engine.storage.json_files import json_text

SCHEMA = 1


def add_arguments(command: argparse.ArgumentParser) -> None:
    """Arguments of `clipgstream exclude`."""
    command.add_argument("project", type=path_argument, help="project folder")
    command.add_argument("--cameras", metavar="NAMES", help="cameras, separated by commas; without --frames altogether")
    command.add_argument(
        "--frames", metavar="A:B", help="frames A up to B, B not included, of --cameras or of all cameras"
    )
    command.add_argument("--include", action="store_true", help="include them again")
    command.add_argument("--forget-masks", action="store_true", help="remove the masks painted in the window")
    command.add_argument("--forget", action="store_true", help="include everything again, before the rest")
    command.add_argument("--json", action="store_true", help="print everything as JSON")


def run(options: argparse.Namespace, launch: Launch) -> int:
    """Make the requested changes, then list the exclusions. Returns the exit code."""
    is_change = bool(options.cameras or options.frames or options.forget or options.forget_masks)
    project = open_project(options.project, is_writable=is_change)
    try:
        if is_change:
            capture = open_capture_of(project.settings, project.folder)
            try:
                document = _changed(project.document, options, capture)
            finally:
                capture.close()
            if document != project.document:
                project.change(document, "exclude from training")
        found = describe_exclusions(project.document)
    finally:
        project.close()
    print(json_text(found, indent=2) if options.json else "\n".join(exclusion_lines(found)))
    return EXIT_OK


def _changed(document: ProjectDocument, options: argparse.Namespace, capture: Capture) -> ProjectDocument:
    document = without_exclusions(document) if options.forget else document
    document = without_masks(document) if options.forget_masks else document
    names, is_excluded = capture.rig.names, not options.include
    cameras = parse_cameras(options.cameras, capture) if options.cameras else ()
    if options.frames:
        frames = parse_range(options.frames, capture.n_frames, option="--frames", what="frames")
        for camera in cameras or (None,):
            document = with_frames_excluded(
                document,
                frames.start,
                frames.stop,
                camera=camera,
                camera_names=names,
                n_frames=capture.n_frames,
                is_excluded=is_excluded,
            )
        return document
    return with_cameras_excluded(document, cameras, names, is_excluded=is_excluded) if cameras else document


def describe_exclusions(document: ProjectDocument) -> dict[str, Any]:
    """Exclusions as plain data.

    Returns:
        schema; cameras (names); frames, each with camera (null for all), first and stop; masks, each with camera,
        first, stop and n_strokes.
    """
    found = document.exclusions
    return {
        "schema": SCHEMA,
        "cameras": list(found.cameras),
        "frames": [{"camera": one.camera, "first": one.first, "stop": one.stop} for one in found.frames],
        "masks": [
            {"camera": one.camera, "first": one.first, "stop": one.stop, "n_strokes": len(one.strokes)}
            for one in found.masks
        ],
    }


def exclusion_lines(found: dict[str, Any]) -> list[str]:
    """The same as text."""
    lines = [f"cameras: {', '.join(found['cameras'])}"] if found["cameras"] else []
    for one in found["frames"]:
        lines.append(f"frames {one['first']} to {one['stop'] - 1} of {one['camera'] or 'all cameras'}")
    for one in found["masks"]:
        strokes = "1 stroke" if one["n_strokes"] == 1 else f"{one['n_strokes']} strokes"
        lines.append(f"a painted mask of {one['camera']} in frames {one['first']} to {one['stop'] - 1}, {strokes}")
    return lines or ["Nothing is excluded from training."]
