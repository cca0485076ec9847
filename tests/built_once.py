"""Folders that take seconds to build, such as trained clips: built once for all workers, and for later runs.

They lie in pytest's own cache folder, named by a hash of everything that they are made from. A copy is handed out, so
that no test can spoil what the next one gets.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterable
from contextlib import suppress
from hashlib import blake2b
from pathlib import Path

from filelock import FileLock, Timeout

from engine.kernels.cache import current_key

ROOT = Path(__file__).resolve().parents[1]
ALWAYS = ("engine", "assets/sample", "requirements.lock")
"""What every trained clip depends on."""
MAX_FOLDERS = 12
"""The newest ones stay: a few megabytes each."""
BUILD_LIMIT_S = 600.0
_MANIFEST = "manifest.json"


class BuiltOnce:
    """The store of built folders.

    Args:
        root: Where they lie; None builds each anew.
        max_folders: How many stay.
    """

    def __init__(self, root: Path | None, *, max_folders: int = MAX_FOLDERS) -> None:
        self._root, self._max_folders = root, max_folders

    def copy(self, name: str, folder: Path, build: Callable[[Path], object], *, sources: Iterable[str] = ()) -> Path:
        """Fill a folder with what `build` leaves in an empty one, or left there before. Returns the folder.

        Args:
            name: Of what is built; one word.
            folder: Need not exist, and must be empty.
            build: Leaves all its results as files below the folder that it is given.
            sources: Files and folders below the root that it depends on, beside ALWAYS.
        """
        if self._root is None:
            folder.mkdir(parents=True, exist_ok=True)
            build(folder)
            return folder
        kept = self._root / f"{name}-{_hash_of_sources((*ALWAYS, *sources))}"
        with FileLock(self._root / f"{name}.lock", timeout=BUILD_LIMIT_S):
            if not _is_whole(kept):
                self._build(kept, build)
            kept.touch()
            shutil.copytree(kept, folder, dirs_exist_ok=True, ignore=shutil.ignore_patterns(_MANIFEST))
        return folder

    def _build(self, kept: Path, build: Callable[[Path], object]) -> None:
        partial = kept.with_name(f"partial-{kept.name}")
        for path in (partial, kept):
            shutil.rmtree(path, ignore_errors=True)
        partial.mkdir(parents=True)
        build(partial)
        (partial / _MANIFEST).write_text(json.dumps(_hashes(partial)))
        partial.rename(kept)
        self._remove_old_ones(kept)

    def _remove_old_ones(self, kept: Path) -> None:
        """Other workers use the store meanwhile: what they hold the lock of stays, what they rename is passed over."""
        times: dict[Path, float] = {}
        for path in kept.parent.iterdir():
            with suppress(FileNotFoundError):
                if path.is_dir() and not path.name.startswith("partial-"):
                    times[path] = path.stat().st_mtime
        for path in sorted(times, key=lambda path: -times[path])[self._max_folders :]:
            if _name_of(path) == _name_of(kept):  # whose lock is ours
                if path != kept:
                    shutil.rmtree(path, ignore_errors=True)
                continue
            with suppress(Timeout), FileLock(kept.parent / f"{_name_of(path)}.lock", timeout=0):
                shutil.rmtree(path, ignore_errors=True)


def _name_of(kept: Path) -> str:
    """What was given as the name, of the folder that is kept."""
    return kept.name.rpartition("-")[0]


def _is_whole(kept: Path) -> bool:
    """Whether everything is there, with the bytes that were written."""
    try:
        return json.loads((kept / _MANIFEST).read_text()) == _hashes(kept)
    except (OSError, ValueError):
        return False


def _hashes(folder: Path) -> dict[str, str]:
    """Hash of each file by its path, the manifest left out."""
    files = sorted(path for path in folder.rglob("*") if path.is_file() and path != folder / _MANIFEST)
    return {path.relative_to(folder).as_posix(): _hash_of(path.read_bytes()) for path in files}


def _hash_of_sources(sources: Iterable[str]) -> str:
    digest = blake2b(digest_size=12)
    digest.update(f"{current_key().libraries} {current_key().processor}".encode())
    for source in sources:
        place = ROOT / source
        files = [place] if place.is_file() else sorted(path for path in place.rglob("*") if path.is_file())
        if not files:
            raise FileNotFoundError(f"nothing at {source}")
        for path in files:
            if "__pycache__" not in path.parts:
                digest.update(f"{path.relative_to(ROOT).as_posix()} {_hash_of(path.read_bytes())}\n".encode())
    return digest.hexdigest()


def _hash_of(content: bytes) -> str:
    return blake2b(content, digest_size=16).hexdigest()
