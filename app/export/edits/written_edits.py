"""The edits that an export applies: those of the project, and the one that leaves nothing but an object."""

from __future__ import annotations

from typing import Protocol

from app.document.changes.object_changes import object_named
from app.document.project_document import ProjectDocument
from engine.editing.actions import Hide
from engine.editing.edit import Edit, ObjectTarget
from engine.editing.effects import EditStack


class Written(Protocol):
    """What a job says of it; see app.export.jobs.job."""

    @property
    def has_edits(self) -> bool: ...
    @property
    def object(self) -> str | None: ...


def written_edits(document: ProjectDocument, job: Written) -> EditStack:
    """The stack of an export.

    Raises:
        ProjectError: There is no such object; names those that there are.
    """
    if job.object is None:
        return document.stack() if job.has_edits else EditStack()
    edits = document.edits if job.has_edits else ()
    target = ObjectTarget(object_named(document, job.object).object_id)
    top = max((edit.edit_id for edit in edits), default=0) + 1
    alone = Edit(top, "", target, Hide(), is_inverted=True)
    return EditStack((*edits, alone), document.objects)  # without copies, which would stand beside it
