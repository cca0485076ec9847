"""Which changes of a project's document are allowed, whoever makes them: the window, a command or a script."""

from __future__ import annotations

from dataclasses import replace

from app.document.project_document import ProjectDocument
from app.document.project_settings import ProjectSettings
from app.project.project import Project, check_settings
from engine.capture.capture import Capture
from engine.errors import ProjectError


def check_change(
    project: Project, capture: Capture, before: ProjectDocument, after: ProjectDocument, *, is_training: bool = False
) -> None:
    """See that settings fit the capture, and that nothing was learned with those that change.

    Args:
        is_training: Whether a clip trains now.
    Raises:
        ProjectError: They do not, or something was.
    """
    if before.settings == after.settings:
        return
    check_settings(after.settings, capture)
    if is_other_cut(before.settings, after.settings):
        return
    if project.has_progress or is_training:
        raise ProjectError(
            "What all clips share is fixed once training has begun.",
            hint="What was learned with them would be worthless. Use another project folder for other values.",
        )


def is_other_cut(before: ProjectSettings, after: ProjectSettings) -> bool:
    """Whether nothing differs but where clips begin and which is the reference: what may change at any time, because
    clips that do not fit keep their files and are out of use or out of date."""
    return (
        before != after and replace(before, clip_bounds=after.clip_bounds, reference_clip=after.reference_clip) == after
    )
