"""ProcessLock: a file that says which process writes to a folder. A lock left by a dead process is taken over."""

from __future__ import annotations

import json
import os
import sys
from contextlib import suppress
from pathlib import Path

from engine.errors import ProjectError


def is_process_alive(pid: int) -> bool:
    """Whether a process of this id exists, of any user."""
    if pid <= 0:
        return False
    if sys.platform == "win32":  # os.kill would end the process there
        import ctypes

        handle = ctypes.windll.kernel32.OpenProcess(0x1000, False, pid)  # PROCESS_QUERY_LIMITED_INFORMATION
        if handle:
            ctypes.windll.kernel32.CloseHandle(handle)
        return bool(handle)
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True


def process_start(pid: int) -> str:
    """When a process started, in the system's own ticks, so that a reused id is noticed. Empty where unknown."""
    try:
        text = Path(f"/proc/{pid}/stat").read_text()
    except OSError:
        return ""
    return text.rpartition(")")[2].split()[19]  # field 22; the name in parentheses may hold spaces


class ProcessLock:
    """Owns one lock file from `acquire` to `release`.

    Args:
        path: The lock file. Its folder must exist.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._text = json.dumps({"pid": os.getpid(), "start": process_start(os.getpid())})
        self.is_held = False

    def acquire(self) -> None:
        """Take the lock.

        Raises:
            ProjectError: A living process holds it, or the folder cannot be written.
        """
        for _ in range(3):
            try:
                descriptor = os.open(self.path, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o644)
            except FileExistsError:
                self._clear_stale()
                continue
            except OSError as error:
                raise ProjectError(
                    f"The project folder cannot be written ({error.strerror}).",
                    hint="Choose a folder you may write to.",
                    path=self.path.parent,
                ) from error
            with os.fdopen(descriptor, "w") as file:
                file.write(self._text)
            self.is_held = True
            return
        raise ProjectError(
            "Another program keeps taking the project's lock.", hint="Close it and try again.", path=self.path
        )

    def release(self) -> None:
        """Give the lock back; a lock that is somebody else's by now is left alone."""
        if self.is_held:
            self.is_held = False
            with suppress(OSError):
                if self.path.read_text() == self._text:
                    self.path.unlink()

    def _clear_stale(self) -> None:
        try:
            text = self.path.read_text()
        except OSError:
            return  # released in the meantime
        holder = _parse(text)
        if holder is not None:
            pid, start = holder
            is_same_process = not start or process_start(pid) in ("", start)
            if is_process_alive(pid) and is_same_process:
                who = "This program" if pid == os.getpid() else f"Another process ({pid})"
                raise ProjectError(
                    f"{who} has this project open for writing.", hint="Close it there first.", path=self.path.parent
                )
        # moved aside before it is judged for good: of two that find the same stale lock only one can move it
        aside = self.path.with_name(f"{self.path.name}.stale-{os.getpid()}")
        try:
            os.replace(self.path, aside)
        except OSError:
            return
        with suppress(OSError):
            if aside.read_text() != text:  # a fresh lock slipped in: put it back unless there is one again
                os.link(aside, self.path)
        with suppress(OSError):
            aside.unlink()


def _parse(text: str) -> tuple[int, str] | None:
    """Process id and start; None for a lock that was never finished."""
    try:
        content = json.loads(text)
        return int(content["pid"]), str(content.get("start", ""))
    except (ValueError, KeyError, TypeError):
        return None
