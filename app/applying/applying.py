"""Applying deletions permanently: new versions of the clips, without the anchors that frames no longer show.

First the document gets the new numbers of picked anchors next to the old ones, so that it fits old and new clips. Then
all clips are exchanged at once. Finally, edits with nothing left to delete are removed. If the program is killed in
between, edits and clips still fit together. Restoring the former versions of the clips restores deleted anchors.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from msgspec.structs import replace as with_entries

from app.applying.deletions import Deletions, Report, Rows, find_deletions, loaded, reference_of
from app.document.project_document import ProjectDocument
from app.project.clips.clip_exchange import begin_exchange, exchange, give_up_exchange
from app.project.clips.clip_versions import forget_oldest, read_finished, set_aside
from app.project.project import Project
from engine.capture.clip import Clip
from engine.clip_files.clip_header import ClipHeader
from engine.clip_files.clip_state import ClipState, read_clip_state
from engine.clip_files.rewriting import rewrite_clip
from engine.editing.actions import Delete
from engine.editing.edit import Edit
from engine.editing.scene_object import Objects
from engine.errors import ProjectError

NAME = "apply deletions permanently"
"""Name of the step in the history."""


@dataclass(frozen=True, slots=True, eq=False)
class StagedClips:
    """New clips, ready to replace the old ones.

    Attributes:
        before, objects_before: Edits and objects of the document that they were made for.
        during: Edits that fit old and new clips.
        objects: Objects that fit old and new clips.
        after: Edits that are left once the clips are exchanged.
        clip_indices: Of the clips that change.
        n_anchors: Removed anchors, counted in every clip that shows them.
    """

    before: tuple[Edit, ...]
    objects_before: Objects
    during: tuple[Edit, ...]
    objects: Objects
    after: tuple[Edit, ...]
    clip_indices: tuple[int, ...]
    n_anchors: int

    @property
    def kept(self) -> tuple[Edit, ...]:
        """Edits that delete and stay in the stack, because something is left for them to delete."""
        return tuple(edit for edit in self.after if edit.is_on and isinstance(edit.action, Delete))

    def text(self) -> str:
        """The outcome, with the edits that stay."""
        clips = "1 clip was" if len(self.clip_indices) == 1 else f"{len(self.clip_indices)} clips were"
        said = f"{clips} rewritten without {self.n_anchors:,} anchors."
        if self.kept:
            n = len(self.kept)
            said += f" {n} {'edit that deletes stays' if n == 1 else 'edits that delete stay'} in the stack: "
            said += "anchors that are visible in other frames, or only partly deleted, must stay."
        return said


def apply_permanently(
    project: Project, clips: Sequence[Clip], report: Report = lambda n_done, n_all: None
) -> StagedClips:
    """Do all of it, without a window.

    Args:
        clips: All of the capture.
        report: Its exceptions end the work as long as nothing is exchanged.
    Raises:
        ProjectError: There is nothing to apply, the project is read-only, or a clip is damaged; nothing has changed.
        DiskError: The disk refused.
    """
    project.check_writable()
    staged = stage(project, find_deletions(project, clips, report), report)
    project.change(replace(project.document, edits=staged.during, objects=staged.objects), NAME)
    exchange_staged(project, staged)
    project.change(replace(project.document, edits=staged.after), NAME)
    return staged


def stage(project: Project, deletions: Deletions, report: Report = lambda n_done, n_all: None) -> StagedClips:
    """Write the new clips next to the old ones. Nothing else changes yet.

    Raises:
        ProjectError: No anchor can be removed, or a clip has changed or is damaged.
        DiskError: The disk refused; nothing is left behind.
    """
    if not deletions.n_anchors:
        raise ProjectError(
            "No anchor is fully deleted in all frames of its clip, so nothing can be applied permanently.",
            hint="The edits stay in the stack and still apply.",
        )
    folder = begin_exchange(project.folder)
    try:
        return _staged(project, folder, deletions, report)
    except BaseException:
        give_up_exchange(project.folder)
        raise


def exchange_staged(project: Project, staged: StagedClips) -> None:
    """Put the new clips in the places of the old ones, which become versions.

    Raises:
        DiskError: The disk refused; see app.project.clips.clip_exchange.
    """
    for clip_index in staged.clip_indices:
        set_aside(project, clip_index)
    exchange(project.folder, [project.clip_path(clip_index).name for clip_index in staged.clip_indices])
    for clip_index in staged.clip_indices:
        forget_oldest(project, clip_index)


def edits_after(document: ProjectDocument, staged: StagedClips) -> ProjectDocument:
    """A document without the edits that have nothing left to delete; changes made meanwhile stay."""
    done = {edit.edit_id for edit in staged.during} - {edit.edit_id for edit in staged.after}
    return replace(document, edits=tuple(edit for edit in document.edits if edit.edit_id not in done))


# ---------------------------------------------------------------- new clips


def _staged(project: Project, folder: Path, deletions: Deletions, report: Report) -> StagedClips:
    from engine.editing.permanent.renumbering import objects_with_new_numbers, with_new_numbers

    order = sorted(deletions.clips, key=lambda index: index != deletions.reference_index)  # the reference first
    old_reference = reference_of(project, deletions.reference_index)
    new_reference = old_reference
    renumbered, fingerprints, changed = {}, {}, []
    acted, left = set(), set()  # numbers of edits that have deleted something, and that still do
    for n_done, clip_index in enumerate(order):
        report(n_done, len(order))
        state = read_finished(project, clip_index)
        if state.header.fingerprint != deletions.clips[clip_index].fingerprint:
            raise ProjectError(
                f"Clip {clip_index} has changed in the meantime.", hint="Check again what can be applied."
            )
        acted |= _deleting(state, old_reference, deletions.edits, deletions.objects, acted)
        new = _new_state(state, deletions, clip_index, fingerprints)
        fingerprints[state.header.fingerprint] = new.header.fingerprint
        if clip_index == deletions.reference_index:
            new_reference = new
        if new.header == state.header:
            left |= _deleting(state, new_reference, deletions.edits, deletions.objects, left)
            continue
        path = project.clip_path(clip_index)
        rewrite_clip(path, folder / path.name, ClipState(new.arrays, _described(new, new_reference)))
        changed.append(clip_index)
        renumbered |= _renumbered(state, new, deletions.own(clip_index))
        written = read_clip_state(folder / path.name)
        edits, objects = (
            with_new_numbers(deletions.edits, renumbered),
            objects_with_new_numbers(deletions.objects, renumbered),
        )
        left |= _deleting(written, new_reference, edits, objects, left)
    report(len(order), len(order))
    during = with_new_numbers(deletions.edits, renumbered)
    objects = objects_with_new_numbers(deletions.objects, renumbered)
    done = set() if deletions.untrained else acted - left  # clips that come later may still need them
    after = tuple(edit for edit in during if edit.edit_id not in done or _shows_something(edit))
    return StagedClips(deletions.edits, deletions.objects, during, objects, after, tuple(changed), deletions.n_anchors)


def _shows_something(edit: Edit) -> bool:
    """Whether an edit fills what was behind with Gaussians that no clip has."""
    return edit.fill is not None and bool(edit.fill.gaussians)


def _new_state(state: ClipState, deletions: Deletions, clip_index: int, fingerprints: dict[str, str]) -> ClipState:
    from engine.editing.permanent.smaller_clip import without_anchors

    gone = {} if state.is_reference else deletions.gone_from_reference
    new = without_anchors(state, deletions.own(clip_index), deletions.clips[clip_index].inherited, gone)
    header = new.header
    entries = {
        name: fingerprints.get(before, before)
        for name in ("reference_fingerprint", "previous_fingerprint")
        if (before := getattr(header, name)) is not None
    }
    return ClipState(new.arrays, with_entries(header, **entries))


def _described(state: ClipState, reference: ClipState | None) -> ClipHeader:
    """The header of a clip that has lost anchors: the remaining number, and no figures of former pictures."""
    from engine.training.preparation.clip_field import n_alive

    model = loaded(state, None if state.is_reference else reference).model
    n_anchors = {role: len(model.anchor_set(role)) for role in model.roles()}
    metrics = state.header.metrics
    if metrics is not None:
        metrics = with_entries(metrics, held_out_psnr=None, held_out_whole=False)
    return with_entries(state.header, n_anchors=n_anchors, n_alive=n_alive(model), metrics=metrics)


def _renumbered(before: ClipState, now: ClipState, gone: Rows) -> dict:
    from engine.editing.permanent.renumbering import Renumbered

    k, sets = now.header.decoder.gaussians_per_anchor, {}
    for role, record in before.anchors.items():
        if record.own is not None:
            is_kept = ~gone.get(role, np.zeros(len(record.own), bool))
            sets[before.header.origin, role] = Renumbered(now.header.origin, is_kept, k)
    return sets


def _deleting(
    state: ClipState, reference: ClipState | None, edits: tuple[Edit, ...], objects: Objects, known: set[int]
) -> set[int]:
    """Numbers of the edits that delete something of a clip. known: Edits to skip."""
    from engine.editing.permanent.deleted_anchors import deletes_something

    header = state.header
    asked = [
        edit
        for edit in edits
        if isinstance(edit.action, Delete)
        and edit.edit_id not in known
        and edit.scope.touches(header.start, header.start + header.n_frames)
    ]
    if not asked:
        return set()
    clip = loaded(state, None if state.is_reference else reference)
    return {edit.edit_id for edit in asked if deletes_something(clip, edits, edit, objects)}
