"""The user's preferences: recent folders. A small JSON file in the platform's configuration folder."""

from __future__ import annotations

import logging
import os
import sys
from pathlib import Path

from engine.json_files import JsonError, read_checked_json, write_checked_json

logger = logging.getLogger(__name__)

MAX_RECENT = 12
MAX_BYTES = 1 << 20


def config_dir() -> Path:
    """The user's folder for this program's configuration; need not exist."""
    if sys.platform == "win32":
        root = Path(os.environ.get("APPDATA") or Path.home() / "AppData" / "Roaming")
    elif sys.platform == "darwin":
        root = Path.home() / "Library" / "Application Support"
    else:
        root = Path(os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config")
    return root / "ClipGStream"


class Settings:
    """Preferences, saved at once when they change. A file that cannot be read counts as empty, never as a failure.

    Args:
        path: The file; the platform's place when None.
    """

    def __init__(self, path: Path | None = None) -> None:
        self.path = config_dir() / "settings.json" if path is None else path
        self.recent: list[str] = _read_recent(self.path)

    def add_recent(self, folder: Path) -> None:
        """Put a folder first in the list of recent ones."""
        text = str(Path(folder).resolve())
        self.recent = [text, *(known for known in self.recent if known != text)][:MAX_RECENT]
        try:
            write_checked_json(self.path, {"schema": 1, "recent": self.recent})
        except OSError as error:
            logger.warning("preferences could not be saved (%s) - %s", error.strerror, self.path)


def _read_recent(path: Path) -> list[str]:
    try:
        recent = read_checked_json(path, max_bytes=MAX_BYTES).get("recent")
        if not isinstance(recent, list) or not all(isinstance(folder, str) for folder in recent):
            raise JsonError("it has no list of recent folders")
        return recent[:MAX_RECENT]
    except FileNotFoundError:
        return []
    except (OSError, JsonError) as error:
        logger.warning("preferences could not be read (%s) - %s", error, path)
        return []
