"""The place and the names of projects that are made without a place of their own."""

from __future__ import annotations

import os
import re
from pathlib import Path

from engine.capture.capture import Capture
from engine.user_folders import data_dir

VARIABLE = "CLIPGSTREAM_PROJECTS"
"""Names the folder for everything that is started with it; stands above the preference."""
_FINGERPRINT_AND_NUMBER = re.compile(r"-[0-9a-f]{16}(?:-(\d+))?")


def projects_dir(chosen: str = "") -> Path:
    """The folder of all such projects; need not exist. chosen: The user's preference; empty for none."""
    folder = os.environ.get(VARIABLE, "").strip() or chosen.strip()
    if not folder:
        return data_dir() / "projects"
    try:
        return Path(folder).expanduser().absolute()
    except RuntimeError:  # "~somebody" whom nobody knows
        return Path(folder).absolute()


def usual_project_dir(capture: Capture, folder: Path) -> Path:
    """The first project of a capture in a folder of projects."""
    return folder / f"{Path(capture.path).resolve().name}-{capture.fingerprint}"


def new_project_dir(capture: Capture, folder: Path) -> Path:
    """A folder for a new project of a capture: the usual one, or that with a number where it is taken."""
    usual = usual_project_dir(capture, folder)
    number = 2
    free = usual
    while free.exists() and any(child.name != "lock" for child in free.iterdir()):
        free = usual.with_name(f"{usual.name}-{number}")
        number += 1
    return free


def project_name(folder: Path, capture: Path | str) -> str:
    """A project's name: that of its folder, or where the program has named that, that of its capture and the number."""
    name = Path(capture).name
    found = _FINGERPRINT_AND_NUMBER.fullmatch(folder.name.removeprefix(name)) if folder.name.startswith(name) else None
    if found is None:
        return folder.name
    return name if found[1] is None else f"{name} {found[1]}"
