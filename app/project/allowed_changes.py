"""Which changes of a project's document are allowed, whoever makes them: the window, a command or a script."""

from __future__ import annotations

from app.document.project_document import ProjectDocument
from app.project.project import Project
from engine.errors import ProjectError


def check_change(
    project: Project, before: ProjectDocument, after: ProjectDocument, *, is_training: bool = False
) -> None:
    """See that nothing was learned with settings that change.

    Args:
        is_training: Whether a clip trains now.
    Raises:
        ProjectError: Something was.
    """
    if before.settings == after.settings:
        return
    if project.has_progress or is_training:
        raise ProjectError(
            "What all clips share is fixed once training has begun.",
            hint="What was learned with them would be worthless. Use another project folder for other values.",
        )
