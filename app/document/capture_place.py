"""Where the capture of a project lies, as stored in its files: relative to the project folder where both lie together.

A capture in the folder that holds the project folder, or in the project folder itself, is written as a path that
begins with "./" or "../", so that the folder with both can be moved; any other as an absolute path.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from app.document.project_document import ProjectDocument


def stored_place(capture: str, folder: Path) -> str:
    """A capture's folder as stored in the files of a project. folder: Of the project."""
    home = folder.resolve()
    if not Path(capture).is_absolute() or not Path(capture).is_relative_to(home.parent):
        return capture
    way = Path(os.path.relpath(capture, home)).as_posix()
    return way if way.startswith("../") else f"{way}/" if way == ".." else f"./{way}"


def found_place(stored: str, folder: Path) -> str:
    """Inverse of `stored_place`, wherever the project folder lies by now."""
    if not stored.startswith(("./", "../")):
        return stored
    return os.path.normpath(folder.resolve() / stored)


def with_capture(document: ProjectDocument, place: Callable[[str], str]) -> ProjectDocument:
    """A document whose capture lies where `place` says, given where it lay; the same object where that is the same."""
    found = place(document.settings.capture)
    if found == document.settings.capture:
        return document
    return replace(document, settings=replace(document.settings, capture=found))
