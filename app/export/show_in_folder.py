"""Shows a file or folder in the file manager of the system."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

from engine.errors import EngineError, ProjectError

TIMEOUT_S = 20.0


def show_in_folder(path: Path) -> None:
    """Open the folder that something was written into. Waits until the file manager has taken it, so call it on a
    thread.

    Raises:
        EngineError: It is no longer there, or there is no file manager; says where it is.
    """
    if not path.exists():
        raise ProjectError("The file no longer exists.", path=path)
    command = _command(path)
    if command is None:
        raise ProjectError("No file manager found.", hint="Open the folder by hand.", path=path)
    try:
        # its output would be for a terminal, and it must not end with this program
        done = subprocess.run(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            timeout=TIMEOUT_S,
            check=False,
            start_new_session=True,
        )
    except subprocess.TimeoutExpired:  # it has not detached itself, so it is at work
        return
    except OSError as error:
        raise _failure(path, error.strerror or str(error)) from error
    if done.returncode and command[0] != "explorer":  # which always says 1
        raise _failure(path, f"it ended with code {done.returncode}")


def _command(path: Path) -> list[str] | None:
    """The command to run; None where there is none."""
    if sys.platform == "win32":
        return ["explorer", f"/select,{path}"]
    if sys.platform == "darwin":
        return ["open", "-R", str(path)]
    program = shutil.which("xdg-open")
    return None if program is None else [program, str(path if path.is_dir() else path.parent)]


def _failure(path: Path, reason: str) -> EngineError:
    return ProjectError(f"The file manager could not be opened ({reason}).", hint="Open the folder by hand.", path=path)
