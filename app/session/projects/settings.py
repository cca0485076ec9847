"""The user's preferences: projects opened lately, and how often training is shown. A small JSON file in the user's
configuration folder.
"""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any, TypeVar

import msgspec

from app.export.export_choices import ExportChoices
from app.project.opening.opening_answers import LastAnswers
from app.project.recents import RecentProject, read_recents, recents_document, with_entry
from app.training.messages import LIVE_VIEWS
from engine.storage.json_files import JsonError, read_checked_json, write_checked_json
from engine.user_folders import config_dir

logger = logging.getLogger(__name__)

MAX_BYTES = 1 << 20
Value = TypeVar("Value")


class Settings:
    """Preferences, saved at once when they change. A file that cannot be read counts as empty, never as a failure.

    Attributes:
        recent: Projects that were opened lately, newest first.
        live_view: How often the clip that trains is shown anew: "off", "low" or "live".
        last_answers: Given when a capture was opened last.
        last_export: Choices of the last export.

    Args:
        path: The file; the platform's place when None.
    """

    def __init__(self, path: Path | None = None) -> None:
        self.path = config_dir() / "settings.json" if path is None else path
        document = _read(self.path)
        self.recent: list[RecentProject] = read_recents(document)
        self.live_view = found if (found := document.get("live_view")) in LIVE_VIEWS else "live"
        self.last_answers = _taken(document.get("opening"), LastAnswers)
        self.last_export = _taken(document.get("export"), ExportChoices)

    def set_last_answers(self, answers: LastAnswers) -> None:
        """Keep the answers given when a capture was opened."""
        self.last_answers = answers
        self._save()

    def set_last_export(self, choices: ExportChoices) -> None:
        """Keep the choices of an export."""
        self.last_export = choices
        self._save()

    def add_recent(self, entry: RecentProject) -> None:
        """Put a project first in the list of recent ones."""
        self._set_recent(with_entry(self.recent, entry))

    def forget_recent(self, folder: Path) -> None:
        """Take a project or capture out of the list; its files stay."""
        self._set_recent([entry for entry in self.recent if entry.folder != folder])

    def set_live_view(self, mode: str) -> None:
        """Keep how often the clip that trains is shown anew."""
        self.live_view = mode
        self._save()

    def _set_recent(self, entries: list[RecentProject]) -> None:
        self.recent = entries
        self._save()

    def _save(self) -> None:
        document = {"schema": 1, "live_view": self.live_view}
        document |= {"opening": msgspec.to_builtins(self.last_answers)} | recents_document(self.recent)
        document["export"] = msgspec.to_builtins(self.last_export)
        try:
            write_checked_json(self.path, document)
        except OSError as error:
            logger.warning("preferences could not be saved (%s) - %s", error.strerror, self.path)


def _taken(found: Any, kind: type[Value]) -> Value:
    """The values of a document; the usual ones where they are not valid."""
    try:
        return kind() if found is None else msgspec.convert(found, kind)
    except msgspec.ValidationError:
        return kind()


def _read(path: Path) -> dict[str, Any]:
    """The document; empty where it is missing or damaged."""
    try:
        document = read_checked_json(path, max_bytes=MAX_BYTES)
        for name in ("projects", "recent"):
            if not isinstance(document.get(name, []), list):
                raise JsonError(f'its entry "{name}" is not a list')
    except FileNotFoundError:
        return {}
    except (OSError, JsonError) as error:
        logger.warning("preferences could not be read (%s) - %s", error, path)
        return {}
    return document
