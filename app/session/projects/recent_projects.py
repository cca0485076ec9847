"""RecentProjects: projects opened lately, how far they were trained, and which are still there."""

from __future__ import annotations

import logging
from datetime import UTC, datetime
from pathlib import Path

from app.background.jobs import Jobs
from app.project.clips.clip_catalog import ClipCatalog
from app.project.opening.opened_project import OpenedProject
from app.project.projects_folder import project_name
from app.project.recents import RecentProject, missing_folders
from app.session.projects.project_pictures import ProjectPictures
from app.session.projects.settings import Settings
from engine.capture.formats.imported import finished_word
from engine.training.presets import closest_preset

logger = logging.getLogger(__name__)


class RecentProjects:
    """The list in the user's preferences. For one thread, which does not wait for the disks that projects lie on.

    Attributes:
        missing: Folders that are not there any more, as far as they were looked for.
        pictures: Small ones of projects.
    """

    def __init__(self, settings: Settings) -> None:
        self.missing: frozenset[Path] = frozenset()
        self.pictures = ProjectPictures()
        self._settings, self._looks = settings, Jobs()

    @property
    def entries(self) -> list[RecentProject]:
        """Newest first."""
        return self._settings.recent

    def keep(self, opened: OpenedProject, catalog: ClipCatalog) -> None:
        """Put a project, as far as it is trained now, first in the list."""
        place = str(Path(opened.capture.path).resolve())
        folder = opened.project.folder.resolve()
        now = datetime.now(UTC).isoformat(timespec="seconds")
        name = project_name(folder, place)
        has_pictures, n_trained = opened.capture.has_pictures, catalog.n_trained
        preset = closest_preset(opened.project.settings.overrides) if has_pictures else ""
        word = finished_word(has_pictures=has_pictures)
        self._settings.add_recent(RecentProject(str(folder), place, name, n_trained, len(catalog), now, preset, word))

    def forget(self, folder: Path) -> None:
        """Take one out of the list; its files stay."""
        self._settings.forget_recent(folder)

    def look(self) -> None:
        """See on a thread which of them are still there: a network folder may take its time."""
        entries = tuple(self.entries)
        self.pictures.read(tuple(entry.folder for entry in entries))

        def found(missing: frozenset[Path]) -> None:
            self.missing = missing

        def failed(error: Exception) -> None:
            logger.warning("recent projects could not be read: %s", error)

        self._looks.start("Looking for recent projects", lambda context: missing_folders(entries), found, failed)

    def poll(self) -> None:
        """Take in the results."""
        self._looks.poll()
        self.pictures.poll()

    def close(self) -> None:
        """End the threads, without waiting for a slow disk; the last small picture is still written."""
        self._looks.close(timeout_s=0.1)
        self.pictures.close()
