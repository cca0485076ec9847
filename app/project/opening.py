"""What opening means: a capture and the project that belongs to it. Runs on a job's thread; changes no state."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from app.background.jobs import JobContext
from app.project.clip_catalog import ClipCatalog
from app.project.clip_names import finished_files
from app.project.opening_answers import OpeningAnswers, window_scale
from app.project.project import (
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
from app.project.recents import RecentProject, project_name
from engine.capture.capture import Capture, open_capture
from engine.errors import CaptureError, ProjectError


@dataclass(frozen=True, slots=True)
class Opened:
    """A capture and its project, or a choice between its projects.

    Attributes:
        project: None where it is the one already open, or the user has to be asked.
        catalog: What lies on disk of its clips; None without a project.
        choices: The projects to choose from; empty where there is nothing to choose.
        note: Kind, title, detail and hint of something that the user has to know, or None.
        follow_links: Of a choice: whether the user allows the capture's files to lie outside of its folder.
        is_asking: There is no project yet, and the user is to see the capture before one is made.
    """

    capture: Capture
    project: Project | None = None
    catalog: ClipCatalog | None = None
    choices: tuple[RecentProject, ...] = ()
    note: tuple[str, str, str, str] | None = None
    follow_links: bool = False
    is_asking: bool = False


def open_for_window(
    path: Path,
    *,
    scale: float | None,
    project_dir: Path | None,
    current: Path | None,
    context: JobContext,
    recent: Sequence[RecentProject] = (),
    is_new_project: bool = False,
    follow_links: bool = False,
    is_asking: bool = False,
    answers: OpeningAnswers | None = None,
    known: Capture | None = None,
) -> Opened:
    """Open a capture folder or a project folder.

    Args:
        path: A capture folder, or a project folder.
        scale: Working size; None picks one.
        project_dir: Where the capture's project goes; when None, one that is there already is taken, else a folder in
            the user's data folder.
        current: Project folder that this program has open already.
        context: Receives progress.
        recent: Projects opened lately; those of this capture may be opened.
        is_new_project: Start another project, whatever there is.
        follow_links: Whether the user allows the capture's files to lie outside of its folder; noted in the project.
        is_asking: Only look at the capture where a project would have to be made.
        answers: What a new project begins with; None takes the scale and what the capture suggests.
        known: The capture where it was opened already.
    Raises:
        CaptureError, ProjectError: It cannot be opened.
    """
    context.report(0.0, path.name)
    if is_project(path):
        return _open_project(path, current, context, follow_links=follow_links)
    capture = known or open_capture(path, scale=1.0 if scale is None else scale, follow_links=follow_links)
    if answers is not None:
        capture = capture.resized(answers.scale, answers.frames)
    elif scale is None:
        capture = capture.resized(window_scale(capture))
    context.report(0.3, f"{len(capture.rig)} cameras, {capture.n_frames} frames")
    there = capture if scale is None else None
    if project_dir is not None:
        if (project_dir / PROJECT_FILE).is_file():
            return _open_project(project_dir, current, context, there, follow_links=follow_links)
        return _make_project(project_dir, capture, answers, is_asking=is_asking)
    found = projects_of(capture, recent)
    if is_new_project or not found:
        return _make_project(new_project_dir(capture), capture, answers, is_asking=is_asking)
    if len(found) > 1:
        return Opened(capture, choices=tuple(found), follow_links=follow_links)
    opened = _open_project(found[0].folder, current, context, there, follow_links=follow_links)
    if opened.project is None or opened.catalog is None or opened.note is not None:
        return opened
    told = f"{opened.catalog.n_trained} of {len(opened.catalog)} clips trained - {opened.project.folder}"
    return replace(opened, note=("info", "The project of this capture was opened", told, ""))


def _make_project(folder: Path, capture: Capture, answers: OpeningAnswers | None, *, is_asking: bool) -> Opened:
    if is_asking:
        return Opened(capture, follow_links=capture.follow_links, is_asking=True)
    settings = default_settings(capture)
    if answers is not None:
        settings = default_settings(capture, clip_length=answers.clip_length, holdout=answers.holdout)
    project = create_project(folder, settings)
    return Opened(capture, project, ClipCatalog(project, len(project.clips(capture.n_frames))))


def _open_project(
    folder: Path,
    current: Path | None,
    context: JobContext,
    capture: Capture | None = None,
    *,
    follow_links: bool = False,
) -> Opened:
    stored = read_settings(folder)
    settings = replace(stored, follow_links=stored.follow_links or follow_links)
    if capture is None:
        capture = open_capture_of(settings, folder)
    else:
        check_capture(capture, settings, folder)
        capture = (
            capture
            if (capture.scale, capture.frames) == (settings.scale, settings.frames)
            else capture.resized(settings.scale, settings.frames)
        )
    if current is not None and current.resolve() == folder.resolve():
        return Opened(capture)
    note = None
    try:
        project = open_project(folder)
        place = str(Path(capture.path).resolve())
        settings = replace(settings, capture=place)
        if settings != stored:  # it has moved since, or may follow links; workers open it as the project says
            project.update(settings)
    except ProjectError as error:  # most likely locked; looking at it does no harm
        note = ("warn", "The project is open for reading only", str(error), "Training is off until it is closed there.")
        project = open_project(folder, is_writable=False)
    n_clips = len(project.clips(capture.n_frames))

    def report(n_read: int) -> None:
        context.report(0.5 + 0.5 * n_read / n_clips, f"reading clip {n_read} of {n_clips}")

    try:
        return Opened(capture, project, ClipCatalog(project, n_clips, report), note=note)
    except BaseException:
        project.close()
        raise


def projects_of(capture: Capture, recent: Sequence[RecentProject] = ()) -> list[RecentProject]:
    """Projects of a capture: those that the window keeps, and those of the recent ones that were made for it."""
    place = Path(capture.path).resolve()
    kept = sorted(default_project_dir(capture).parent.glob(f"{default_project_dir(capture).name}*"))
    folders = [entry.folder for entry in recent if entry.project and Path(entry.capture) == place]
    found = []
    for folder in dict.fromkeys(path.resolve() for path in [*folders, *kept]):
        try:
            settings = read_settings(folder)
        except ProjectError:
            continue
        if settings.fingerprint == capture.fingerprint:
            n_trained = len(finished_files(folder, settings.clip_bounds, settings.clip_length))
            first, stop = settings.frames or (0, capture.layout.n_frames)
            n_clips = len(settings.clips(stop - first))
            name = project_name(folder, capture.path)
            opened = next((entry.opened for entry in recent if entry.folder == folder), "")
            found.append(RecentProject(str(folder), str(place), name, n_trained, n_clips, opened))
    return found


def new_project_dir(capture: Capture) -> Path:
    """A folder for a new project of a capture: the usual one, or that with a number where it is taken."""
    usual = default_project_dir(capture)
    number = 2
    folder = usual
    while folder.exists() and any(child.name != "lock" for child in folder.iterdir()):
        folder = usual.with_name(f"{usual.name}-{number}")
        number += 1
    return folder


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
    return capture if settings.frames is None else capture.resized(settings.scale, settings.frames)


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
