"""Creating, opening and repairing project folders: the lock, and work that a killed program left half done."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from app.document.history import DocumentHistory
from app.document.project_document import ProjectDocument
from app.document.project_settings import ProjectSettings
from app.document.storing.document_file import PROJECT_FILE
from app.document.storing.document_store import DocumentStore
from app.document.storing.recovery import plain_history, recover
from app.document.storing.replay import JOURNAL_FOLDER
from app.project.clips.clip_exchange import finish_exchange
from app.project.folders import check_folders
from app.project.lock import ProcessLock
from app.project.opening.interrupted import finish_interrupted
from app.project.opening.sweeping import sweep
from app.project.project import LOCK_FILE, LOCK_FILES, READ_ONLY, Project
from engine.capture.capture import Capture
from engine.errors import ProjectError
from engine.storage.files import is_partial

MIN_TRAINING_CAMERAS = 2
DEFAULT_CLIP_LENGTH = 10


def read_settings(folder: Path) -> ProjectSettings:
    """The settings of a project that is not opened. Raises as DocumentStore.read does."""
    return DocumentStore(folder).read().present.settings


def is_project(folder: Path) -> bool:
    """Whether the folder is a project rather than a capture; a path that cannot even be looked at is none."""
    try:
        return (folder / PROJECT_FILE).is_file()
    except OSError:
        return False


def default_settings(
    capture: Capture,
    *,
    clip_length: int | None = None,
    holdout: tuple[str, ...] | None = None,
    seed: int = 0,
    overrides: dict[str, Any] | None = None,
    reference_clip: int = 0,
) -> ProjectSettings:
    """Settings for a capture. Without a hold-out the one that the capture suggests; clips of 10 frames, or of all.

    Raises:
        ProjectError: A value lies outside its range, a camera does not exist, or too few are left for training.
    """
    chosen = capture.default_holdout if holdout is None else tuple(holdout)
    settings = ProjectSettings(
        capture=str(Path(capture.path).resolve()),
        fingerprint=capture.fingerprint,
        scale=capture.scale,
        clip_length=min(DEFAULT_CLIP_LENGTH, capture.n_frames) if clip_length is None else clip_length,
        holdout=tuple(chosen),
        seed=seed,
        overrides=dict(overrides or {}),
        reference_clip=reference_clip,
        follow_links=capture.follow_links,
        frames=capture.frames,
        is_growing=capture.is_growing,
    )
    check_settings(settings, capture)
    return settings


def check_settings(settings: ProjectSettings, capture: Capture) -> None:
    """Check that the settings fit the capture.

    Raises:
        ProjectError: They do not; says which and what is allowed.
    """
    n_cameras = len(capture.rig)
    if not 1 <= settings.clip_length <= capture.n_frames:
        raise ProjectError(
            f"The clip length is {settings.clip_length}; the capture allows 1 to {capture.n_frames} frames."
        )
    if not 0 <= settings.seed < 2**32:
        raise ProjectError(f"The seed is {settings.seed}; it must be between 0 and {2**32 - 1}.")
    unknown = [name for name in settings.holdout if name not in capture.rig.names]
    if unknown:
        raise ProjectError(
            f"There is no camera called {', '.join(unknown)} to hold out.",
            hint=f"Cameras are {', '.join(capture.rig.names[:8])}{' and more' if n_cameras > 8 else ''}.",
        )
    n_left = n_cameras - len(set(settings.holdout))
    if n_left < MIN_TRAINING_CAMERAS:
        raise ProjectError(
            f"{len(set(settings.holdout))} of {n_cameras} cameras are held out, which leaves {n_left} for training; "
            f"{MIN_TRAINING_CAMERAS} are needed.",
            hint="Hold out fewer cameras.",
        )
    n_clips = len(settings.clips(capture.n_frames))
    if not 0 <= settings.reference_clip < n_clips:
        raise ProjectError(f"The reference clip is {settings.reference_clip}; clips are 0 to {n_clips - 1}.")


def create_project(folder: Path | str, settings: ProjectSettings) -> Project:
    """Make a project folder and lock it.

    Raises:
        ProjectError: The folder holds a project or foreign files already, or cannot be written.
    """
    folder = Path(folder)
    if (folder / PROJECT_FILE).exists():
        raise ProjectError("There is a project already.", hint="Open it instead.", path=folder)
    if folder.is_dir() and any(map(_is_foreign, folder.iterdir())):
        raise ProjectError(
            "The project folder holds other files.", hint="Choose an empty or a new folder.", path=folder
        )
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ProjectError(
            f"The project folder cannot be made ({error.strerror}).", hint="Choose another place.", path=folder
        ) from error
    lock = ProcessLock(folder / LOCK_FILE)
    lock.acquire()
    try:
        if (folder / PROJECT_FILE).exists():  # made while this one looked
            raise ProjectError("There is a project already.", hint="Open it instead.", path=folder)
        document, store = ProjectDocument(settings), DocumentStore(folder)
        store.create(document)
    except ProjectError:
        lock.release()
        raise
    return Project(folder, DocumentHistory(document), lock, store=store)


def _is_foreign(path: Path) -> bool:
    """Whether something in a folder is not what is left of a project whose making was interrupted."""
    if path.name == JOURNAL_FOLDER and path.is_dir():
        return any(path.iterdir())
    return path.name not in LOCK_FILES and not is_partial(path)


def open_project(
    folder: Path | str, *, is_writable: bool = True, is_journal_used: bool = True, why_read_only: str = READ_ONLY
) -> Project:
    """Open an existing project folder; for writing it is locked, and left-over snapshots are swept.

    Args:
        is_journal_used: False for the document of project.json as it is, where the journal is damaged; read-only.
        why_read_only: See Project.
    Raises:
        ProjectError: The folder is not a project, is damaged, of a newer schema, open for writing elsewhere, or a
            folder in it is a link.
    """
    folder = Path(folder)
    if not is_journal_used:
        return Project(folder, plain_history(folder), None, why_read_only=why_read_only)
    store = DocumentStore(folder)
    lock = None
    if is_writable and is_project(folder):  # any other folder raises its error below
        check_folders(folder)
        lock = ProcessLock(folder / LOCK_FILE)
        lock.acquire()
    try:
        history = store.read()
    except ProjectError:
        if lock is not None:
            lock.release()
        raise
    project = Project(folder, history, lock, store=store, why_read_only=why_read_only)
    if is_writable:
        try:
            finish_exchange(folder)
        except ProjectError:
            project.close()
            raise
        sweep(folder)
        finish_interrupted(project)
    return project


def open_for_clips(folder: Path | str) -> Project:
    """Open an existing project folder to train clips into it, without its lock: any number of processes may do so, and
    a window may have it open meanwhile. Every clip is claimed before it is trained.

    Raises:
        ProjectError: The folder is not a project, is damaged, of a newer schema, or a folder in it is a link.
    """
    folder = Path(folder)
    if is_project(folder):  # any other folder raises its error below
        check_folders(folder)
    store = DocumentStore(folder)
    return Project(folder, store.read(), None, store=store, is_for_clips=True)


def repair_project(folder: Path | str) -> Path:
    """Continue with the steps before the damage; see app.document.storing.recovery.

    Returns:
        The folder with what was damaged.
    Raises:
        ProjectError: Nothing can be kept, a folder of the project is a link, or it is open for writing elsewhere.
    """
    check_folders(Path(folder))
    lock = ProcessLock(Path(folder) / LOCK_FILE)
    lock.acquire()
    try:
        return recover(Path(folder))
    finally:
        lock.release()
