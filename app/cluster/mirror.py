"""Mirror: a copy of what one training needs, on a computer that does not see the project.

cluster/files/6f1c...       contents by hash: a video is kept once, whatever clips and projects need it
cluster/work/0a2b.../       one training: capture/, of links to these, and project/

Lies in the user's folder for caches and is bounded: what no training links to goes, the oldest first.
"""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Sequence
from contextlib import suppress
from hashlib import blake2b
from pathlib import Path

from app.project.lock import ProcessLock
from engine.clip_files.clip_state import read_clip_header
from engine.errors import DiskError, ProjectError
from engine.storage.files import atomic_path, disk_error, partial_path
from engine.user_folders import cache_dir

MAX_BYTES = 64 << 30
"""Of contents that no training uses now."""
MAX_WORK_AGE_S = 7 * 24 * 3600.0
DIGEST_BYTES = 20
_MAX_SIDE_BY_SIDE = 64


class Mirror:
    """The copy for one training, locked until this process ends. Methods raise DiskError where the disk refuses.

    Args:
        key: Names the training; one that comes back with the same key continues.
        root: Folder of all mirrors.
    """

    def __init__(self, key: str, root: Path | None = None) -> None:
        self._root = cache_dir() / "cluster" if root is None else root
        self._files = self._root / "files"
        self.folder, self._lock = self._taken(key)
        self.capture, self.project = self.folder / "capture", self.folder / "project"

    def _taken(self, key: str) -> tuple[Path, ProcessLock]:
        refused: Exception | None = None
        for number in range(_MAX_SIDE_BY_SIDE):  # a process taken for dead may still use the first
            folder = self._root / "work" / (f"{key}-{number}" if number else key)
            lock = ProcessLock(folder.with_name(f"{folder.name}.lock"))
            try:
                folder.mkdir(parents=True, exist_ok=True)
                self._files.mkdir(exist_ok=True)
                lock.acquire()
            except DiskError:
                raise
            except ProjectError as error:
                refused = error
                continue
            except OSError as error:
                raise disk_error(error, what="The copy of the project", path=folder) from error
            os.utime(folder)
            return folder, lock
        raise ProjectError("No folder for a copy of the project could be made.", path=self._root) from refused

    def missing(self, digests: Sequence[str]) -> list[str]:
        """Contents that have to be sent. Those that are here stay."""
        found = []
        for digest in dict.fromkeys(digests):
            try:
                os.utime(self._files / digest)
            except OSError:
                found.append(digest)
        return found

    def put(self, parts: Sequence[tuple[str, int, bytes, bool]]) -> None:
        """Take parts of contents: hash, place, bytes, and whether that was the last part."""
        for digest, offset, data, is_last in parts:
            partial = partial_path(self._files / digest)
            try:
                with open(partial, "r+b" if offset else "wb") as file:
                    file.seek(offset)
                    file.write(data)
                if is_last:
                    if file_digest(partial) != digest:
                        raise DiskError("A file arrived damaged.", hint="Try again.", path=partial)
                    os.replace(partial, self._files / digest)
            except OSError as error:
                with suppress(OSError):
                    partial.unlink()
                raise disk_error(error, what="The copy of the capture", path=partial) from error

    def build(self, names: Sequence[tuple[str, str]], key: str) -> int:
        """Link contents to their names. Whatever a capture or project had before and has no longer, goes.

        Args:
            names: Path below the folder, and hash.
            key: Of the clip.
        Returns:
            Steps of an unfinished training of the clip that is here; -1 where there is none.
        """
        try:
            wanted = dict(names)
            for path in sorted(self.capture.rglob("*")):
                if path.is_file() and path.relative_to(self.folder).as_posix() not in wanted:
                    path.unlink()
            for name, digest in wanted.items():
                self._place(digest, name)
        except OSError as error:
            raise disk_error(error, what="The copy of the project", path=self.folder) from error
        header = read_clip_header(self.project / "checkpoints" / f"{key}.safetensors")
        return -1 if header is None else header.step

    def _place(self, digest: str, name: str) -> None:
        path = self.folder / name
        if ".." in path.parts or not path.is_relative_to(self.folder):
            raise ValueError(f"{name} leads out of the folder")
        with atomic_path(path) as partial:
            if path.is_relative_to(self.capture):  # never changed in place, unlike curves
                with suppress(OSError):  # no links here
                    os.link(self._files / digest, partial)
                    return
            shutil.copyfile(self._files / digest, partial)

    def read(self, name: str, offset: int, n_bytes: int) -> bytes:
        """A part of a file of the project; empty behind its end, and where there is none."""
        try:
            with open(self.project / name, "rb") as file:
                file.seek(offset)
                return file.read(n_bytes)
        except FileNotFoundError:
            return b""

    def digest(self, name: str) -> str:
        """Of a file of the project; empty where there is none."""
        path = self.project / name
        return file_digest(path) if path.is_file() else ""

    def forget(self) -> None:
        """Its training is over: the copy goes, contents stay as long as there is room."""
        shutil.rmtree(self.folder, ignore_errors=True)
        self._lock.release()
        self._prune()

    def _prune(self) -> None:
        now_s = time.time()
        with suppress(OSError):
            for folder in (self._root / "work").iterdir():
                if folder.is_dir() and now_s - folder.stat().st_mtime > MAX_WORK_AGE_S:
                    shutil.rmtree(folder, ignore_errors=True)
            found = [(path, path.stat()) for path in self._files.iterdir()]
            unused = sorted((state.st_mtime, path, state.st_size) for path, state in found if state.st_nlink == 1)
            too_many = sum(size for _, _, size in unused) - MAX_BYTES
            for _, path, size in unused:
                if too_many <= 0:
                    break
                path.unlink()
                too_many -= size


def file_digest(path: Path, n_bytes: int | None = None) -> str:
    """Hash of a file, or of its beginning. Raises OSError."""
    digest, left = blake2b(digest_size=DIGEST_BYTES), n_bytes
    with open(path, "rb") as file:
        while data := file.read(1 << 20 if left is None else min(1 << 20, left)):
            digest.update(data)
            left = None if left is None else left - len(data)
    return digest.hexdigest()
