"""EditReaches: where the edits of the open project act, looked up again when clips or edits change."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from app.document.project_document import ProjectDocument
from app.project.clips.clip_anchors import clip_anchors
from app.training.service import TrainingService
from engine.editing.edit import Edit
from engine.editing.reach import ClipAnchors, Reach, reach_of_edit
from engine.editing.scene_object import Objects


class EditReaches:
    """For one thread. service: Gives the training of the open project, None without one."""

    def __init__(self, service: Callable[[], TrainingService | None]) -> None:
        self._service = service
        self._key: object = None
        self._clips: tuple[ClipAnchors, ...] = ()
        self._asked: tuple[tuple[Edit, ...], Objects] | None = None
        self._reaches: dict[int, Reach] = {}

    def clips(self) -> tuple[ClipAnchors, ...]:
        """Which anchors each clip has; none without a project."""
        service = self._service()
        if service is None:
            return ()
        key = (service, service.catalog.revision)
        if self._key != key:
            self._key, self._asked, self._reaches = key, None, {}
            self._clips = clip_anchors(service.project, service.clips, service.catalog)
        return self._clips

    def of(self, document: ProjectDocument) -> Mapping[int, Reach]:
        """Where each edit of a document acts, by number."""
        clips, asked = self.clips(), (document.edits, document.objects)
        if self._asked is None or any(a is not b for a, b in zip(self._asked, asked, strict=True)):
            self._asked = asked  # held, so that nothing else gets their place in memory
            edits, objects = asked
            self._reaches = {edit.edit_id: reach_of_edit(edit, clips, objects) for edit in edits}
        return self._reaches
