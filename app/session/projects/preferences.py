"""The user's preferences for all projects: theme, keys, layouts of the panels, memory for decoded frames. A checked
JSON file next to the other preferences.

Knows no window: names of keys and actions, and layouts, are plain values that only `ui` understands.
"""

from __future__ import annotations

import logging
import threading
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta

from engine.backends.table import AUTO, choose_backend
from engine.errors import EngineError
from engine.storage.json_files import read_checked_json, write_checked_json
from engine.user_folders import config_dir

logger = logging.getLogger(__name__)

SCHEMA = 1
WRITING_TIMEOUT_S = 5.0
MAX_BYTES = 4 << 20
CACHE_MB = (128, 65_536)
"""Least and most memory for decoded frames."""
MAX_WORKERS = 256
MAX_LAYOUTS = 40
MAX_USED = 30
"""Actions that the palette remembers."""
Word = Annotated[str, Meta(max_length=200)]


class Preferences(msgspec.Struct):
    """The values.

    Attributes:
        theme: Colours of the window; "system" follows the desktop.
        backend: For computing from the next start on, see engine.backends.table.
        cache_mb: Memory for decoded frames; None for as much as is usual.
        n_workers: How many clips train side by side, as far as the computer allows it.
        projects_dir: Default folder of projects; empty for the usual one.
        keys: By the name of an action, the user's keys instead of the usual ones; an empty list for none.
        layouts: By name, where the panels are, as text of the window's.
        used_actions: Names of actions chosen in the palette, newest first.
    """

    theme: Literal["dark", "light", "system"] = "dark"
    backend: Word = AUTO
    cache_mb: Annotated[int, Meta(ge=CACHE_MB[0], le=CACHE_MB[1])] | None = None
    n_workers: Annotated[int, Meta(ge=1, le=MAX_WORKERS)] = 1
    projects_dir: Annotated[str, Meta(max_length=4096)] = ""
    keys: dict[Word, Annotated[list[Word], Meta(max_length=8)]] = msgspec.field(default_factory=dict)
    layouts: Annotated[dict[Word, Annotated[str, Meta(max_length=100_000)]], Meta(max_length=MAX_LAYOUTS)] = (
        msgspec.field(default_factory=dict)
    )
    used_actions: list[Word] = msgspec.field(default_factory=list)

    def choose_backend(self) -> None:
        """Compute with the preferred back end in this process; where it does not work, with the best one."""
        try:
            choose_backend(self.backend)
        except EngineError as error:
            logger.warning('the preference "backend" is ignored: %s', error)

    def note_used(self, action_id: str) -> None:
        """Put an action first among those that the palette remembers."""
        self.used_actions = [action_id, *(known for known in self.used_actions if known != action_id)][:MAX_USED]


class PreferencesFile:
    """The preferences and the file they are kept in.

    Attributes:
        values: Changed in place; `save` writes them if they differ from those on disk.
        failure: Why they could not be written; empty while they could.

    Args:
        path: The file; the platform's place when None.
    """

    def __init__(self, path: Path | None = None) -> None:
        self.path = config_dir() / "preferences.json" if path is None else path
        self.values = _read(self.path)
        self.failure = ""
        self._saved = _document(self.values)
        self._writing: threading.Thread | None = None

    def save(self) -> None:
        """Write the file now if something changed. A disk that refuses costs the change at the next start, no more."""
        if self._writing is not None:
            self._writing.join(WRITING_TIMEOUT_S)
        document = _document(self.values)
        if document != self._saved:
            self._write(document)

    def save_soon(self) -> None:
        """The same on a thread, as a busy disk may take its time."""
        document = _document(self.values)
        is_writing = self._writing is not None and self._writing.is_alive()
        if document != self._saved and not is_writing:  # else the next time
            self._writing = threading.Thread(target=self._write, args=(document,), name="preferences", daemon=True)
            self._writing.start()

    def _write(self, document: dict[str, Any]) -> None:
        try:
            write_checked_json(self.path, document)
            self.failure = ""
        except (OSError, EngineError) as error:
            logger.log(
                logging.DEBUG if self.failure else logging.WARNING,
                "preferences could not be saved (%s) - %s",
                error,
                self.path,
            )
            self.failure = getattr(error, "strerror", None) or str(error)
        self._saved = document


def _document(values: Preferences) -> dict[str, Any]:
    return {"schema": SCHEMA} | msgspec.to_builtins(values)


def _read(path: Path) -> Preferences:
    """The values in a file. One that is not valid is left out, and the others are taken."""
    preferences = Preferences()
    try:
        found = read_checked_json(path, max_bytes=MAX_BYTES)
    except FileNotFoundError:
        return preferences
    except (OSError, ValueError, EngineError) as error:
        logger.warning("preferences could not be read (%s) - %s", error, path)
        return preferences
    for field in msgspec.structs.fields(Preferences):
        if field.name not in found:
            continue
        try:
            setattr(preferences, field.name, msgspec.convert(found[field.name], field.type))
        except msgspec.ValidationError as error:
            if field.name in ("keys", "layouts") and isinstance(found[field.name], dict):
                setattr(preferences, field.name, _sound_entries(found[field.name], field, path))
            else:
                logger.warning('the preference "%s" is ignored (%s) - %s', field.name, error, path)
    return preferences


def _sound_entries(found: dict[str, Any], field: msgspec.structs.FieldInfo, path: Path) -> dict[str, Any]:
    """The valid entries of a dictionary."""
    sound: dict[str, Any] = {}
    for name, value in found.items():
        try:
            sound |= msgspec.convert({name: value}, field.type)
        except msgspec.ValidationError as error:
            logger.warning('the preference "%s" is ignored (%s) - %s', f"{field.name}: {name}"[:120], error, path)
    return dict(list(sound.items())[-MAX_LAYOUTS:]) if field.name == "layouts" else sound
