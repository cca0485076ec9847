"""Work that a killed program left half done is finished or taken back when the project is opened for writing."""

from __future__ import annotations

import logging

from app.project.clips.clip_versions import finish_restoring
from app.project.clips.finished_clip import take_in_left_over
from app.project.mends.in_place import recover
from app.project.project import Project
from engine.errors import ProjectError

logger = logging.getLogger(__name__)


def finish_interrupted(project: Project) -> None:
    """Take back clips that were put in place in part, end what was being restored, and take in what was trained. A disk
    that refuses keeps it for the next time."""
    finish_restoring(project.folder)
    try:
        recover(project)
    except (ProjectError, OSError) as error:
        logger.warning("an interrupted change could not be undone: %s", error)
    take_in_left_over(project)
