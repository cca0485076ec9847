"""ClipStore: the interface between a training and its project, wherever that lies. A worker has no other access.

Clips are named by keys, which follow from their frames (app.project.clips.clip_names). Bulk goes through the store,
reports go as messages. `FolderStore` is the project folder itself; a worker on another machine needs another store and
another way to be launched, and nothing else.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol

from engine.capture.capture import Capture
from engine.clip_files.clip_state import ClipState
from engine.clip_files.compact import CompactClip


class ClipStore(Protocol):
    """Reads the inputs of one training and keeps its results. For one thread; everything it puts is there completely or
    not at all. Every method that puts something may raise DiskError; nothing has changed then."""

    def check(self) -> None:
        """Check that it is there, so that nothing is put into another one of its name. Raises ProjectGone."""
        ...

    def capture(self, *, scale: float, frames: tuple[int, int] | None) -> Capture:
        """The capture, whose pictures are read as they are asked for. Raises CaptureError."""
        ...

    def clip(self, key: str) -> ClipState:
        """A finished clip, such as the reference. Raises ProjectError: it is missing or damaged."""
        ...

    @property
    def shared(self) -> Path:
        """A folder of this machine for files that clips share: backgrounds of the reference clip, and pieces of
        preparations. Files that a training leaves there are for others once its clip was put."""
        ...

    def put_clip(self, key: str, clip: CompactClip) -> None:
        """Hand the finished clip over: complete, and read back. The former one stays until the owner of the project
        takes the new one in."""
        ...

    def put_snapshot(self, key: str, revision: int, state: ClipState) -> None:
        """A state of the running training, for viewing."""
        ...

    def drop_snapshot(self, key: str, revision: int) -> None:
        """Remove a snapshot that is no longer viewed. Never fails."""
        ...

    def checkpoint(self, key: str) -> Path | None:
        """The checkpoint of an unfinished training, as a file of this machine; None without one."""
        ...

    def put_checkpoint(self, key: str, write: Callable[[Path], None]) -> None:
        """Keep an unfinished training. write: Writes it to the file that it is given."""
        ...

    def rows(self, key: str) -> list[dict[str, Any]]:
        """The metrics of an unfinished training, each with its step."""
        ...

    def put_row(self, key: str, row: dict[str, Any]) -> None:
        """Append to the metrics of an unfinished training."""
        ...

    def drop_pieces(self, key: str) -> bool:
        """Forget the pieces of a clip's preparation. Whether there were any."""
        ...

    def drop_progress(self, key: str) -> None:
        """Forget an unfinished training, but for the pieces of its preparation. Never fails."""
        ...


OpenStore = Callable[[], ClipStore]
"""Raises ProjectError or ProjectGone."""
