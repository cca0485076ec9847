"""Opening: a capture and the project that belongs to it. Runs on a job's thread; changes no state."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path

from app.background.jobs import JobContext
from app.document.project_settings import ProjectSettings
from app.document.storing.document_file import PROJECT_FILE, DamagedDocument
from app.document.storing.journal_file import JournalDamage
from app.document.storing.recovery import damaged_project, plain_history
from app.project.clips.clip_catalog import ClipCatalog
from app.project.clips.clip_names import finished_files
from app.project.opening.opening_answers import OpeningAnswers, window_scale
from app.project.opening.project_access import (
    create_project,
    default_settings,
    is_project,
    open_project,
    read_settings,
    repair_project,
)
from app.project.opening.project_choices import AS_USUAL, ProjectChoices
from app.project.project import LOCK_FILE, Project
from app.project.projects_folder import new_project_dir, project_name, projects_dir, usual_project_dir
from app.project.recents import RecentProject
from engine.capture.capture import Capture, open_capture
from engine.capture.writers.capture_json import Corrections, write_corrections
from engine.errors import CaptureError, ProjectError
from engine.training.presets import closest_preset
from engine.user_folders import data_dir

Note = tuple[str, str, str, str]


class LostCapture(CaptureError):
    """The capture of a project is not where it was. project: The project's folder."""

    project: Path | None = None


class OtherCapture(ProjectError):
    """In the place of a project's capture lies another one.

    Attributes:
        project: The project's folder.
        known: The former place of its capture.
    """

    project: Path | None = None
    known: Path = Path()


@dataclass(frozen=True, slots=True)
class Opened:
    """A capture and its project, or a choice between its projects.

    Attributes:
        project: None where it is the one already open, or the user has to be asked.
        catalog: Its clips on the disk; None without a project.
        choices: The projects to choose from; empty where there is nothing to choose.
        notes: Kind, title, detail and hint of each note to the user.
        follow_links: Of a choice: whether the user allows the capture's files to lie outside of its folder.
        is_asking: There is no project yet, and the user is to see the capture before one is made.
        folder: The place of a new project then; None elsewhere.
        is_new: The project was made just now.
    """

    capture: Capture
    project: Project | None = None
    catalog: ClipCatalog | None = None
    choices: tuple[RecentProject, ...] = ()
    notes: tuple[Note, ...] = ()
    follow_links: bool = False
    is_asking: bool = False
    folder: Path | None = None
    is_new: bool = False

    def leave(self) -> None:
        """Nobody wants it after all: let go of it, and take back a project that was made for it."""
        if self.project is not None:
            if self.is_new:
                self.project.remove_files()
            self.project.close()
            if self.is_new:
                with suppress(OSError):  # not empty: somebody has put something there
                    (self.project.folder / LOCK_FILE).unlink(missing_ok=True)
                    self.project.folder.rmdir()
        self.capture.close()


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
    choices: ProjectChoices = AS_USUAL,
    projects: Path | None = None,
) -> Opened:
    """Open a capture folder or a project folder. Where a capture has projects, they are offered, also a single one.

    Args:
        path: A capture folder, or a project folder.
        scale: Working size; None picks one.
        project_dir: Where the capture's project is, or goes; when None, those that there are are offered, else it goes
            into `projects`.
        current: Project folder that this program has open already.
        context: Receives progress.
        recent: Projects opened lately; those of this capture may be opened.
        is_new_project: Start another project, whatever there is.
        follow_links: Whether the user allows the capture's files to lie outside of its folder; noted in the project.
        is_asking: Only look at the capture where a project would have to be made; so it is, too, where somebody has to
            say what became of its frames.
        answers: The first settings of a new project; None takes the scale and what the capture suggests. Its `fit` is
            written into the capture's capture.json.
        known: The capture where it was opened already.
        choices: The way a project is opened.
        projects: The folder of projects without a place of their own; None for the usual one.
    Raises:
        DamagedProject: Its document is damaged; says what is left.
        LostCapture: The capture of a project is not where it was.
        CaptureError, ProjectError: It cannot be opened.
    """
    context.report(0.0, path.name)
    if is_project(path):
        return _open_project(path, current, context, follow_links=follow_links, choices=choices)
    capture = known or open_capture(
        path, scale=1.0 if scale is None else scale, follow_links=follow_links, is_shape_asked=True
    )
    if answers is not None and answers.fit is not None and answers.fit != capture.layout.fit:
        write_corrections(capture.layout, path, Corrections(fit=answers.fit))
        capture = open_capture(path, follow_links=follow_links)
    is_asking = is_asking or bool(capture.layout.far_off)
    if answers is not None:
        capture = capture.resized(answers.scale, answers.frames)
    elif scale is None:
        capture = capture.resized(window_scale(capture))
    context.report(0.3, f"{len(capture.rig)} cameras, {capture.n_frames} frames")
    there = capture if scale is None else None
    if project_dir is not None:
        if (project_dir / PROJECT_FILE).is_file():
            return _open_project(project_dir, current, context, there, follow_links=follow_links, choices=choices)
        return _make_project(project_dir, capture, answers, choices, is_asking=is_asking)
    projects = projects_dir() if projects is None else projects
    found = [] if is_new_project else projects_of(capture, recent, projects)
    if found:
        return Opened(capture, choices=tuple(found), follow_links=follow_links)
    if not is_new_project:
        for folder in _kept_dirs(capture, projects):
            _read_settings(folder, choices)  # one that is damaged is asked about, not passed over
    return _make_project(new_project_dir(capture, projects), capture, answers, choices, is_asking=is_asking)


