"""The user's preferences: one small JSON document in the platform's configuration folder, saved when it changes."""

from __future__ import annotations

import json
import logging
import os
import sys
from pathlib import Path
from typing import Any

from app.recents import RecentProject, read_recents, recents_document, with_entry
from engine.files import atomic_path
from engine.json_files import JsonError, read_json_object

logger = logging.getLogger(__name__)


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
    """Preferences. A file that cannot be read counts as empty, never as a failure; entries of others are kept.

    Attributes:
        recent: Projects that were opened lately, newest first.

    Args:
        path: The file; the platform's place when None.
    """

    def __init__(self, path: Path | None = None) -> None:
        self.path = config_dir() / "settings.json" if path is None else path
        self._document = _read(self.path)
        self.recent: list[RecentProject] = read_recents(self._document)

    def get(self, name: str, default: Any = None) -> Any:
        """A preference as it was kept."""
        return self._document.get(name, default)

    def put(self, **entries: Any) -> None:
        """Keep preferences; values are JSON."""
        changed = {"schema": 1} | self._document | entries
        if changed == self._document:
            return
        self._document = changed
        try:
            with atomic_path(self.path) as partial:
                partial.write_text(json.dumps(changed, indent=2), encoding="utf-8")
        except OSError as error:
            logger.warning("preferences could not be saved (%s) - %s", error.strerror, self.path)

    def add_recent(self, entry: RecentProject) -> None:
        """Put a project first in the list of recent ones."""
        self.recent = with_entry(self.recent, entry)
        self.put(**recents_document(self.recent))

    def forget_recent(self, folder: Path) -> None:
        """Take a project or capture out of the list; its files stay."""
        self.recent = [entry for entry in self.recent if entry.folder != folder]
        self.put(**recents_document(self.recent))


def _read(path: Path) -> dict[str, Any]:
    try:
        return read_json_object(path)
    except FileNotFoundError:
        return {}
    except (OSError, JsonError) as error:
        logger.warning("preferences could not be read (%s) - %s", error, path)
        return {}
