"""A ClipStore that keeps everything as bytes in memory, as one on another machine would hand them over."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from app.project.project import Project
from engine.capture.capture import Capture, open_capture
from engine.clip_files.clip_state import ClipState, read_clip_state, write_clip_state
from engine.clip_files.compact import CompactClip, write_compact_clip
from engine.errors import ProjectError
from engine.storage.files import discard
from engine.training.preparation.stages import remove_stages


class MemoryStore:
    """See app.training.store.ClipStore.

    Args:
        project: Its finished clips and what clips share are taken up once; nothing is written there.
        scratch: A folder of this machine.

    Attributes:
        clips: What was handed over, by key.
    """

    def __init__(self, project: Project, scratch: Path) -> None:
        self._capture, self._scratch = project.settings.capture, scratch
        self._finished = {project.clip_name(index): path.read_bytes() for index, path in project.finished_clips()}
        self.clips: dict[str, bytes] = {}
        self.snapshots: dict[tuple[str, int], bytes] = {}
        self._checkpoints: dict[str, bytes] = {}
        self._rows: dict[str, list[dict[str, Any]]] = {}
        self.shared.mkdir(parents=True)
        for path in project.prep_dir.glob("*"):
            (self.shared / path.name).write_bytes(path.read_bytes())

    def _bytes(self, write: Callable[[Path], object]) -> bytes:
        path = self._scratch / "file.safetensors"
        write(path)
        content = path.read_bytes()
        path.unlink()
        return content

    def _file(self, name: str, content: bytes) -> Path:
        path = self._scratch / name
        path.write_bytes(content)
        return path

    def check(self) -> None:
        pass

    def capture(self, *, scale: float, frames: tuple[int, int] | None) -> Capture:
        return open_capture(Path(self._capture), scale=scale, frames=frames)

    def clip(self, key: str) -> ClipState:
        if key not in self._finished:
            raise ProjectError(f"Clip {key} is not trained.")
        return read_clip_state(self._file(f"{key}.safetensors", self._finished[key]))

    @property
    def shared(self) -> Path:
        return self._scratch / "shared"

    def put_clip(self, key: str, clip: CompactClip) -> None:
        self.clips[key] = self._bytes(lambda path: write_compact_clip(path, clip))

    def put_snapshot(self, key: str, revision: int, state: ClipState) -> None:
        self.snapshots[key, revision] = self._bytes(lambda path: write_clip_state(path, state))

    def drop_snapshot(self, key: str, revision: int) -> None:
        self.snapshots.pop((key, revision), None)

    def checkpoint(self, key: str) -> Path | None:
        content = self._checkpoints.get(key)
        return None if content is None else self._file(f"{key}-checkpoint.safetensors", content)

    def put_checkpoint(self, key: str, write: Callable[[Path], None]) -> None:
        self._checkpoints[key] = self._bytes(write)

    def rows(self, key: str) -> list[dict[str, Any]]:
        return self._rows.get(key, [])

    def put_row(self, key: str, row: dict[str, Any]) -> None:
        self._rows.setdefault(key, []).append(row)

    def drop_pieces(self, key: str) -> bool:
        return remove_stages(self.shared, int(key)) > 0

    def drop_progress(self, key: str) -> None:
        self._checkpoints.pop(key, None)
        self._rows.pop(key, None)
        discard(self._scratch / f"{key}-checkpoint.safetensors")