def _make_project(
    folder: Path, capture: Capture, answers: OpeningAnswers | None, choices: ProjectChoices, *, is_asking: bool
) -> Opened:
    if choices.is_read_only:
        raise ProjectError(
            "This capture has no project yet.",
            hint="Open it for writing, which makes one.",
            path=capture.path,
        )
    if is_asking:
        return Opened(capture, follow_links=capture.follow_links, is_asking=True, folder=folder)
    settings = default_settings(capture)
    if answers is not None:
        settings = default_settings(capture, clip_length=answers.clip_length, holdout=answers.holdout)
    project = create_project(folder, settings)
    return Opened(capture, project, ClipCatalog(project, len(project.clips(capture.n_frames))), is_new=True)


def _open_project(
    folder: Path,
    current: Path | None,
    context: JobContext,
    capture: Capture | None = None,
    *,
    follow_links: bool = False,
    choices: ProjectChoices = AS_USUAL,
) -> Opened:
    notes: list[Note] = []
    if choices.is_repaired:
        aside = repair_project(folder)
        notes.append(("info", "The project was repaired", f"Damaged files are kept in {aside}.", ""))
    stored = _read_settings(folder, choices)
    settings = replace(stored, follow_links=stored.follow_links or follow_links)
    if choices.capture is not None:
        settings = replace(settings, capture=str(choices.capture.resolve()))
    if capture is None:
        try:
            capture = open_capture_of(settings, folder)
        except OtherCapture as error:
            error.known = Path(stored.capture)
            raise
    else:
        check_capture(capture, settings, folder)
        capture = (
            capture
            if (capture.scale, capture.frames) == (settings.scale, settings.frames)
            else capture.resized(settings.scale, settings.frames)
        )
    is_again = current is not None and current.resolve() == folder.resolve()
    if is_again and choices == AS_USUAL:
        return Opened(capture)
    project = _opened(folder, choices, notes)
    settings = replace(settings, capture=str(Path(capture.path).resolve()))
    try:
        if project.is_writable and settings != stored:
            project.update(settings)  # it has moved, or may follow links; workers open it as the project says
        n_clips = len(project.clips(capture.n_frames))

        def report(n_read: int) -> None:
            context.report(0.5 + 0.5 * n_read / n_clips, f"reading clip {n_read} of {n_clips}")

        return Opened(capture, project, ClipCatalog(project, n_clips, report), notes=tuple(notes))
    except BaseException:
        project.close()
        raise


def _read_settings(folder: Path, choices: ProjectChoices) -> ProjectSettings:
    if not choices.is_journal_used:
        return plain_history(folder).present.settings
    try:
        return read_settings(folder)
    except (JournalDamage, DamagedDocument) as error:
        raise damaged_project(folder, error) from error


def _opened(folder: Path, choices: ProjectChoices, notes: list[Note]) -> Project:
    """The project, for writing where that is possible and wanted; remarks on it go into `notes`."""
    if not choices.is_journal_used:
        notes.append(("warn", "The project is open read-only", "The journal is ignored.", ""))
        why = "It was opened without its damaged journal. Repair it to edit or train."
        return open_project(folder, is_writable=False, is_journal_used=False, why_read_only=why)
    if choices.is_read_only:
        notes.append(("info", "The project is open read-only", "", "Open it again to change something."))
        why = "To change something, open it again."
        project = open_project(folder, is_writable=False, why_read_only=why)
        notes += _missing(project)
        return project
    try:
        project = open_project(folder)
        notes += _recovered(project)
    except ProjectError as error:  # most likely locked; looking at it does no harm
        notes.append(("warn", "The project is open read-only", str(error), "Nothing can be changed in it."))
        why = f"{error.message} {error.hint}".strip()
        project = open_project(folder, is_writable=False, why_read_only=why)
    notes += _missing(project)
    return project


