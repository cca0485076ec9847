"""ProjectPictures: makes and reads the small pictures of projects, on threads: of the shown frame when a clip is
finished or the project is left, else the first picture of the capture's first camera.
"""

from __future__ import annotations

import logging
from pathlib import Path

from app.background.jobs import JobContext, Jobs
from app.background.kernels import prepare_drawing
from app.playback.frame_decoder import ShownFrame
from app.playback.modes.arrays import Picture
from app.playback.modes.view_modes import PLAIN
from app.playback.render import RenderRequest, RenderView, render
from app.playback.views.orbit_view import OrbitView
from app.project.opening.opened_project import OpenedProject
from app.project.project_picture import SIZE, picture_path, read_picture, write_picture
from engine.backends.table import process_backend
from engine.kernels.cache import is_cache_warm

logger = logging.getLogger(__name__)

NO_KEY = (0, "", 0, "", "", PLAIN, 0)
"""Of the frame: nobody asks for this picture again."""
CLOSE_S = 3.0
"""The last picture is waited for no longer than this."""


class ProjectPictures:
    """For one thread, which does not wait.

    Attributes:
        found: By folder, pictures that were read; those of folders without one are left out.
        revision: Goes up whenever `found` changes.
    """

    def __init__(self) -> None:
        self.found: dict[Path, Picture] = {}
        self.revision = 0
        self._jobs = Jobs()

    def keep(self, opened: OpenedProject, shown: ShownFrame | None, view: OrbitView) -> None:
        """Make the picture of a project.

        Args:
            shown: The shown frame; without it the capture's own picture serves, unless there is one.
            view: From where.
        """
        folder = opened.project.folder.resolve()
        look = RenderView.of(view, *SIZE)

        def work(context: JobContext) -> None:
            if shown is not None and is_cache_warm():  # compiling kernels for it would take a minute
                prepare_drawing()
                write_picture(folder, render(RenderRequest(NO_KEY, look, shown), process_backend()).image)
            elif opened.capture.has_pictures and not picture_path(folder).is_file():
                write_picture(folder, opened.capture.frame(0, 0))

        self._jobs.start("Picture of the project", work, lambda _: None, _note)

    def read(self, folders: tuple[Path, ...]) -> None:
        """Read the pictures of projects; they are in `found` a moment later."""

        def work(context: JobContext) -> dict[Path, Picture]:
            images = {folder: read_picture(folder) for folder in folders}
            return {folder: Picture(image, key=folder) for folder, image in images.items() if image is not None}

        def take(found: dict[Path, Picture]) -> None:
            if found:
                self.found = found
                self.revision += 1

        self._jobs.start("Pictures of projects", work, take, _note)

    def poll(self) -> None:
        """Take in the pictures that were read."""
        self._jobs.poll()

    def close(self) -> None:
        """Let the last picture be written."""
        self._jobs.close(CLOSE_S)


def _note(error: Exception) -> None:
    """A picture that could not be made or read costs that picture, nothing else."""
    logger.info("the small picture of a project: %s", error)
