"""Laps of the window's OpenGL, measured in a separate process: a crashing driver does no other harm, and nothing here
depends on a window. The start of the command line sets the module that draws.
"""

from __future__ import annotations

import json
import logging
import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

from app.evaluation.speed.laps import Lap
from engine.children.process import undisturbed
from engine.own_modules import module_name, python_path

logger = logging.getLogger(__name__)

TIME_LIMIT_S = 120.0
_module = ""


@dataclass(frozen=True, slots=True)
class WindowLaps:
    """The other program's answer: laps and their renderer, or why there are none."""

    laps: list[Lap]
    renderer: str
    reason: str = ""


def draw_with(module: str) -> None:
    """From now on laps are drawn by `python -m MODULE PROJECT`, which prints one line: `said_by` of a Drawn."""
    global _module
    _module = module


def drawn_laps(project_folder: Path) -> WindowLaps:
    """Render frames of a project as the window does. Never raises for want of a display or a driver."""
    if not _module:
        return _none("this program has no window")
    command = [sys.executable, "-P", "-m", module_name(_module), str(project_folder)]
    try:
        with undisturbed():
            child = subprocess.Popen(
                command,
                env={**os.environ, "PYTHONPATH": python_path()},
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                text=True,
            )
        with child:
            try:
                out, err = child.communicate(timeout=TIME_LIMIT_S)
            except BaseException:
                child.kill()
                raise
    except subprocess.TimeoutExpired:
        return _none(f"drawing took more than {TIME_LIMIT_S:.0f} s")
    except OSError as error:
        return _none(f"the program that draws could not be started ({error.strerror or error})")
    if child.returncode:
        logger.warning("drawing ended with code %s: %s", child.returncode, err.strip()[-2000:])
        return _none(f"the program that draws ended with code {child.returncode}")
    return read_said(out)


def said_by(drawn: WindowLaps) -> str:
    """The line that the other program prints."""
    return json.dumps({"laps": drawn.laps, "renderer": drawn.renderer, "reason": drawn.reason})


def read_said(text: str) -> WindowLaps:
    """A program's answer: its last line, as drivers print too."""
    try:
        said = json.loads(text.strip().splitlines()[-1])
        laps = [Lap(float(decode), float(draw), int(n)) for decode, draw, n in said["laps"]]
        return WindowLaps(laps, str(said["renderer"]), str(said["reason"]))
    except (IndexError, KeyError, TypeError, ValueError):
        logger.warning("drawing sent %r", text[-500:])
        return _none("the program that draws sent nothing readable")


def _none(reason: str) -> WindowLaps:
    return WindowLaps([], "", reason)
