"""What commands about copies make of a document."""

from __future__ import annotations

from collections.abc import Hashable

from app.document.changes import copy_changes
from app.document.project_document import ProjectDocument
from app.session.duplicating import copy_commands as c


def with_copies_changed(document: ProjectDocument, command: c.CopyCommand) -> tuple[ProjectDocument, str, Hashable]:
    """The document after a command, the name of the step, and what it merges with.

    Raises:
        ProjectError: The command is not valid.
    """
    match command:
        case c.DuplicateObject(copy=copy, n_times=n_times):
            name = _object_name(document, copy.object_id)
            copies = copy_changes.stepped(copy, n_times, copy.group or copy_changes.group_name(document, name))
            words = "duplicate" if n_times == 1 else f"duplicate {n_times} times"
            return copy_changes.add_copies(document, copies), f"{words}: {name}", None
        case c.MakeCrowd(copy=copy):
            name = _object_name(document, copy.object_id)
            group = copy.group or copy_changes.group_name(document, name)
            copies = copy_changes.crowd(
                copy, command.n_across, command.n_along, command.across, command.along, command.shift_frames, group
            )
            return copy_changes.add_copies(document, copies), f"crowd of {len(copies)}: {name}", None
        case c.ChangeCopy(copy=copy, gesture=gesture):
            merge = ("copy", copy.copy_id, gesture) if gesture else None
            return copy_changes.change_copy(document, copy), f"change copy: {copy.name}", merge
        case c.RemoveCopies(copy_ids=copy_ids):
            return copy_changes.remove_copies(document, copy_ids), f"remove {_words(document, copy_ids)}", None
        case c.SwitchCopies(copy_ids=copy_ids, is_on=is_on):
            after = copy_changes.switch_copies(document, copy_ids, is_on=is_on)
            return after, f"switch {'on' if is_on else 'off'} {_words(document, copy_ids)}", None


def _object_name(document: ProjectDocument, object_id: int) -> str:
    return next((one.name for one in document.objects if one.object_id == object_id), f"object {object_id}")


def _words(document: ProjectDocument, copy_ids: tuple[int, ...]) -> str:
    if len(copy_ids) != 1:
        return f"{len(copy_ids)} copies"
    return f"copy: {copy_changes.copy_with(document, copy_ids[0]).name}"
