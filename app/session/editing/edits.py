"""Edits: carries out the commands that change the edits, markers, labels, copies and the world of the open project."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass, replace
from typing import Protocol

from app.document.changes import edit_changes, note_changes, world_changes
from app.document.changes.edit_words import edit_title, what_text
from app.document.changes.reach_words import check_acts
from app.document.project_document import ProjectDocument
from app.session.duplicating.copying import with_copies_changed
from app.session.edit_status import EditsStatus
from app.session.editing import edit_commands as c
from app.session.editing.edit_reaches import EditReaches
from app.session.editing.kept_document import KeptDocument
from app.session.editing.lost_edits import LostEdits
from app.session.editing.selection import NOTHING_SELECTED, Selection
from engine.editing.actions import Delete, Hide
from engine.editing.reach import reach_of_edit
from engine.editing.selection.seen_from import SeenFrom
from engine.errors import ProjectError


@dataclass(frozen=True, slots=True)
class Change:
    """The document after a command. name, merge: See app.document.history.Changed."""

    document: ProjectDocument
    name: str
    merge: Hashable = None


class Selects(Protocol):
    """Knows the selection."""

    @property
    def selection(self) -> Selection: ...

    @property
    def seen_from(self) -> SeenFrom | None:
        """The picture in which all of it was selected; None where it was not in one picture."""
        ...

    def select(self, selection: Selection) -> None:
        """Select this and nothing else."""
        ...


class Edits:
    """For one thread.

    Args:
        document: Holds and keeps them.
        selecting: Its selection becomes the target of edits.
        lost: Knows which edits have lost their picks.
        reaches: Knows where edits act.
    """

    def __init__(self, document: KeptDocument, selecting: Selects, lost: LostEdits, reaches: EditReaches) -> None:
        self._document, self._selecting = document, selecting
        self._lost, self._reaches = lost, reaches

    def status(self) -> EditsStatus:
        """Everything as one value."""
        content, why_not = self._document.content, self._document.why_not()
        if content is None:
            return EditsStatus(why_not=why_not)
        return replace(
            edits_status(content, why_not),
            lost=self._lost.of(content.edits),
            clips=self._reaches.clips(),
            reaches=self._reaches.of(content),
        )

    def apply(self, command: c.EditCommand) -> None:
        """Carry out a command; one that changes nothing does not become a step of the history.

        Raises:
            ProjectError: It cannot be done now, or is not valid.
        """
        document = self._document.checked().document
        if isinstance(command, c.AddEdit) and command.target is None:
            self._add_to_selected(document, command)
            return
        change = changed(document, command)
        self._check_acts(command, change)
        if not _is_same(document, change.document):
            self._document.change(change.document, change.name, change.merge)

    def _add_to_selected(self, document: ProjectDocument, command: c.AddEdit) -> None:
        selection = self._selecting.selection
        if not len(selection):
            raise ProjectError("Nothing is selected.", hint="Select Gaussians first, or place a box or a sphere.")
        change = changed(document, replace(command, target=selection.target()))
        self._check_acts(command, change)
        self._document.change(change.document, change.name, change.merge)
        if isinstance(command.action, Hide | Delete) and not command.is_inverted:
            self._selecting.select(NOTHING_SELECTED)

    def _check_acts(self, command: c.EditCommand, change: Change) -> None:
        if isinstance(command, c.AddEdit):
            edit = change.document.edits[-1]
            check_acts(reach_of_edit(edit, self._reaches.clips(), change.document.objects), edit.scope)

    def go(self, n_steps: int) -> None:
        """Undo steps, or redo them where the number is positive; as many as there are.

        Raises:
            ProjectError: A step cannot be taken; those before it were.
        """
        history = self._document.checked().history
        for _ in range(min(abs(n_steps), len(history.past if n_steps < 0 else history.future))):
            (self._document.undo if n_steps < 0 else self._document.redo)()


def edits_status(document: ProjectDocument, why_not: str = "") -> EditsStatus:
    """The edits of a document as a window shows them. why_not: Why nothing can be changed now; empty when it can."""
    labels = {(label.kind, label.name): label.text for label in document.labels}
    return EditsStatus(
        document.edits,
        labels,
        document.world,
        timing=document.timing,
        objects=document.objects,
        copies=document.copies,
        can_edit=not why_not,
        why_not=why_not,
    )


def changed(document: ProjectDocument, command: c.EditCommand) -> Change:
    """The change that a command makes to a document. Raises ProjectError where it is not valid."""
    match command:
        case c.AddEdit(action=action, target=target, scope=scope, is_inverted=is_inverted, name=name):
            added = edit_changes.add_edit(document, action, target, scope=scope, is_inverted=is_inverted, name=name)
            title = what_text(action, added.edits[-1].target, document.objects, is_inverted=is_inverted)
            return Change(added, name or title)
        case c.ChangeEdit(edit=edit, gesture=gesture, verb=verb):
            merge = ("edit", verb, edit.edit_id, gesture) if gesture else None
            title = edit_title(edit_changes.edit_with(document, edit.edit_id), document.objects)
            return Change(edit_changes.change_edit(document, edit), f"{verb}: {title}", merge)
        case c.RemoveEdit(edit_id=edit_id):
            title = _title(document, edit_id)
            return Change(edit_changes.remove_edit(document, edit_id), f"remove edit: {title}")
        case c.DuplicateEdit(edit_id=edit_id):
            return Change(
                edit_changes.duplicate_edit(document, edit_id), f"duplicate edit: {_title(document, edit_id)}"
            )
        case c.MoveEdit(edit_id=edit_id, position=position):
            return Change(
                edit_changes.move_edit(document, edit_id, position), f"reorder edit: {_title(document, edit_id)}"
            )
        case c.ToggleEdit(edit_id=edit_id):
            words = "switch off" if edit_changes.edit_with(document, edit_id).is_on else "switch on"
            return Change(edit_changes.toggle_edit(document, edit_id), f"{words}: {_title(document, edit_id)}")
        case c.RenameEdit(edit_id=edit_id, name=name):
            return Change(
                edit_changes.rename_edit(document, edit_id, name), f"rename edit: {_title(document, edit_id)}"
            )
        case c.PutMarker(frame_index=frame_index, text=text, gesture=gesture):
            merge = ("marker", frame_index, gesture) if gesture else None
            return Change(note_changes.put_marker(document, frame_index, text), f"marker at frame {frame_index}", merge)
        case c.RemoveMarker(frame_index=frame_index):
            return Change(note_changes.remove_marker(document, frame_index), f"remove marker at frame {frame_index}")
        case c.MoveMarker(frame_index=frame_index, to_frame=to_frame, gesture=gesture):
            merge = ("move marker", gesture) if gesture else None
            return Change(note_changes.move_marker(document, frame_index, to_frame), "move marker", merge)
        case c.SetLabel(kind=kind, name=name, text=text, gesture=gesture):
            merge = ("label", kind, name, gesture) if gesture else None
            return Change(note_changes.set_label(document, kind, name, text), f"label a {kind}", merge)
        case c.SetUp(direction=direction):
            return Change(world_changes.set_up(document, direction), "set up")
        case c.SetUpByGround(points=points, toward=toward):
            up = world_changes.up_of_ground(points, toward)
            return Change(world_changes.set_up(document, up), "set up from the ground")
        case c.SetScaleByLength(a=a, b=b, length_m=length_m):
            meters_per_unit = world_changes.scale_of_length(a, b, length_m)
            return Change(world_changes.set_scale(document, meters_per_unit), "set the scale from a length")
        case c.SetScale(meters_per_unit=meters_per_unit):
            return Change(world_changes.set_scale(document, meters_per_unit), "set the scale")
        case _:
            return Change(*with_copies_changed(document, command))


def _title(document: ProjectDocument, edit_id: int) -> str:
    return edit_title(edit_changes.edit_with(document, edit_id), document.objects)


def _is_same(before: ProjectDocument, after: ProjectDocument) -> bool:
    """Is everything the same that these commands change?"""
    names = ("edits", "markers", "labels", "world", "copies")
    return all(getattr(before, name) == getattr(after, name) for name in names)
