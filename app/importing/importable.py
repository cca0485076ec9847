"""Which paths are scenes of other programs, and where the window keeps the projects that it makes of them."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

from app.background.jobs import JobContext
from app.importing.import_scene import import_scene
from app.project.opening.project_access import is_project
from engine.capture.formats.table import is_capture
from engine.importing.scene_source import is_scene


def is_importable(path: Path) -> bool:
    """Whether a path is neither a project nor a capture, but a scene that can be imported."""
    try:
        return is_scene(path) and not (path.is_dir() and (is_project(path) or is_capture(path)))
    except OSError:
        return False


def imported_dir(path: Path, projects: Path) -> Path:
    """The project of a scene in a folder of projects: another one once its files have changed.

    Raises:
        OSError: The scene cannot be looked at.
    """
    key = hashlib.sha256(os.fsencode(path.resolve()))
    names = sorted(path.iterdir()) if path.is_dir() else [path]
    for one in names:
        found = one.lstat()
        key.update(f"{one.name} {found.st_size} {found.st_mtime_ns}".encode("utf-8", "surrogateescape"))
    return projects / f"{path.resolve().name}-{key.hexdigest()[:16]}"


def project_of_scene(path: Path, folder: Path, context: JobContext) -> Path:
    """The project of a scene in a folder, which is made unless it is there. On a job's thread; raises as
    `import_scene` does."""

    def report(n_done: int, n: int) -> None:
        context.report(n_done / n, f"{n_done} of {n} frames")

    if not is_project(folder):
        import_scene(path, folder, report=report)
    return folder
