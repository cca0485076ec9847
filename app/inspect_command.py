"""clipgstream inspect: a capture, or what the trained clips of a project weigh, as text or JSON."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from app.arguments import EXIT_OK
from app.training.service import Launch
from engine.capture.capture import open_capture


def add_inspect_arguments(command: argparse.ArgumentParser) -> None:
    """Arguments of `clipgstream inspect`."""
    command.add_argument("path", type=Path, help="capture or project folder")
    command.add_argument("--json", action="store_true", help="print everything as JSON")


def inspect(options: argparse.Namespace, launch: Launch) -> int:
    """clipgstream inspect: describe a capture or a project. Returns the exit code."""
    from app.inspection import describe_project, is_project, project_lines
    from engine.capture.inspect import describe

    is_one = is_project(options.path)
    found = describe_project(options.path) if is_one else describe(open_capture(options.path))
    if options.json:
        print(json.dumps(found, indent=2))
        return EXIT_OK
    if is_one:
        print("\n".join(project_lines(found)))
        return EXIT_OK
    print(
        f"{found['path']}: {found['format']} layout, {found['n_cameras']} cameras, {found['n_frames']} frames at "
        f"{found['fps']:g} per second ({found['duration_s']:.1f} s)"
    )
    for camera in found["cameras"]:
        held_out = "  suggested as hold-out" if camera["is_default_holdout"] else ""
        print(
            f"  {camera['name']:>8}  {camera['width']}x{camera['height']}  view {camera['fov_x_deg']:.0f} x "
            f"{camera['fov_y_deg']:.0f} degrees{held_out}"
        )
    print(f"The cameras are up to {found['rig_extent']:.3g} scene units apart.")
    for warning in found["warnings"]:
        print(f"Note: {warning}")
    return EXIT_OK
