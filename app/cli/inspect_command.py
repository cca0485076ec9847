"""clipgstream inspect: a capture, or what the trained clips of a project weigh, as text or JSON."""

from __future__ import annotations

import argparse

from app.background.kernels import use_threads
from app.cli.arguments import EXIT_OK, add_follow_links, path_argument
from app.training.service import Launch
from engine.capture.capture import FORMATS, open_capture
from engine.storage.json_files import json_text
from engine.text import printable

LAYOUTS = {reader.FORMAT: reader.LAYOUT for reader in FORMATS}


def add_arguments(command: argparse.ArgumentParser) -> None:
    """Arguments of `clipgstream inspect`."""
    command.add_argument("path", type=path_argument, help="capture or project folder")
    command.add_argument("--json", action="store_true", help="print everything as JSON")
    add_follow_links(command)


def run(options: argparse.Namespace, launch: Launch) -> int:
    """clipgstream inspect: describe a capture or a project. Returns the exit code."""
    from app.project.project import is_project
    from app.project.project_summary import describe_project, project_lines

    if not is_project(options.path):
        return _inspect_capture(options)
    found = describe_project(options.path)
    print(json_text(found, indent=2) if options.json else "\n".join(project_lines(found)))
    return EXIT_OK


def _inspect_capture(options: argparse.Namespace) -> int:
    """What a capture is, and how the exposure of its cameras changes."""
    capture = open_capture(options.path, follow_links=options.follow_links)
    use_threads(None)
    from app.cli.exposure_lines import exposure_document, exposure_lines
    from engine.capture.capture_summary import describe
    from engine.cloud.background.exposure_survey import survey_exposure

    found, survey = describe(capture), survey_exposure(capture)
    capture.close()
    if options.json:
        print(json_text(found | {"exposure": exposure_document(survey)}, indent=2))
        return EXIT_OK
    print(
        f"{printable(found['path'])}: {found['n_cameras']} cameras, {found['n_frames']} frames at {found['fps']:g} per "
        f"second ({found['duration_s']:.1f} s); {LAYOUTS[found['format']]}"
    )
    for camera in found["cameras"]:
        held_out = "  suggested as hold-out" if camera["is_default_holdout"] else ""
        print(
            f"  {camera['name']:>8}  {camera['width']}x{camera['height']}  view {camera['fov_x_deg']:.0f} x "
            f"{camera['fov_y_deg']:.0f} degrees{held_out}"
        )
    print(f"The cameras are up to {found['rig_extent']:.3g} scene units apart.")
    for line in exposure_lines(survey):
        print(line)
    for warning in found["warnings"]:
        print(f"Note: {warning}")
    return EXIT_OK
