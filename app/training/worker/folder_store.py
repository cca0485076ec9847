"""FolderStore: the project folder as a worker of the same machine uses it."""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from app.project.claims.claims import check_claim
from app.project.clips.clip_paths import ClipPaths
from app.project.clips.clip_versions import read_finished
from app.project.clips.metrics_file import read_metrics
from app.project.opening.project_access import open_project
from app.training.worker.disk_retries import FolderWatch
from engine.capture.capture import Capture, open_capture
from engine.clip_files.clip_state import ClipState, read_clip_state, write_clip_state
from engine.clip_files.compact import CompactClip, write_compact_clip
from engine.errors import DiskError, ProjectError
from engine.storage.files import discard, disk_error, open_to_append, replace_file
from engine.storage.json_files import checked_line
from engine.storage.process_space import process_space
from engine.training.preparation.stages import remove_stages


class FolderStore:
    """A project folder on this machine, without its lock. See `ClipStore`.

    Args:
        folder: Of the project, as it is now.
        capture: Where its capture is on this machine; where the project says so when None.
        claim: Token of the process that has claimed the clip which is trained; empty to put it without asking.
    Raises:
        ProjectError: It is not a project, or is damaged.
        ProjectGone: It is missing.
    """

    def __init__(self, folder: Path, capture: Path | None = None, claim: str = "") -> None:
        self.folder, self._capture, self._claim = folder, capture, claim
        self._watch = FolderWatch(folder)
        self._project = open_project(folder, is_writable=False)

    def check(self) -> None:
        """See `ClipStore`."""
        self._watch.check()

    def _files(self, key: str) -> ClipPaths:
        return ClipPaths(self.folder, key)

    # ---------------------------------------------------------------- inputs

    def capture(self, *, scale: float, frames: tuple[int, int] | None) -> Capture:
        """See `ClipStore`."""
        settings = self._project.settings
        return open_capture(
            Path(settings.capture) if self._capture is None else self._capture,
            scale=scale,
            frames=frames,
            follow_links=settings.follow_links,
            is_growing=settings.is_growing,
        )

    def clip(self, key: str) -> ClipState:
        """See `ClipStore`."""
        clip_index = self._project.index_of(key)
        if clip_index is None or not self._project.is_trained(clip_index):
            raise ProjectError(f"Clip {key} is not trained.", hint="Train it first.", path=self._files(key).clip)
        return read_finished(self._project, clip_index)

    @property
    def shared(self) -> Path:
        """See `ClipStore`."""
        return self._project.prep_dir

    # ---------------------------------------------------------------- results

    def put_clip(self, key: str, clip: CompactClip) -> None:
        """See `ClipStore`. Raises ClipClaimed: Another process has taken the clip over."""
        path = self._files(key).handed_over
        # one taken for dead may still write its own
        draft = path.with_name(f"{key}-p{os.getpid()}-{process_space()}-final.safetensors")
        check_claim(self.folder, key, self._claim)
        try:
            write_compact_clip(draft, clip)
            if not _reads_back(draft, clip):
                raise DiskError(
                    "The clip read back differs from the clip written; the disk may be damaged.",
                    hint="Check the disk, or move the project to another one.",
                    path=path,
                )
            check_claim(self.folder, key, self._claim)
            replace_file(draft, path, is_durable=True)
        except OSError as error:
            raise disk_error(error, what="The clip", path=path) from error
        finally:
            with suppress(OSError):
                draft.unlink(missing_ok=True)

    def put_snapshot(self, key: str, revision: int, state: ClipState) -> None:
        """See `ClipStore`."""
        write_clip_state(self._files(key).snapshot(revision), state)

    def drop_snapshot(self, key: str, revision: int) -> None:
        """See `ClipStore`."""
        discard(self._files(key).snapshot(revision))

    # ---------------------------------------------------------------- unfinished trainings

    def checkpoint(self, key: str) -> Path | None:
        """See `ClipStore`."""
        path = self._files(key).checkpoint
        return path if path.is_file() else None

    def put_checkpoint(self, key: str, write: Callable[[Path], None]) -> None:
        """See `ClipStore`. Raises as `put_clip` does."""
        check_claim(self.folder, key, self._claim)
        write(self._files(key).checkpoint)

    def rows(self, key: str) -> list[dict[str, Any]]:
        """See `ClipStore`. Those of a training that an earlier version stopped lie where finished clips have theirs."""
        files = self._files(key)
        if not files.unfinished_metrics.is_file() and not files.clip.is_file():
            with suppress(OSError):
                files.metrics.rename(files.unfinished_metrics)
        return read_metrics(files.unfinished_metrics)

    def put_row(self, key: str, row: dict[str, Any]) -> None:
        """See `ClipStore`."""
        path = self._files(key).unfinished_metrics
        try:
            path.parent.mkdir(exist_ok=True)  # not the project itself, which may be gone
            with open(open_to_append(path), "a", encoding="utf-8") as file:
                file.write(checked_line(row))
        except OSError as error:
            raise disk_error(error, what="A point of them", path=path) from error

    def drop_pieces(self, key: str) -> bool:
        """See `ClipStore`."""
        clip_index = self._project.index_of(key)
        return clip_index is not None and remove_stages(self.shared, clip_index) > 0

    def drop_progress(self, key: str) -> None:
        """See `ClipStore`."""
        files = self._files(key)
        for path in (files.checkpoint, files.unfinished_metrics, files.handed_over):
            discard(path)


def _reads_back(path: Path, clip: CompactClip) -> bool:
    try:
        return read_clip_state(path).fingerprint == clip.state.fingerprint
    except ProjectError:
        return False
