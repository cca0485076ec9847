"""clipgstream inspect: a capture with the findings of the capture doctor, or what the trained clips of a project weigh,
as text or JSON; and corrections of a capture.
"""

from __future__ import annotations

import argparse
import sys
from typing import Any

from app.background.kernels import use_threads
from app.cli.arguments import EXIT_OK, add_follow_links, path_argument
from app.cli.captures.correction_arguments import (
    add_correction_arguments,
    asked_corrections,
    sure_corrections,
    write_asked,
)
from app.cli.terminal.progress import ProgressLine
from app.training.service import Launch
from engine.capture.capture import ONE_PASS_CACHE_BYTES, Capture, open_capture
from engine.storage.json_files import json_text
from engine.text import printable


def add_arguments(command: argparse.ArgumentParser) -> None:
    """Arguments of `clipgstream inspect`."""
    command.add_argument("path", type=path_argument, help="capture or project folder")
    command.add_argument("--json", action="store_true", help="print everything as JSON")
    command.add_argument("--quick", action="store_true", help="do not look at pixels; takes only a moment")
    add_follow_links(command)
    add_correction_arguments(command)


def run(options: argparse.Namespace, launch: Launch) -> int:
    """clipgstream inspect: describe a capture or a project, or correct a capture. Returns the exit code."""
    from app.project.opening.project_access import is_project
    from app.project.project_summary import describe_project, project_lines

    if not is_project(options.path):
        return _inspect_capture(options)
    found = describe_project(options.path)
    print(json_text(found, indent=2) if options.json else "\n".join(project_lines(found)))
    return EXIT_OK


def _inspect_capture(options: argparse.Namespace) -> int:
    """Describe a capture and its faults, or write corrections."""
    capture = open_capture(
        options.path,
        follow_links=options.follow_links,
        cache_bytes=ONE_PASS_CACHE_BYTES,
        is_shape_asked=options.fit is not None,
    )
    try:
        corrections = asked_corrections(options)
        if corrections is not None:
            return _say_written(options, write_asked(capture, corrections, options.out))
        return _describe(options, capture)
    finally:
        capture.close()


def _describe(options: argparse.Namespace, capture: Capture) -> int:
    from app.project.opening.capture_report import report_of
    from engine.capture.capture_summary import describe

    if not options.json:
        print(report_of(capture).text, flush=True)
    more = _quick(options, capture) if options.quick else _doctor(options, capture)
    if options.json:
        print(json_text(describe(capture) | more, indent=2))
    return EXIT_OK


def _quick(options: argparse.Namespace, capture: Capture) -> dict[str, Any]:
    from app.cli.captures.finding_lines import finding_document, finding_lines
    from engine.doctor.quick import quick_findings

    findings = quick_findings(capture)
    if not options.json:
        print("\n".join(finding_lines(findings, path=str(options.path)) or ["No problems found so far."]))
    return {"doctor": {"findings": [finding_document(finding) for finding in findings]}}


def _doctor(options: argparse.Namespace, capture: Capture) -> dict[str, Any]:
    use_threads(None, with_torch=False)
    from app.cli.captures.exposure_lines import exposure_document, exposure_lines
    from app.cli.captures.finding_lines import diagnosis_document, diagnosis_lines
    from engine.doctor.doctor import examine
    from engine.doctor.memory import memory_bytes

    line = ProgressLine()
    print(f"The doctor uses up to about {memory_bytes(capture) / 2**30:.1f} GB of memory.", file=sys.stderr, flush=True)
    diagnosis = examine(capture, report=lambda progress: line.update(progress.stage, progress.done, progress.message))
    line.finish()
    if not options.json:
        lines = exposure_lines(diagnosis.exposure)
        print("\n".join([*lines, *diagnosis_lines(diagnosis, capture.rig.names, path=str(options.path))]))
    if options.apply:
        corrections = sure_corrections(diagnosis.findings)
        if corrections is None:
            if not options.json:
                print("No problem is certain enough to be corrected.")
        else:
            _say_written(options, write_asked(capture, corrections, options.out))
    exposure = exposure_document(diagnosis.exposure)
    return {"exposure": exposure, "doctor": diagnosis_document(diagnosis, capture.rig.names)}


def _say_written(options: argparse.Namespace, path: object) -> int:
    if not options.json:
        print(printable(f"Written: {path}"))
        print("Existing projects of this capture no longer match it; train a new one.")
    return EXIT_OK
