"""The user's preferences: projects opened lately. A small JSON file in the user's configuration folder."""

from __future__ import annotations

import logging
from pathlib import Path

from app.project.recents import RecentProject, read_recents, recents_document, with_entry
from engine.storage.json_files import JsonError, read_checked_json, write_checked_json
from engine.user_folders import config_dir

logger = logging.getLogger(__name__)

MAX_BYTES = 1 << 20


class Settings:
    """Preferences, saved at once when they change. A file that cannot be read counts as empty, never as a failure.

    Attributes:
        recent: Projects that were opened lately, newest first.

    Args:
        path: The file; the platform's place when None.
    """

    def __init__(self, path: Path | None = None) -> None:
        self.path = config_dir() / "settings.json" if path is None else path
        self.recent: list[RecentProject] = _read_recent(self.path)

    def add_recent(self, entry: RecentProject) -> None:
        """Put a project first in the list of recent ones."""
        self._set_recent(with_entry(self.recent, entry))

    def forget_recent(self, folder: Path) -> None:
        """Take a project or capture out of the list; its files stay."""
        self._set_recent([entry for entry in self.recent if entry.folder != folder])

    def _set_recent(self, entries: list[RecentProject]) -> None:
        self.recent = entries
        try:
            write_checked_json(self.path, {"schema": 1} | recents_document(entries))
        except OSError as error:
            logger.warning("preferences could not be saved (%s) - %s", error.strerror, self.path)


def _read_recent(path: Path) -> list[RecentProject]:
    try:
        document = read_checked_json(path, max_bytes=MAX_BYTES)
        for name in ("projects", "recent"):
            if not isinstance(document.get(name, []), list):
                raise JsonError(f'its entry "{name}" is not a list')
        return read_recents(document)
    except FileNotFoundError:
        return []
    except (OSError, JsonError) as error:
        logger.warning("preferences could not be read (%s) - %s", error, path)
        return []
