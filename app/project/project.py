"""Project: the folder that keeps the results of one capture. Paths, settings and the lock; no training.

project.json                 the document: settings, regions, camera paths, edits and so on, see ProjectDocument
journal/00000000.jsonl       what has happened to the document since that step
history.json                 the way back from the document of project.json
project.backup.json          project.json before it was written last
clips/0000.safetensors       finished clips
clips/000030-000035.safetensors  one of frames 30 to 34, after a split or merge; see app.project.clips.clip_names
mends/0001.json              what was mended, with figures before and after
versions/0000/               what was trained before it was trained again
damaged/0000-1.safetensors   damaged files that were put aside
checkpoints/0000.safetensors unfinished clips: everything needed to continue
claims/                      which process trains which clip, see app.project.claims
live/                        snapshots of the running training; swept when the project is opened for writing
prep/                        what clips share, such as backgrounds
metrics/0000.jsonl           curves of the finished clip, one JSON object per line
metrics/0000.unfinished.jsonl  of its training that is not finished
logs/                        one file per clip
"""

from __future__ import annotations

import os
import shutil
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from app.document.history import Changed, DocumentHistory, Event, Placed
from app.document.project_document import ProjectDocument
from app.document.project_settings import ProjectSettings
from app.document.storing.document_file import BACKUP_FILE, PROJECT_FILE
from app.document.storing.document_store import DocumentStore
from app.document.storing.history_file import HISTORY_FILE
from app.project.claims.left_over import live_claims
from app.project.clips.clip_names import clip_name, finished_files, index_of
from app.project.clips.clip_paths import LIVE, PREP, ClipPaths
from app.project.clips.header_cache import HeaderCache
from app.project.folders import FOLDERS
from app.project.lock import ProcessLock
from engine.capture.clip import Clip
from engine.errors import ProjectError

LOCK_FILE = "lock"
LOCK_FILES = (LOCK_FILE, f".{LOCK_FILE}")
READ_ONLY = "It was opened read-only. Open it for writing to change something."


