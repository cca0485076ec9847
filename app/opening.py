"""What opening means: a capture and the project that belongs to it. Runs on a job's thread; changes no state."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from app.jobs import JobContext
from app.project import (
    PROJECT_FILE,
    Project,
    ProjectSettings,
    create_project,
    default_project_dir,
    default_settings,
    is_project,
    open_project,
    read_settings,
)
from engine.capture.capture import Capture, open_capture
from engine.errors import CaptureError, ProjectError

WINDOW_WIDTH_PX = 960
"""Wider captures are worked on at a smaller scale unless one is asked for; training on a CPU goes with the pixels."""


@dataclass(frozen=True, slots=True)
class Opened:
    """A capture, and its project unless that is the one already open.

    Attributes:
        note: Title, detail and hint of something odd, or None.
    """

    capture: Capture
    project: Project | None
    note: tuple[str, str, str] | None = None


def open_for_window(
    path: Path,
    *,
    scale: float | None,
    project_dir: Path | None,
    current: Path | None,
    context: JobContext,
    follow_links: bool = False,
) -> Opened:
    """Open a capture folder or a project folder.

    Args:
        path: A capture folder, or a project folder.
        scale: Working size; None picks one.
        project_dir: Where the capture's project goes; None for the user's data folder.
        current: Project folder that this program has open already.
        context: Receives progress.
        follow_links: Whether the user allows the capture's files to lie outside of its folder; noted in the project.
    Raises:
        CaptureError, ProjectError: It cannot be opened.
    """
    context.report(0.0, path.name)
    if is_project(path):
        return _open_project(path, current, follow_links=follow_links)
    capture = open_capture(path, scale=1.0 if scale is None else scale, follow_links=follow_links)
    widest = int(capture.rig.image_sizes[:, 0].max())
    if scale is None and widest > WINDOW_WIDTH_PX:
        capture = open_capture(path, scale=WINDOW_WIDTH_PX / widest, follow_links=follow_links)
    context.report(0.7, f"{len(capture.rig)} cameras, {capture.n_frames} frames")
    folder = default_project_dir(capture) if project_dir is None else project_dir
    if (folder / PROJECT_FILE).is_file():
        return _open_project(folder, current, capture if scale is None else None, follow_links=follow_links)
    return Opened(capture, create_project(folder, default_settings(capture)))


def _open_project(
    folder: Path, current: Path | None, capture: Capture | None = None, *, follow_links: bool = False
) -> Opened:
    stored = read_settings(folder)
    settings = replace(stored, follow_links=stored.follow_links or follow_links)
    if capture is None:
        capture = open_capture_of(settings, folder)
    else:
        capture = (
            capture
            if capture.scale == settings.scale
            else open_capture(capture.path, scale=settings.scale, follow_links=settings.follow_links)
        )
        check_capture(capture, settings, folder)
    if current is not None and current.resolve() == folder.resolve():
        return Opened(capture, None)
    try:
        project = open_project(folder)
        place = str(Path(capture.path).resolve())
        settings = replace(settings, capture=place)
        if settings != stored:  # it has moved since, or may follow links; workers open it as the project says
            project.update(settings)
        return Opened(capture, project)
    except ProjectError as error:  # most likely locked; looking at it does no harm
        note = ("The project is open for reading only", str(error), "Training is off until it is closed there.")
        return Opened(capture, open_project(folder, is_writable=False), note)


def open_capture_of(settings: ProjectSettings, folder: Path) -> Capture:
    """Open the capture of the project in this folder.

    Raises:
        CaptureError: It is gone or damaged.
        ProjectError: Another one lies in its place.
    """
    if not Path(settings.capture).is_dir():
        raise CaptureError(
            "The capture of this project is no longer where it was.",
            hint=f"Put it back, or say where it is: clipgstream train NEW_PLACE --project {folder}",
            path=settings.capture,
        )
    capture = open_capture(settings.capture, scale=settings.scale, follow_links=settings.follow_links)
    check_capture(capture, settings, folder)
    return capture


def check_capture(capture: Capture, settings: ProjectSettings, folder: Path) -> None:
    """See that the capture is the one the project was made for.

    Raises:
        ProjectError: It is another one.
    """
    if capture.fingerprint != settings.fingerprint:
        raise ProjectError(
            f"The capture in {capture.path} is not the one this project was made for.",
            hint="Put the original capture back, or make a new project.",
            path=folder,
        )
