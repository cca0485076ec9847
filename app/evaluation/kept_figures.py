"""Figures of measured pictures, kept in the project they are of: nothing is measured twice, or lost by an interruption.

PROJECT/evaluations holds one file per clip and choice of figures. Its first line names everything that the figures
depend on; then each picture, and each pair of neighbouring frames, has its own line with a checksum, written when it is
measured. A file of another version of the clip is replaced. Unreadable lines count as not measured.
"""

from __future__ import annotations

import contextlib
import logging
from collections.abc import Callable, Iterator
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, BinaryIO

from engine.metrics.clips.seams import PairRow
from engine.metrics.clips.summary import EvalRow
from engine.metrics.columns import COLUMNS
from engine.storage.files import atomic_path, check_folder, open_to_append
from engine.storage.json_files import checked_line, read_checked_lines
from engine.storage.typed_json import to_type

logger = logging.getLogger(__name__)

EVALUATIONS = "evaluations"
"""Folder of a project for figures that were measured."""
MAX_BYTES = 512 << 20
"""About 300,000 pictures of one clip."""
_FORMER_KEYS = {"holdout", "lpips"}
"""Further keys in files of earlier versions, which kept optical flow and LPIPS; these are skipped."""
Key = tuple[str, int]
"""Name of the camera, and frame; of a pair, the later one."""


class KeptFigures:
    """Figures of one clip, as far as they are measured. Owns its file while `writing`.

    Args:
        path: The file; need not exist.
        content: Everything the figures depend on, JSON-able.
        before: Fingerprint of the clip before, which pairs at the boundary depend on too; None without one.
        say: Receives sentences for the user.

    Attributes:
        rows: By camera and frame.
        pairs: Likewise.
        is_writable: False once something could not be written.
    """

    def __init__(self, path: Path, content: dict[str, Any], before: str | None, say: Callable[[str], None]) -> None:
        self.path, self._content, self._before, self._say = path, content, before, say
        self.rows: dict[Key, EvalRow] = {}
        self.pairs: dict[Key, PairRow] = {}
        self._file: BinaryIO | None = None
        self._is_of_this_clip = False
        self.is_writable = True
        self._read(say)

    def add(self, item: EvalRow | PairRow) -> None:
        """Add a figure, and write it while `writing`."""
        found: dict[str, Any] = {"before": self._before} if isinstance(item, PairRow) and item.is_boundary else {}
        if isinstance(item, EvalRow):
            self.rows[item.camera, item.frame_index] = item
            found["row"] = asdict(item)
        else:
            self.pairs[item.camera, item.frame_index] = item
            found["pair"] = asdict(item)
        if self._file is None:
            return
        try:
            self._file.write(checked_line(found).encode())
            self._file.flush()
        except OSError as error:
            self._file = None
            self._say_unkept(error)

    @contextlib.contextmanager
    def writing(self) -> Iterator[None]:
        """Write figures added inside the block. If that fails, the reason is reported and the work continues."""
        with contextlib.ExitStack() as stack:
            try:
                check_folder(self.path.parent)
                if not self._is_of_this_clip:
                    self._read(lambda sentence: None)  # another process may have begun it meanwhile
                if not self._is_of_this_clip:
                    with atomic_path(self.path) as partial:
                        partial.write_text(checked_line(self._content), encoding="utf-8")
                    self._is_of_this_clip = True
                self._file = stack.enter_context(open(open_to_append(self.path), "ab+", buffering=0))
                self._end_last_line(self._file)
            except OSError as error:
                self._file = None
                self._say_unkept(error)
            try:
                yield
            finally:
                self._file = None

    @staticmethod
    def _end_last_line(file: BinaryIO) -> None:
        """A line cut off by a kill must not spoil the next one."""
        n_bytes = file.seek(0, 2)
        if n_bytes:
            file.seek(n_bytes - 1)
            is_ended = file.read(1) == b"\n"
            file.seek(0, 2)
            if not is_ended:
                file.write(b"\n")

    def _say_unkept(self, error: OSError) -> None:
        self.is_writable = False
        self._say(f"Figures are not kept ({error.strerror or error}) - {self.path}")

    def _read(self, say: Callable[[str], None]) -> None:
        try:
            lines, n_damaged = read_checked_lines(self.path, max_bytes=MAX_BYTES)
        except (FileNotFoundError, NotADirectoryError):
            return
        except OSError as error:
            say(f"Kept figures cannot be read and are measured again ({error.strerror or error}) - {self.path}")
            return
        if not lines or {k: v for k, v in lines[0].items() if k not in _FORMER_KEYS} != self._content:
            if n_damaged:
                say(f"Kept figures are damaged and are measured again - {self.path}")
            return
        self._is_of_this_clip = True
        for line in lines[1:]:
            try:
                self._take(line)
            except (KeyError, TypeError, ValueError):
                n_damaged += 1
        if n_damaged:
            say(f"{n_damaged} kept figures are damaged and are measured again - {self.path}")

    def _take(self, line: dict[str, Any]) -> None:
        if "row" in line:
            row = to_type(line["row"], EvalRow)
            figures = {name: row.figures[name] for name in COLUMNS}
            missing = {name: reason for name, reason in row.missing.items() if name in COLUMNS}
            self.rows[row.camera, row.frame_index] = replace(row, figures=figures, missing=missing)
            return
        pair = to_type(line["pair"], PairRow)
        if not pair.is_boundary or line["before"] == self._before:
            self.pairs[pair.camera, pair.frame_index] = pair
