"""Finished pieces of a clip's preparation as files, so that one that was stopped or killed continues behind them.

prep/clip-0000-3.safetensors    some pieces of clip 0, as arrays "piece/array"

The pieces depend on nothing but the inputs in the key; a file with another key, or a damaged one, is removed with a
note. All are removed when the clip is finished.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from engine.cloud.kept_results import Arrays
from engine.errors import DiskError
from engine.progress import Progress, ReportProgress
from engine.storage.array_files import ArraysError, read_arrays, read_metadata, write_arrays
from engine.storage.files import discard
from engine.training.retired_settings import without_retired

VERSION = 4
"""To be raised whenever the code of any preparation step changes its result."""
WRITE_AFTER_S = 3.0
"""Pieces are written when so much work has gathered: shorter work is repeated rather than written."""
STAGE = "Starting"


class Stages:
    """Keeps the pieces of one clip's preparation.

    Args:
        prep_dir: Folder for the files; need not exist.
        clip_index: Of the clip.
        key: The inputs that every piece depends on; JSON-able.
        report: Gets one line about files taken over or removed.
        clock: Seconds; tests bring their own.
    """

    def __init__(
        self,
        prep_dir: Path,
        clip_index: int,
        key: Mapping[str, Any],
        report: ReportProgress,
        *,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._prep_dir, self._clip_index, self._report, self._clock = prep_dir, clip_index, report, clock
        self._key = json.dumps({"version": VERSION, **key}, sort_keys=True)
        self._found: dict[str, Path] | None = None
        self._pending: Arrays = {}
        self._pending_s = 0.0
        self._is_refused = False

    def keep(self, name: str, work: Callable[[], Arrays]) -> Arrays:
        """The result of a piece of work: kept from an earlier attempt, or done now and kept. A `Keep`."""
        if self._found is None:
            self._found = self._look()
        if name in self._found:
            arrays = self._read(name, self._found[name])
            if arrays is not None:
                return arrays
        started_s = self._clock()
        arrays = work()
        self._pending |= {f"{name}/{entry}": array for entry, array in arrays.items()}
        self._pending_s += self._clock() - started_s
        if self._pending_s >= WRITE_AFTER_S:
            self._write()
        return arrays

    def _look(self) -> dict[str, Path]:
        """Which file holds a piece, by the names of the pieces."""
        found: dict[str, Path] = {}
        n_stale = 0
        for path in stage_files(self._prep_dir, self._clip_index):
            try:
                texts, sizes = read_metadata(path, ("key",))
            except (OSError, ArraysError) as error:
                self._drop(path, str(error))
                continue
            if _current(texts.get("key", "")) != self._key:
                n_stale += 1
                discard(path)
                continue
            found |= {name.rpartition("/")[0]: path for name in sizes}
        if n_stale:
            self._say(f"{n_stale} files of an earlier preparation are outdated and were removed")
        if found:
            self._say(f"{len(found)} steps of the preparation are reused from an earlier attempt")
        return found

    def _read(self, name: str, path: Path) -> Arrays | None:
        try:
            arrays, _ = read_arrays(path, ("key",))
        except (OSError, ArraysError) as error:
            self._drop(path, str(error))
            assert self._found is not None
            self._found = {known: other for known, other in self._found.items() if other != path}
            return None
        prefix = f"{name}/"
        return {entry.removeprefix(prefix): array for entry, array in arrays.items() if entry.startswith(prefix)}

    def _write(self) -> None:
        pieces, self._pending, self._pending_s = self._pending, {}, 0.0
        taken = {path.name for path in stage_files(self._prep_dir, self._clip_index)}
        number = next(n for n in range(len(taken) + 1) if _file_name(self._clip_index, n) not in taken)
        path = self._prep_dir / _file_name(self._clip_index, number)
        try:
            write_arrays(path, pieces, {"key": self._key}, what="A finished step of the preparation")
            self._is_refused = False
        except DiskError as error:  # costs only time when it is stopped
            if not self._is_refused:
                self._say(f"{error.message} Preparation continues, but stopping it would lose all of it")
            self._is_refused = True

    def _drop(self, path: Path, reason: str) -> None:
        self._say(f"{path.name} is damaged ({reason}) and was removed; its part of the preparation is repeated")
        discard(path)

    def _say(self, message: str) -> None:
        self._report(Progress(STAGE, 1.0, message))


def _current(key: str) -> str:
    """A key as it would be written now: retired settings are left out."""
    try:
        values = json.loads(key)
        return json.dumps({**values, "config": without_retired(values["config"])}, sort_keys=True)
    except (ValueError, KeyError, TypeError, AttributeError):
        return key


def stage_files(prep_dir: Path, clip_index: int) -> list[Path]:
    """The files that a clip's preparation has kept."""
    return sorted(prep_dir.glob(f"clip-{clip_index:04d}-*.safetensors"))


def all_stage_files(prep_dir: Path) -> list[Path]:
    """The files that the preparations of all clips have kept."""
    return sorted(prep_dir.glob("clip-[0-9]*-*.safetensors"))


def remove_stages(prep_dir: Path, clip_index: int) -> int:
    """The clip is trained, or given up: forget the pieces of its preparation. Returns how many files have gone."""
    return sum(map(discard, stage_files(prep_dir, clip_index)))


def _file_name(clip_index: int, number: int) -> str:
    return f"clip-{clip_index:04d}-{number}.safetensors"
