"""Model states as files: live snapshots with backpressure, the finished clip, and when it is time for the next one."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np

from app.training.messages import SnapshotWritten
from engine.clip_files.clip_state import ClipState, read_clip_state, write_clip_state
from engine.clip_files.compact import CompactClip, write_compact_clip
from engine.errors import DiskError, ProjectError
from engine.storage.files import disk_error, replace_file


class Cadence:
    """When something that costs time is due again: not more often than `every_s`, nor than its share of time allows.

    Args:
        every_s: Shortest time from the start of one to the start of the next, seconds.
        max_share: Share of all time that it may take.
    """

    def __init__(self, every_s: float, max_share: float = 1.0) -> None:
        self._every_s, self._max_share = every_s, max_share
        self._next_s: float | None = None

    def is_due(self, now_s: float) -> bool:
        """Whether it is time; the first time is one interval after the first question."""
        if self._next_s is None:
            self._next_s = now_s + self._every_s
        return now_s >= self._next_s

    def done(self, started_s: float, now_s: float) -> None:
        """Tell when it was done, from and until."""
        self._next_s = started_s + max(self._every_s, (now_s - started_s) / self._max_share)


class SnapshotWriter:
    """Writes live snapshots of one clip; at most one is unconsumed at a time.

    Args:
        live_dir: Folder for them.
        clip_index: Named in the files.
    """

    def __init__(self, live_dir: Path, clip_index: int) -> None:
        self._live_dir, self._clip_index = live_dir, clip_index
        self._paths: dict[int, Path] = {}
        self.revision = 0
        self._consumed = 0

    @property
    def is_free(self) -> bool:
        """Whether the last snapshot was consumed."""
        return self._consumed >= self.revision

    def write(self, state: ClipState) -> SnapshotWritten:
        """Write the next revision.

        Raises:
            DiskError: The disk refused.
        """
        revision = self.revision + 1
        path = self._live_dir / f"clip-{self._clip_index:04d}-r{revision:04d}.safetensors"
        write_clip_state(path, state)
        self.revision = revision  # one that could not be written is not waited for
        self._paths[revision] = path
        return SnapshotWritten(self.revision, state.header.step, str(path))

    def consumed(self, revision: int) -> None:
        """The reader is done with a revision: older ones are deleted."""
        self._consumed = max(self._consumed, revision)
        for old in [known for known in self._paths if known < self._consumed]:
            with suppress(OSError):
                self._paths.pop(old).unlink()

    def clear(self) -> None:
        """Delete every snapshot. A reader that comes late finds the finished clip instead."""
        for path in self._paths.values():
            with suppress(OSError):
                path.unlink()
        self._paths = {}


def is_finite(state: ClipState) -> bool:
    """Whether every number of the state is finite."""
    return all(np.isfinite(a).all() for a in state.arrays.values() if np.issubdtype(a.dtype, np.floating))


def keep_clip(clip: CompactClip, path: Path, live_dir: Path, make_way: Callable[[], object] = lambda: None) -> None:
    """Put a finished clip in its place, after it was written elsewhere, read back and found equal.

    Args:
        make_way: Called before what lies at `path` is replaced; keeps that.
    Raises:
        DiskError: The disk refused, or what was read back differs.
    """
    draft = live_dir / f"{path.stem}-final{path.suffix}"
    try:
        write_compact_clip(draft, clip)
        if not _reads_back(draft, clip):
            raise DiskError(
                "The clip read back differs from the clip written; the disk may be damaged.",
                hint="Check the disk, or move the project to another one.",
                path=path,
            )
        path.parent.mkdir(exist_ok=True)
        make_way()
        replace_file(draft, path, is_durable=True)
    except OSError as error:
        raise disk_error(error, what="The clip", path=path) from error
    finally:
        with suppress(OSError):
            draft.unlink(missing_ok=True)


def _reads_back(path: Path, clip: CompactClip) -> bool:
    try:
        return read_clip_state(path).fingerprint == clip.state.fingerprint
    except ProjectError:
        return False
