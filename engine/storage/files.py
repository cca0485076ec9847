"""Files: written complete or not at all, read only where they are regular files of a bounded size."""

from __future__ import annotations

import errno
import os
import re
import shutil
import stat
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from engine.errors import DiskError
from engine.storage.process_space import process_space

PARTIAL_PREFIX = ".partial-"
"""Half-written files begin with this, then with the id of the process that writes them, and its space of ids."""
_PARTIAL_NAME = re.compile(rf"{re.escape(PARTIAL_PREFIX)}([0-9]{{1,9}})(?:@([0-9a-f]{{8}}))?-(.+)", re.DOTALL)
STALE_AFTER_S = 24 * 3600.0
"""A half-written file this old belongs to nobody, whoever may have its process id by now."""


def partial_path(path: Path) -> Path:
    """The name under which this process writes a file until it is complete. No other one that shares the folder has
    the same, of whatever computer."""
    return path.with_name(f"{PARTIAL_PREFIX}{os.getpid()}@{process_space()}-{path.name}")


@contextmanager
def atomic_path(path: Path | str, *, makes_parents: bool = True, is_durable: bool = False) -> Iterator[Path]:
    """Write to the yielded path; it becomes `path` when the block ends well and disappears when it does not.

    Args:
        path: Final name. The suffix is kept, so that writers which look at it work.
        makes_parents: Make all missing folders, or only the one that holds the file.
        is_durable: Whether content and name must outlive a power cut from here on; takes the time the disk takes.
    Raises:
        OSError: The disk refused; nothing is left behind.
    """
    path = Path(path)
    partial = partial_path(path)
    path.parent.mkdir(parents=makes_parents, exist_ok=True)
    try:
        yield partial
        replace_file(partial, path, is_durable=is_durable)
    finally:
        with suppress(OSError):
            partial.unlink(missing_ok=True)


def is_partial(path: Path) -> bool:
    """Whether this is the name of something that is not complete yet, or never will be."""
    return _PARTIAL_NAME.fullmatch(path.name) is not None


def partials_of(folder: Path, pid: int) -> list[Path]:
    """What a process of this computer has begun to write in a folder, and not finished. Raises OSError."""
    found = ((path, _PARTIAL_NAME.fullmatch(path.name)) for path in folder.iterdir())
    return [path for path, name in found if name and int(name[1]) == pid and name[2] in (None, process_space())]


@contextmanager
def atomic_folder(path: Path | str) -> Iterator[Path]:
    """Fill the yielded folder; it becomes `path` when the block ends well and disappears when it does not.

    Args:
        path: Does not exist, or is an empty folder.
    Raises:
        FileExistsError: There is something else under this name; nothing was done.
        OSError: The disk refused; nothing is left behind.
    """
    path = Path(path).absolute()
    if path.is_symlink() or (path.exists() and not (path.is_dir() and not any(path.iterdir()))):
        raise FileExistsError(errno.EEXIST, "this name is already taken", str(path))
    partial = partial_path(path)
    try:
        partial.mkdir(parents=True)
        yield partial
        with suppress(FileNotFoundError):
            path.rmdir()  # empty, or filled by somebody meanwhile, which raises
        partial.rename(path)
    finally:
        shutil.rmtree(partial, ignore_errors=True)


def is_left_over(path: Path, is_alive: Callable[[int], bool], *, of: str = "") -> bool:
    """Whether `atomic_path` or `atomic_folder` yielded this once, and nobody still writes it.

    Its process is dead then, or it is a day old; the latter is all that is known of one of another computer.

    Args:
        path: Of any name; those that are not made here are nobody's left-overs.
        is_alive: Tells of the id of a process whether there is one.
        of: Only what would have become this name; any where empty.
    """
    found = _PARTIAL_NAME.fullmatch(path.name)
    if found is None or of not in ("", found[3]):
        return False
    if found[2] in (None, process_space()) and not is_alive(int(found[1])):  # None: of a version before
        return True
    try:
        return time.time() - path.stat().st_mtime > STALE_AFTER_S
    except OSError:  # it is complete by now, or gone
        return False


