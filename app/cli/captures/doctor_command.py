"""clipgstream doctor: findings about this machine, as text or JSON."""

from __future__ import annotations

import argparse

from app.cli.arguments import EXIT_OK
from app.training.service import Launch
from engine.storage.json_files import json_text


def add_arguments(command: argparse.ArgumentParser) -> None:
    """Arguments of `clipgstream doctor`."""
    command.add_argument("--json", action="store_true", help="print the findings as JSON")


def run(options: argparse.Namespace, launch: Launch) -> int:
    """clipgstream doctor: look at this machine. Returns the exit code."""
    from app.cli.doctor import examine

    findings = examine()
    if options.json:
        rows = [{"subject": f.subject, "text": f.text, "is_fine": f.is_fine} for f in findings]
        print(json_text({"schema": 1, "findings": rows}, indent=2))
    else:
        for finding in findings:
            print(f"{'ok ' if finding.is_fine else '!! '} {finding.subject:<9} {finding.text}")
    return EXIT_OK
