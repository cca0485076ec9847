"""Which anchors of a project's clips can be left out for good, because its edits delete them wherever they exist."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from app.document.project_document import ProjectDocument
from app.project.clips.clip_versions import read_finished
from app.project.project import Project
from engine.backends.table import process_backend
from engine.capture.clip import Clip
from engine.clip_files.clip_state import ClipState
from engine.editing.actions import Delete
from engine.editing.edit import Edit
from engine.editing.scene_object import Objects
from engine.errors import ProjectError

if TYPE_CHECKING:
    from engine.editing.edited_clip import EditedClip

Rows = dict[str, np.ndarray]
"""Chosen rows of anchor sets, by role. [A] bool each"""
Report = Callable[[int, int], None]
"""Receives the number of clips done, and of all."""


@dataclass(frozen=True, slots=True, eq=False)
class ClipDeletions:
    """The anchors that one clip can lose.

    Attributes:
        fingerprint: Of the clip.
        own: Rows of the sets that the clip itself stores.
        inherited: Rows of the reference clip's sets that this clip shows at present and need not show.
        needed: Rows of the reference clip's sets that it continues to show.
    """

    clip_index: int
    fingerprint: str
    own: Rows = field(default_factory=dict)
    inherited: Rows = field(default_factory=dict)
    needed: Rows = field(default_factory=dict)

    @property
    def n_anchors(self) -> int:
        """Anchors that go."""
        return sum(int(rows.sum()) for rows in (*self.own.values(), *self.inherited.values()))


@dataclass(frozen=True, slots=True, eq=False)
class Deletions:
    """The anchors that the clips of a project can lose.

    Attributes:
        edits, objects: Of the document.
        clips: The finished clips, by index.
        untrained: Indices of the others, whose deletions are unknown.
        reference_index: Of the clip that others inherit from; None where none does.
    """

    edits: tuple[Edit, ...]
    objects: Objects
    clips: dict[int, ClipDeletions]
    untrained: tuple[int, ...]
    reference_index: int | None

    @property
    def gone_from_reference(self) -> Rows:
        """Anchors that the reference clip can lose: clips no longer show them. None where a clip is not trained."""
        index = self.reference_index
        if index is None or index not in self.clips or self.untrained:
            return {}
        others = [clip for other, clip in self.clips.items() if other != index]
        rows = {}
        for role, gone in self.clips[index].own.items():
            is_needed = [clip.needed[role] for clip in others if role in clip.needed]
            rows[role] = gone & ~np.any(is_needed, axis=0) if is_needed else gone.copy()
        return rows

    def own(self, clip_index: int) -> Rows:
        """Rows that a clip's own sets lose."""
        return self.gone_from_reference if clip_index == self.reference_index else self.clips[clip_index].own

    @property
    def n_anchors(self) -> int:
        """Anchors that go, counted in every clip that shows them."""
        own = sum(int(rows.sum()) for index in self.clips for rows in self.own(index).values())
        return own + sum(int(rows.sum()) for clip in self.clips.values() for rows in clip.inherited.values())


def find_deletions(
    project: Project,
    clips: Sequence[Clip],
    report: Report = lambda n_done, n_all: None,
    *,
    document: ProjectDocument | None = None,
) -> Deletions:
    """Examine all finished clips, one at a time; takes about a second each.

    Args:
        clips: All of the capture.
        report: Its exceptions end the work.
        document: Has the edits; None for that of the project.
    Raises:
        ProjectError: A clip is damaged, an edit is, there is nothing to delete, or the clips share one field.
    """
    document = project.document if document is None else document
    edits, objects = document.edits, document.objects
    if not any(edit.is_on and isinstance(edit.action, Delete) for edit in edits):
        raise ProjectError(
            "Nothing to apply: no active edit deletes anything.",
            hint="Only deletions can be applied permanently; other edits stay in the stack.",
        )
    config = project.settings.config()
    if config.field in ("continue", "joint"):
        raise ProjectError("The clips of this project share one field; edits of it stay in the stack.")
    reference_index = None if config.independent else project.settings.reference_clip
    reference = reference_of(project, reference_index)
    known = dict(project.finished_clips())
    found, untrained = {}, []
    for n_done, clip in enumerate(clips):
        report(n_done, len(clips))
        state = read_finished(project, clip.clip_index) if clip.clip_index in known else None
        if state is None or not _is_current(state, reference):
            untrained.append(clip.clip_index)
            continue
        found[clip.clip_index] = _of_clip(clip.clip_index, state, reference, document)
    report(len(clips), len(clips))
    return Deletions(edits, objects, found, tuple(untrained), reference_index)


def reference_of(project: Project, reference_index: int | None) -> ClipState | None:
    """The clip that others inherit from; None where none does, or it is not trained."""
    if reference_index is None or not project.clip_path(reference_index).is_file():
        return None
    return read_finished(project, reference_index)


def loaded(state: ClipState, reference: ClipState | None) -> EditedClip:
    """A clip as edits find it.

    Raises:
        ProjectError: Its arrays do not fit together.
    """
    from engine.editing.clip_rows import named_sets
    from engine.editing.edited_clip import EditedClip
    from engine.model.reading import load_clip_model

    header = state.header
    model = load_clip_model(state, reference, backend=process_backend())
    index = 0 if reference is None else reference.header.clip_index
    clip = Clip(header.clip_index, header.start, header.n_frames, header.clip_length)
    return EditedClip(model, clip, named_sets(model, header, index))


def _is_current(state: ClipState, reference: ClipState | None) -> bool:
    if state.is_reference:
        return True
    return reference is not None and state.header.reference_fingerprint == reference.header.fingerprint


def _of_clip(
    clip_index: int, state: ClipState, reference: ClipState | None, document: ProjectDocument
) -> ClipDeletions:
    from engine.editing.permanent.deleted_anchors import deleted_anchors
    from engine.model.host_array import host_array

    clip = loaded(state, reference)
    deleted, model = deleted_anchors(clip, document.edits, document.objects), clip.model
    result = ClipDeletions(clip_index, state.header.fingerprint)
    for role, rows in deleted.items():
        anchors = model.anchor_set(role)
        if anchors.is_trainable:
            result.own[role] = rows
            continue
        is_hidden = model.hidden.get(role)
        is_shown = np.ones(len(rows), bool) if is_hidden is None else ~host_array(is_hidden)
        exists = np.ones(len(rows), bool) if anchors.presence is None else host_array(anchors.presence).any(1)
        result.inherited[role], result.needed[role] = np.zeros((2, len(is_shown)), bool)
        result.inherited[role][is_shown] = rows
        result.needed[role][is_shown] = exists & ~rows
    return result
