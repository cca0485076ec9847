"""Which changes of a project's document are allowed, whoever makes them: the window, a command or a script; and what
goes with a change of settings.
"""

from __future__ import annotations

from dataclasses import replace

from app.document.project_document import ProjectDocument
from app.document.project_settings import ProjectSettings
from app.project.claims.left_over import check_unclaimed
from app.project.disk.discarding import Discarded, discard, progress_of, training_of
from app.project.opening.project_access import check_settings
from app.project.project import Project
from engine.capture.capture import Capture
from engine.errors import ProjectError


class SettingsFixed(ProjectError):
    """A setting that all clips share cannot change, because a clip is finished or being trained."""


def check_change(
    project: Project, capture: Capture, before: ProjectDocument, after: ProjectDocument, *, is_training: bool = False
) -> None:
    """Check that settings fit the capture, and that no clip is finished with those that change.

    Args:
        is_training: Whether a clip trains now.
    Raises:
        SettingsFixed: One is, or is being trained.
        ProjectError: They do not fit.
        CaptureError: The scene was imported, so that no clip could be trained with other settings.
    """
    if before.settings == after.settings:
        return
    if not capture.has_pictures and not before.settings.is_placed_as(after.settings):
        capture.check_pictures()
    check_settings(after.settings, capture)
    if not is_shared_change(before.settings, after.settings):
        return
    if is_training:
        raise SettingsFixed("A clip is being trained with the present settings.", hint="Stop the training first.")
    check_unclaimed(project.folder)
    if project.has_finished_clips:
        raise SettingsFixed(
            "These settings are shared by all clips and fixed once one is finished; there "
            f"{_are(training_of(project))}.",
            hint="Start over with other settings, which discards the clips, or make a new project.",
            path=project.folder,
        )


def discard_unfitting(project: Project, before: ProjectSettings, after: ProjectSettings) -> Discarded:
    """The settings have changed: the progress of trainings that were stopped goes.

    Returns:
        What went.
    Raises:
        DiskError: The disk refused.
    """
    if not is_shared_change(before, after):
        return Discarded()
    found = progress_of(project)
    discard(project, found)
    return found


def is_shared_change(before: ProjectSettings, after: ProjectSettings) -> bool:
    """Whether something differs that every clip depends on."""
    if before.is_placed_as(after):
        return False
    placed = replace(after, capture=before.capture, follow_links=before.follow_links)
    return placed != before and not is_other_cut(before, placed)


def is_other_cut(before: ProjectSettings, after: ProjectSettings) -> bool:
    """Whether nothing differs but where clips begin and which is the reference: what may change at any time, because
    clips that do not fit keep their files and are out of use or out of date."""
    return (
        before != after and replace(before, clip_bounds=after.clip_bounds, reference_clip=after.reference_clip) == after
    )


def _are(training: Discarded) -> str:
    return f"{'is' if training.n_clips == 1 else 'are'} {training.words}"
