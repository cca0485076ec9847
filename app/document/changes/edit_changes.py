"""Changes to the edits of a document: functions from one document to another, shared by the window, the command line
and scripts.
"""

from __future__ import annotations

from dataclasses import replace

from msgspec import structs, to_builtins

from app.document.checked_text import checked_text
from app.document.project_document import ProjectDocument
from app.document.storing.stored_document import check_picks
from engine.editing.actions import Action
from engine.editing.edit import EVERYWHERE, Edit, Everything, Scope, Target
from engine.errors import ProjectError
from engine.storage.typed_json import EntryError, to_type

MAX_EDITS = 10_000


def edit_with(document: ProjectDocument, edit_id: int) -> Edit:
    """The edit of that number.

    Raises:
        ProjectError: There is none.
    """
    return document.edits[_row(document, edit_id)]


def add_edit(
    document: ProjectDocument,
    action: Action,
    target: Target | None = None,
    *,
    scope: Scope = EVERYWHERE,
    is_inverted: bool = False,
    name: str = "",
) -> ProjectDocument:
    """Put a new edit on top of the stack, with a number that no other has; it is the last of the document's edits.

    Args:
        target: None for everything.
        is_inverted: Whether it acts on everything but the target.
        name: For people; an empty one is put into words where the edit is shown.
    Raises:
        ProjectError: A value is out of range, or there are too many edits.
    """
    _check_room(document)
    target = Everything() if target is None else target
    edit = Edit(_next_id(document), name.strip(), target, action, scope, is_inverted)
    return _with(document, (*document.edits, _checked(edit)))


def duplicate_edit(document: ProjectDocument, edit_id: int) -> ProjectDocument:
    """Put a copy of an edit right above it.

    Raises:
        ProjectError: There is no such edit, or there are too many.
    """
    _check_room(document)
    row = _row(document, edit_id)
    copy = structs.replace(document.edits[row], edit_id=_next_id(document))
    return _with(document, (*document.edits[: row + 1], copy, *document.edits[row + 1 :]))


def change_edit(document: ProjectDocument, edit: Edit) -> ProjectDocument:
    """Put an edit in the place of the one that has its number.

    Raises:
        ProjectError: There is none, or a value is out of range.
    """
    row = _row(document, edit.edit_id)
    return _with(document, (*document.edits[:row], _checked(edit), *document.edits[row + 1 :]))


def remove_edit(document: ProjectDocument, edit_id: int) -> ProjectDocument:
    """Remove an edit from the stack: its effect is undone, that of others stays.

    Raises:
        ProjectError: There is no such edit.
    """
    row = _row(document, edit_id)
    return _with(document, (*document.edits[:row], *document.edits[row + 1 :]))


def move_edit(document: ProjectDocument, edit_id: int, position: int) -> ProjectDocument:
    """Bring an edit to another position of the stack, counted from 0 at the bottom.

    Raises:
        ProjectError: There is no such edit or position.
    """
    edit, n_edits = edit_with(document, edit_id), len(document.edits)
    if not 0 <= position < n_edits:
        raise ProjectError(f"Position {position} is outside the stack of {n_edits} edits.")
    others = [other for other in document.edits if other is not edit]
    return _with(document, (*others[:position], edit, *others[position:]))


def toggle_edit(document: ProjectDocument, edit_id: int, is_on: bool | None = None) -> ProjectDocument:
    """Let an edit count or not. is_on: None toggles it.

    Raises:
        ProjectError: There is no such edit.
    """
    edit = edit_with(document, edit_id)
    return change_edit(document, structs.replace(edit, is_on=not edit.is_on if is_on is None else is_on))


def rename_edit(document: ProjectDocument, edit_id: int, name: str) -> ProjectDocument:
    """Give an edit another name; an empty one is put into words where the edit is shown.

    Raises:
        ProjectError: There is no such edit, or the name is too long.
    """
    return change_edit(document, structs.replace(edit_with(document, edit_id), name=name.strip()))


# ---------------------------------------------------------------- pieces


def _with(document: ProjectDocument, edits: tuple[Edit, ...]) -> ProjectDocument:
    return replace(document, edits=edits)


def _row(document: ProjectDocument, edit_id: int) -> int:
    for row, edit in enumerate(document.edits):
        if edit.edit_id == edit_id:
            return row
    known = ", ".join(str(edit.edit_id) for edit in document.edits[:12]) + ("..." if len(document.edits) > 12 else "")
    hint = f"Edits are {known}." if document.edits else "The project has no edits."
    raise ProjectError(f"There is no edit {edit_id}.", hint=hint)


def _next_id(document: ProjectDocument) -> int:
    return max((edit.edit_id for edit in document.edits), default=0) + 1


def _check_room(document: ProjectDocument) -> None:
    if len(document.edits) >= MAX_EDITS:
        raise ProjectError(
            f"The project has {len(document.edits)} edits, which is the limit.",
            hint="Apply them permanently, or delete some.",
        )


def _checked(edit: Edit) -> Edit:
    """The edit as it will be read again; values that a file cannot hold are refused now."""
    checked_text(edit.name)
    try:
        read = to_type(to_builtins(edit), Edit)
    except (EntryError, ValueError) as error:
        raise ProjectError(f"The edit is not valid ({error}).") from error
    check_picks(read)
    return edit
