"""Projects that were opened lately, as the preferences keep them: where each lies and how far it was trained."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from app.document.storing.document_file import PROJECT_FILE
from engine.capture.formats.imported import finished_word

MAX_RECENT = 12


@dataclass(frozen=True, slots=True)
class RecentProject:
    """A project and what was known of it when it was last open. A value.

    Attributes:
        project: Its folder; empty where only the capture is known, as in files of earlier versions.
        capture: Folder of its capture.
        name: As shown to the user.
        n_trained, n_clips: Clips that are finished, and all of them; both 0 where unknown.
        opened: When it was last open, as ISO 8601 in UTC; empty where unknown.
        preset: The one that its settings begin with; empty where unknown.
        word: For clips that are finished.
    """

    project: str
    capture: str
    name: str
    n_trained: int = 0
    n_clips: int = 0
    opened: str = ""
    preset: str = ""
    word: str = "trained"

    @property
    def folder(self) -> Path:
        """The folder to open: the project where it is known."""
        return Path(self.project or self.capture)

    @property
    def trained_text(self) -> str:
        """Progress of its training, in words."""
        if not self.project:
            return "capture"
        return f"{self.n_trained} of {self.n_clips} clips {self.word}" if self.n_clips else "project"


def read_recents(document: dict[str, Any]) -> list[RecentProject]:
    """The list in a document of preferences, newest first; entries that are not valid are left out.

    Earlier versions kept folders of captures only, under another name: those without a project come last.
    """
    entries = [found for values in _list(document.get("projects")) if (found := _entry(values)) is not None]
    known = {entry.capture for entry in entries} | {entry.project for entry in entries}
    captures = [text for text in _list(document.get("recent")) if isinstance(text, str) and text not in known]
    return [*entries, *(RecentProject("", text, Path(text).name) for text in dict.fromkeys(captures))][:MAX_RECENT]


def recents_document(entries: Iterable[RecentProject]) -> dict[str, Any]:
    """Inverse of `read_recents`."""
    return {
        "projects": [asdict(entry) for entry in entries if entry.project],
        "recent": [entry.capture for entry in entries if not entry.project],
    }


def with_entry(entries: Sequence[RecentProject], entry: RecentProject) -> list[RecentProject]:
    """The list with an entry in front; its project, or its capture where that stood alone, is not listed twice."""
    others = [
        known
        for known in entries
        if known.folder != entry.folder and (known.project or known.capture not in (entry.capture, entry.project))
    ]
    return [entry, *others][:MAX_RECENT]


def missing_folders(entries: Iterable[RecentProject]) -> frozenset[Path]:
    """Folders of entries that no longer exist. Asks the disk."""
    return frozenset(entry.folder for entry in entries if not _is_there(entry))


def _is_there(entry: RecentProject) -> bool:
    try:
        return (entry.folder / PROJECT_FILE).is_file() if entry.project else entry.folder.is_dir()
    except OSError:
        return False


def _list(value: Any) -> list[Any]:
    return value if isinstance(value, list) else []


def _entry(values: Any) -> RecentProject | None:
    if not isinstance(values, dict) or not all(isinstance(values.get(key), str) for key in ("project", "capture")):
        return None
    folder = values["project"] or values["capture"]
    name, opened, preset = values.get("name"), values.get("opened"), values.get("preset")
    n_trained, n_clips = values.get("n_trained"), values.get("n_clips")
    return RecentProject(
        values["project"],
        values["capture"],
        name if isinstance(name, str) else Path(folder).name,
        n_trained if isinstance(n_trained, int) else 0,
        n_clips if isinstance(n_clips, int) else 0,
        opened if isinstance(opened, str) else "",
        preset if isinstance(preset, str) else "",
        finished_word(has_pictures=values.get("word") != finished_word(has_pictures=False)),
    )
