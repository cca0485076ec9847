# SPDX-License-Identifier: MIT
"""Files that were read lately, in bounded memory. No bpy here."""

from collections import OrderedDict
from pathlib import Path

from .ply import Cloud, read_cloud
from .problem import SequenceProblem

MAX_BYTES = 1 << 29
Stamp = tuple[int, int]


def stamp_of(path: Path) -> Stamp:
    """Changes whenever the file is written again: its time of change in ns, and its size in bytes.

    Raises:
        SequenceProblem: The file is gone.
    """
    try:
        found = path.stat()
    except OSError as error:
        cause = f"A file of the sequence cannot be read: {error.strerror}."
        raise SequenceProblem(cause, "Relink the sequence if it was moved.", path) from error
    return found.st_mtime_ns, found.st_size


class CloudCache:
    """Keeps the files used last, up to a number of bytes."""

    def __init__(self, max_bytes: int = MAX_BYTES) -> None:
        self._max_bytes, self._n_bytes = max_bytes, 0
        self._clouds: OrderedDict[Path, tuple[Stamp, Cloud]] = OrderedDict()

    def read(self, path: Path, stamp: Stamp) -> Cloud:
        """The contents of a file as of its stamp. Raises as `read_cloud` does."""
        kept = self._clouds.get(path)
        if kept is not None and kept[0] == stamp:
            self._clouds.move_to_end(path)
            return kept[1]
        cloud = read_cloud(path)
        if kept is not None:
            self._n_bytes -= kept[1].n_bytes
        self._clouds[path] = stamp, cloud
        self._clouds.move_to_end(path)
        self._n_bytes += cloud.n_bytes
        while self._n_bytes > self._max_bytes and len(self._clouds) > 1:
            self._n_bytes -= self._clouds.popitem(last=False)[1][1].n_bytes
        return cloud
