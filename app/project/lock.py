"""ProcessLock: one process at a time writes to a folder. The system holds the lock; a file next to it says whose it is.

The system's lock (`filelock`, on ".lock") ends with its process, however that ends, so nothing a killed program leaves
behind is in the way. The file "lock" names the owner: for messages, for versions before, which know nothing else, and
for owners on other machines that share the folder, whose system locks may not reach us. Such an owner cannot be asked
whether it lives, so its lock is never taken over.
"""

from __future__ import annotations

import errno
import json
import os
import platform
import stat
import sys
import uuid
import warnings
from contextlib import suppress
from dataclasses import asdict, dataclass
from datetime import datetime
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from engine.errors import ProjectError
from engine.storage.files import atomic_path, disk_error
from engine.storage.json_files import JsonError, read_json_object
from engine.storage.process_space import boot_id
from engine.text import printable

if TYPE_CHECKING:
    from filelock import BaseFileLock

MAX_OWNER_BYTES = 4096
"""A record of who owns a lock is shorter; a longer file is something else."""
_UNSUPPORTED = {errno.ENOLCK, errno.ENOTSUP, errno.EOPNOTSUPP, errno.ENOSYS, errno.EINVAL}
"""Error numbers of file systems without locks."""


def is_process_alive(pid: int) -> bool:
    """Whether a process of this id exists, of any user."""
    if not 0 < pid < 2**32:
        return False
    if sys.platform == "win32":  # os.kill would end the process there
        import ctypes

        handle = ctypes.windll.kernel32.OpenProcess(0x1000, False, pid)  # PROCESS_QUERY_LIMITED_INFORMATION
        if handle:
            ctypes.windll.kernel32.CloseHandle(handle)
        return bool(handle)
    try:
        os.kill(pid, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except PermissionError:
        return True
    return True


def process_start(pid: int) -> str:
    """When a process started, in the system's own ticks, so that a reused id is noticed. Empty where unknown."""
    try:
        text = Path(f"/proc/{pid}/stat").read_text()
        return text.rpartition(")")[2].split()[19]  # field 22; the name in parentheses may hold spaces
    except (OSError, ValueError, IndexError):
        return ""


@cache
def machine_id() -> str:
    """Distinguishes this machine from others of its name, after a restart too."""
    for name in ("/etc/machine-id", "/var/lib/dbus/machine-id"):
        with suppress(OSError, ValueError):
            text = Path(name).read_text("ascii").strip()
            if text:
                return uuid.uuid5(uuid.NAMESPACE_OID, text).hex  # the file's own text is not for others to see
    node = uuid.getnode()
    return "" if node >> 40 & 1 else f"{node:012x}"  # that bit says that it was made up for this process


@dataclass(frozen=True, slots=True)
class LockOwner:
    """Who owns a lock, as its file says; empty texts are not known, as in files of versions before.

    Attributes:
        pid: Process id on its machine.
        start: See `process_start`.
        host: Name of the machine.
        machine: See `machine_id`.
        boot: See `boot_id`.
        since: When the lock was taken, local time.
    """

    pid: int
    start: str
    host: str = ""
    machine: str = ""
    boot: str = ""
    since: str = ""

    @property
    def is_here(self) -> bool:
        """Whether this machine would know if the owner lives."""
        if not self.host or (self.boot and self.boot == boot_id()):
            return True
        return (self.host, self.machine) == (platform.node(), machine_id())

    @property
    def is_alive(self) -> bool:
        """Whether the owner lives, on this machine; one that started at another time is another process."""
        return is_process_alive(self.pid) and (not self.start or process_start(self.pid) in ("", self.start))

    def words(self) -> str:
        """The owner as the subject of a sentence."""
        if self.host and not self.is_here:
            return f"A program on the computer {printable(self.host)} (process {self.pid})"
        return "This program" if self.pid == os.getpid() else f"Another process ({self.pid})"


def this_process() -> LockOwner:
    """This process as the owner of something, from now on."""
    return LockOwner(
        os.getpid(),
        process_start(os.getpid()),
        platform.node(),
        machine_id(),
        boot_id(),
        datetime.now().astimezone().isoformat(timespec="seconds"),
    )


class ProcessLock:
    """Owns one lock from `acquire` to `release`, which may be called by different threads.

    Args:
        path: The file that says who owns the lock. Its folder must exist.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.system_path = path.with_name(f".{path.name}")
        self.is_held = False
        self._system_lock: BaseFileLock | None = None
        self._owner: LockOwner | None = None

    def acquire(self) -> None:
        """Take the lock.

        Raises:
            ProjectError: A living process holds it, one on another machine may hold it, or the folder cannot be
                written.
        """
        self._check_kind(self.path)
        self._check_kind(self.system_path)
        self._system_lock = self._take_system_lock()
        try:
            owner = read_owner(self.path)
            if owner is not None and not owner.is_here:
                hint = f'Close it there first. If nothing runs there, remove the file "{self.path.name}".'
                raise self._is_taken(owner, hint=hint)
            if owner is not None and not owner.host and owner.is_alive:  # a version before, without a system lock
                raise self._is_taken(owner)
            self._write_owner()
        except BaseException:
            self._free_system_lock()
            raise
        self.is_held = True

    def release(self) -> None:
        """Give the lock back; a lock that is somebody else's by now is left alone."""
        if not self.is_held:
            return
        self.is_held = False
        with suppress(OSError):
            if read_owner(self.path) == self._owner:
                self.path.unlink()
        with suppress(OSError):
            self.system_path.unlink()  # whoever waits at the removed file notices that and opens a new one
        self._free_system_lock()

    def _take_system_lock(self) -> BaseFileLock:
        from filelock import FileLock, SoftFileLock, Timeout  # takes a while, and most commands only read

        lock: BaseFileLock = FileLock(self.system_path, thread_local=False)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # where the file system has no locks it says that it uses a plain file
                try:
                    lock.acquire(blocking=False)
                except OSError as error:
                    if isinstance(error, Timeout) or error.errno not in _UNSUPPORTED:
                        raise
                    lock = SoftFileLock(self.system_path, thread_local=False)
                    lock.acquire(blocking=False)
        except Timeout as error:
            raise self._is_taken(read_owner(self.path)) from error
        except OSError as error:
            raise self._cannot_be_written(error) from error
        return lock

    def _free_system_lock(self) -> None:
        if self._system_lock is not None:
            with suppress(OSError):
                self._system_lock.release()
            self._system_lock = None

    def _write_owner(self) -> None:
        self._owner = this_process()
        try:
            with atomic_path(self.path) as partial:  # whoever looks finds all of it, or nothing
                partial.write_text(json.dumps(asdict(self._owner)), encoding="utf-8")
        except OSError as error:
            raise self._cannot_be_written(error) from error

    def _check_kind(self, path: Path) -> None:
        """A lock is a file; a link is replaced, never followed. Raises ProjectError for a folder, pipe or device."""
        try:
            mode = path.lstat().st_mode
        except OSError:
            return
        if stat.S_ISLNK(mode) and path == self.system_path:
            with suppress(OSError):
                path.unlink()
        elif not stat.S_ISREG(mode) and not stat.S_ISLNK(mode):
            kind = "a folder" if stat.S_ISDIR(mode) else "not a regular file"
            raise ProjectError(f"The project's lock is {kind}.", hint="Move it away.", path=path)

    def _is_taken(self, owner: LockOwner | None, *, hint: str = "Close it there first.") -> ProjectError:
        who = "Another process" if owner is None else owner.words()
        since = f" since {printable(owner.since)}" if owner is not None and owner.since else ""
        return ProjectError(f"{who} has this project open for writing{since}.", hint=hint, path=self.path.parent)

    def _cannot_be_written(self, error: OSError) -> ProjectError:
        if error.errno in (errno.ENOSPC, getattr(errno, "EDQUOT", errno.ENOSPC)):
            return disk_error(error, what="The project's lock", path=self.path.parent)
        return ProjectError(
            f"The project folder cannot be written ({error.strerror or error}).",
            hint="Choose a folder you may write to.",
            path=self.path.parent,
        )


def read_owner(path: Path) -> LockOwner | None:
    """Who owns a lock; None where no file says so, or one that no program of ours can have written."""
    try:
        content = read_json_object(path, max_bytes=MAX_OWNER_BYTES)
    except (OSError, JsonError):
        return None
    if type(content.get("pid")) is not int:
        return None
    words = {name: content.get(name, "") for name in ("start", "host", "machine", "boot", "since")}
    if not all(isinstance(word, str) for word in words.values()):
        return None
    return LockOwner(content["pid"], **words)
