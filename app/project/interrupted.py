"""What a killed program left half done is finished or taken back when the project is opened for writing."""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING

from engine.errors import ProjectError

if TYPE_CHECKING:
    from app.project.project import Project

logger = logging.getLogger(__name__)


def finish_interrupted(project: Project) -> None:
    """Take back clips that were put in place in part. A disk that refuses keeps it for the next time."""
    from app.project.mends.in_place import recover  # knows projects itself

    try:
        recover(project)
    except (ProjectError, OSError) as error:
        logger.warning("what was interrupted could not be taken back: %s", error)