class Project:
    """An opened project folder. Use `create_project` or `open_project`.

    Attributes:
        history: The document and the way back. The window sets it, and keeps it by itself a moment later.
        store: The store of the document.
        headers: Of its clips and checkpoints, read once for everybody who asks.

    Args:
        why_read_only: Without a lock, the cause and the remedy.
        is_for_clips: Whether it was opened to train clips without the lock, each of which is claimed.
    """

    def __init__(
        self,
        folder: Path,
        history: DocumentHistory,
        lock: ProcessLock | None,
        *,
        store: DocumentStore | None = None,
        why_read_only: str = READ_ONLY,
        is_for_clips: bool = False,
    ) -> None:
        self.folder = folder
        self.history, self.store = history, store or DocumentStore(folder)
        self.headers = HeaderCache()
        self._lock = lock
        self._why_read_only, self._is_for_clips = why_read_only, is_for_clips

    @property
    def document(self) -> ProjectDocument:
        """The project's present document."""
        return self.history.present

    @property
    def settings(self) -> ProjectSettings:
        """The settings that all clips share."""
        return self.history.present.settings

    @property
    def is_writable(self) -> bool:
        """Whether this process may change the document."""
        return self._lock is not None and self._lock.is_held

    @property
    def is_trainable(self) -> bool:
        """Whether this process may train clips into the project."""
        return self._is_for_clips or self.is_writable

    @property
    def live_dir(self) -> Path:
        """Snapshots of the running training."""
        return self.folder / LIVE

    @property
    def prep_dir(self) -> Path:
        """The folder of files that clips share."""
        return self.folder / PREP

    @property
    def first_cloud_path(self) -> Path:
        """A rough cloud to look at before anything is trained."""
        return self.prep_dir / "first_cloud.safetensors"

    def clip_name(self, clip_index: int) -> str:
        """The name of a clip's files, see app.project.clips.clip_names."""
        return clip_name(clip_index, self.settings.clip_bounds, self.settings.clip_length)

    def index_of(self, key: str) -> int | None:
        """Inverse of `clip_name`; None for a name that no clip has as they are cut now."""
        return index_of(key, self.settings.clip_bounds, self.settings.clip_length)

    def frames_of(self, clip_index: int) -> tuple[int, int | None]:
        """First frame of a clip, and one past its last; None of the last where only the capture knows it."""
        bounds, length = self.settings.clip_bounds, self.settings.clip_length
        if bounds is not None and 0 <= clip_index < len(bounds) - 1:
            return bounds[clip_index], bounds[clip_index + 1]
        return clip_index * length, None if self.settings.config().field == "joint" else (clip_index + 1) * length

    def finished_clips(self) -> list[tuple[int, Path]]:
        """Index and file of every finished clip, damaged ones included, in order."""
        return finished_files(self.folder, self.settings.clip_bounds, self.settings.clip_length)

    def files(self, clip_index: int) -> ClipPaths:
        """The place of a clip's files."""
        return ClipPaths(self.folder, self.clip_name(clip_index))

    def clip_path(self, clip_index: int) -> Path:
        """A finished clip."""
        return self.files(clip_index).clip

    def checkpoint_path(self, clip_index: int) -> Path:
        """An unfinished clip."""
        return self.files(clip_index).checkpoint

    def metrics_path(self, clip_index: int) -> Path:
        """Curves of a finished clip."""
        return self.files(clip_index).metrics

    def unfinished_metrics_path(self, clip_index: int) -> Path:
        """Curves of a training that is not finished."""
        return self.files(clip_index).unfinished_metrics

    def curve_path(self, clip_index: int, *, is_finished: bool) -> Path:
        """Curves of the finished clip, or of its training that was stopped."""
        path = self.unfinished_metrics_path(clip_index)
        if is_finished or (not path.is_file() and not self.is_trained(clip_index)):  # as earlier versions kept them
            return self.metrics_path(clip_index)
        return path

    def log_path(self, clip_index: int) -> Path:
        """Log of a clip's worker."""
        return self.files(clip_index).log

    def is_trained(self, clip_index: int) -> bool:
        """Whether the clip is finished."""
        return self.clip_path(clip_index).is_file()

    @property
    def has_finished_clips(self) -> bool:
        """Whether a clip is finished, damaged ones and those of other cuts included: what all clips share is fixed
        then."""
        return _has_clip_files(self.folder / "clips")

    @property
    def has_progress(self) -> bool:
        """Whether anything was learned, finished or not."""
        return any(_has_clip_files(self.folder / name) for name in ("clips", "checkpoints"))

    def clips(self, n_frames: int) -> list[Clip]:
        """The clips of a capture of that many frames; a single one where one field covers everything."""
        return self.settings.clips(n_frames)

    @property
    def reference_path(self) -> Path:
        """The finished clip that the others inherit from."""
        return self.clip_path(self.settings.reference_clip)

    def base_index(self, clip_index: int) -> int:
        """The clip that a clip is shown with: the reference, or itself where clips are independent."""
        return clip_index if self.settings.config().independent else self.settings.reference_clip

    def inherited_index(self, clip_index: int) -> int | None:
        """The clip that has to be finished before this one can be trained; None for one that inherits nothing."""
        base = self.base_index(clip_index)
        return None if base == clip_index else base

    def training_order(self, n_clips: int) -> list[int]:
        """Indices of that many clips as they are trained: the reference, then the others from the first."""
        first = self.settings.reference_clip
        return [first, *(i for i in range(n_clips) if i != first)]

    def previous_index(self, clip_index: int) -> int:
        """The clip that a clip continues from, if clips do: the one before, or the reference if there is none.

        Not for the reference itself, which continues from nothing.
        """
        return self.training_order(clip_index)[-1]

    def check_writable(self) -> None:
        """Check that this process may change the project.

        Raises:
            ProjectError: It may not.
        """
        if not self.is_writable:
            raise ProjectError("The project is open read-only.", hint=self._why_read_only, path=self.folder)

    def check_trainable(self) -> None:
        """Check that this process may train clips.

        Raises:
            ProjectError: It may not.
        """
        if not self.is_trainable:
            self.check_writable()

    def change(self, document: ProjectDocument, name: str) -> None:
        """Replace the document, on disk first, as a step of its history. name: See Changed.

        Raises:
            ProjectError: The project is read-only, or the document cannot be kept.
            DiskError: The disk refused.
        """
        self.happen(Changed(name, document))

    def happen(self, event: Event) -> None:
        """Let something happen to the document, on disk first. Raises what `change` raises.

        Not while a KeptDocument still has something to keep: events are kept in the order in which they arrive.
        """
        self.check_writable()
        history = self.history.after(event)
        self.store.write([event], history)
        self.history = history

    def update(self, settings: ProjectSettings) -> None:
        """Replace the settings; see `change`. Another place of the capture alone, or its growth, is not a step of the
        history."""
        if self.settings.is_placed_as(settings):
            self.happen(Placed(settings))
        else:
            self.change(replace(self.document, settings=settings), "change settings")

    def placed(self, capture: str, *, follow_links: bool) -> Project:
        """The same project with its capture in another place, as seen from this computer; not kept."""
        settings = replace(self.settings, capture=capture, follow_links=follow_links)
        history = replace(self.history, present=replace(self.document, settings=settings))
        return Project(
            self.folder,
            history,
            self._lock,
            store=self.store,
            why_read_only=self._why_read_only,
            is_for_clips=self._is_for_clips,
        )

    def discard_progress(self, clip_index: int) -> None:
        """Forget the unfinished training of a clip; a finished clip and its curves stay."""
        files = self.files(clip_index)
        for path in (files.checkpoint, files.unfinished_metrics, files.handed_over):
            with suppress(OSError):
                path.unlink()

    def close(self) -> None:
        """Write what the journal holds into project.json, and release the lock. The object can still be read from."""
        if self.is_writable:
            self.store.compact()
        if self._lock is not None:
            self._lock.release()

    def remove_files(self) -> None:
        """Take back a project that has learned nothing: its own files and folders go, other things stay. Nothing goes
        while another process trains a clip of it."""
        if live_claims(self.folder):
            return
        for name in FOLDERS:
            shutil.rmtree(self.folder / name, ignore_errors=True)
        for name in (PROJECT_FILE, BACKUP_FILE, HISTORY_FILE):
            (self.folder / name).unlink(missing_ok=True)


def _has_clip_files(folder: Path) -> bool:
    """Looks no further than the first one: there may be thousands."""
    try:
        with os.scandir(folder) as entries:
            return any(entry.name.endswith(".safetensors") for entry in entries)
    except OSError:
        return False