def discard(path: Path) -> bool:
    """Remove a file, a link or a folder with all that is in it. Whether it is gone; what the disk refuses stays."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        with suppress(OSError):
            path.unlink()
    return not os.path.lexists(path)


def replace_file(source: Path, target: Path, *, is_durable: bool = False) -> None:
    """Rename a complete file to its final name, replacing what has that name.

    Args:
        is_durable: First the content goes to the disk, then the name: after a power cut there is the old file or the
            new one, never an empty one.
    Raises:
        OSError: The disk refused; `target` is as it was.
    """
    if is_durable:
        _to_disk(source, os.O_RDWR)
    os.replace(source, target)
    if is_durable and os.name != "nt":  # Windows has no handle of a folder to flush
        with suppress(OSError):  # the file is in its place; some network file systems refuse to flush a folder
            _to_disk(target.parent, os.O_RDONLY)


def _to_disk(path: Path, flags: int) -> None:
    handle = os.open(path, flags)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


@contextmanager
def checked_path(path: Path | str, *, what: str, is_durable: bool = False) -> Iterator[Path]:
    """`atomic_path` for files of a project: whatever the disk refuses is a DiskError.

    Args:
        path, is_durable: As of `atomic_path`.
        what: Names the file in the message, as "The clip".
    Raises:
        DiskError: The disk refused; nothing is left behind.
    """
    try:
        # only the last folder is made: a project that was deleted is not made again
        with atomic_path(path, makes_parents=False, is_durable=is_durable) as partial:
            yield partial
    except OSError as error:
        raise disk_error(error, what=what, path=path) from error


def disk_error(error: OSError, *, what: str, path: Path | str) -> DiskError:
    """The error to raise when a file could not be written."""
    is_full = error.errno in (errno.ENOSPC, getattr(errno, "EDQUOT", errno.ENOSPC))
    hint = "Free some space and try again." if is_full else "Check the disk and the rights of the folder."
    return DiskError(f"{what} could not be written ({error.strerror or error}).", hint=hint, path=path)


def open_regular(path: Path | str) -> BinaryIO:
    """Open a regular file for reading bytes; a pipe or a device, which would block or never end, is refused.

    Raises:
        OSError: It is missing, cannot be read or is not a regular file. `strerror` says which, in words.
    """
    try:
        # without O_NONBLOCK, opening a pipe waits for its writer
        handle = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    except ValueError as error:  # a NUL or half a character in the name
        raise OSError(errno.EINVAL, f"not a file name: {error}", str(path)) from error
    try:
        _check_regular(os.fstat(handle), path)
        return open(handle, "rb")
    except OSError:
        os.close(handle)
        raise


def open_to_append(path: Path | str) -> int:
    """Open a regular file at its end, or make it, and return its descriptor. A link is not followed, and a pipe or a
    device is refused: neither is what the program has made under this name.

    Raises:
        OSError: It cannot be opened, or is something else. `strerror` says what, in words.
    """
    flags = os.O_RDWR | os.O_APPEND | os.O_CREAT | getattr(os, "O_BINARY", 0)  # to read as well: so no pipe waits
    try:
        handle = os.open(path, flags | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0), 0o644)
    except OSError as error:
        if error.errno == errno.ELOOP:
            raise _is_link(path) from error
        if error.errno == errno.ENXIO:
            raise _is_no_file(path) from error
        raise
    try:
        _check_regular(os.fstat(handle), path)
    except OSError:
        os.close(handle)
        raise
    return handle


def check_folder(path: Path | str) -> None:
    """Check that a folder, if there is one, lies where its name is.

    Raises:
        OSError: There is something else, such as a symbolic link, or it cannot be looked at. `strerror` says which, in
            words.
    """
    try:
        mode = os.lstat(path).st_mode
    except FileNotFoundError:
        return
    if stat.S_ISLNK(mode):
        raise _is_link(path)
    if not stat.S_ISDIR(mode):
        raise NotADirectoryError(errno.ENOTDIR, "it is not a folder", str(path))


def read_bytes(path: Path | str, *, max_bytes: int) -> bytes:
    """The content of a regular file.

    Raises:
        OSError: As of `open_regular`, or it is larger than `max_bytes`. `strerror` says which, in words.
    """
    with open_regular(path) as file:
        n_bytes = os.fstat(file.fileno()).st_size
        if n_bytes > max_bytes:
            raise OSError(errno.EFBIG, f"{n_bytes} bytes, at most {max_bytes} are read", str(path))
        data = file.read(n_bytes + 1)  # reading takes as much memory as it is asked for
        if len(data) > n_bytes:
            data += file.read(max_bytes + 1 - len(data))
    if len(data) > max_bytes:  # it grew, or its size is not known, as in /proc
        raise OSError(errno.EFBIG, f"more than {max_bytes} bytes", str(path))
    return data


def check_regular(path: Path | str) -> int:
    """Check that libraries which open by name will open a regular file. Returns its size in bytes.

    Raises:
        OSError: It is missing or something else; `strerror` says what.
    """
    try:
        found = os.stat(path)
    except ValueError as error:
        raise OSError(errno.EINVAL, f"not a file name: {error}", str(path)) from error
    _check_regular(found, path)
    return found.st_size


def _check_regular(found: os.stat_result, path: Path | str) -> None:
    if stat.S_ISDIR(found.st_mode):
        raise IsADirectoryError(errno.EISDIR, "it is a folder, not a file", str(path))
    if not stat.S_ISREG(found.st_mode):
        raise _is_no_file(path)


def _is_no_file(path: Path | str) -> OSError:
    return OSError(errno.EINVAL, "it is a pipe or a device, not a file", str(path))


def _is_link(path: Path | str) -> OSError:
    return OSError(errno.ELOOP, "it is a symbolic link", str(path))