def _recovered(project: Project) -> list[Note]:
    """Notes for a user whose project was not closed the last time."""
    n = project.store.n_replayed
    steps = f"{n} step{'s were' if n != 1 else ' was'} recovered from the journal, up to: {project.history.undo_name}."
    told = f"It was not closed last time. {steps if project.history.undo_name else steps.partition(',')[0] + '.'}"
    return [("info", "The latest edits were recovered", told, "")] if n else []


def _missing(project: Project) -> list[Note]:
    """Notes on parts that were missing when the project's document was read."""
    return [("warn", "Part of the project is missing", note, "") for note in project.store.notes]


def projects_of(
    capture: Capture, recent: Sequence[RecentProject] = (), projects: Path | None = None
) -> list[RecentProject]:
    """Projects of a capture, the one that was open last first: those that the window keeps, and those of the recent
    ones that were made for it. projects: See `open_for_window`."""
    place = Path(capture.path).resolve()
    kept = _kept_dirs(capture, projects_dir() if projects is None else projects)
    folders = [entry.folder for entry in recent if entry.project and Path(entry.capture) == place]
    found = []
    for folder in dict.fromkeys(path.resolve() for path in [*folders, *kept]):
        try:
            settings = read_settings(folder)
        except ProjectError:
            continue
        is_grown = settings.is_growing and Path(settings.capture) == place
        if settings.fingerprint == capture.fingerprint or is_grown:
            n_trained = len(finished_files(folder, settings.clip_bounds, settings.clip_length))
            first, stop = settings.frames or (0, capture.layout.n_frames)
            n_clips = len(settings.clips(stop - first))
            name, preset = project_name(folder, capture.path), closest_preset(settings.overrides)
            known = next((entry.opened for entry in recent if entry.folder == folder), "")
            opened = known or _changed(folder)
            found.append(RecentProject(str(folder), str(place), name, n_trained, n_clips, opened, preset))
    return sorted(found, key=lambda entry: entry.opened, reverse=True)


def _changed(folder: Path) -> str:
    """The time at which the document of a project was written last."""
    try:
        written_s = (folder / PROJECT_FILE).stat().st_mtime
        return datetime.fromtimestamp(written_s, UTC).isoformat(timespec="seconds")
    except (OSError, ValueError, OverflowError):
        return ""


def _kept_dirs(capture: Capture, projects: Path) -> list[Path]:
    """Folders of projects of a capture that the window has made, there and where it usually makes them."""
    kept: list[Path] = []
    for parent in dict.fromkeys((projects, data_dir() / "projects")):
        usual = usual_project_dir(capture, parent)
        with suppress(OSError):
            kept += [one for one in sorted(parent.iterdir()) if one.name.startswith(usual.name) and is_project(one)]
    return kept


def open_capture_of(settings: ProjectSettings, folder: Path) -> Capture:
    """Open the capture of the project in this folder.

    Raises:
        CaptureError: It is gone or damaged.
        ProjectError: Another one lies in its place.
    """
    if not Path(settings.capture).is_dir():
        lost = LostCapture(
            "The capture of this project is no longer where it was.",
            hint=f"Put it back, or give its new place: clipgstream train NEW_PLACE --project {folder}",
            path=settings.capture,
        )
        lost.project = folder
        raise lost
    capture = open_capture(
        settings.capture,
        scale=settings.scale,
        follow_links=settings.follow_links,
        is_growing=settings.is_growing,
    )
    try:
        check_capture(capture, settings, folder)
    except ProjectError:
        capture.close()
        raise
    return capture if settings.frames is None else capture.resized(settings.scale, settings.frames)


def check_capture(capture: Capture, settings: ProjectSettings, folder: Path) -> None:
    """Check that the capture is the one the project was made for.

    Raises:
        ProjectError: It is another one.
    """
    if capture.fingerprint != settings.fingerprint:
        other = OtherCapture(
            f"The capture in {capture.path} is not the one this project was made for.",
            hint="Put the original capture back, or make a new project.",
            path=folder,
        )
        other.project, other.known = folder, Path(settings.capture)
        raise other
