"""The dialog's and the command line's sentence about edits that go along with an export."""

from __future__ import annotations

from app.document.changes.edit_words import edit_title
from app.document.project_document import ProjectDocument
from engine.text import one_line

MAX_TITLES = 3


def edits_line(document: ProjectDocument, *, has_edits: bool = True) -> str:
    """How many edits an export includes, and which, and how many copies of objects: "2 edits are included: delete box
    1 × 1 × 1, red; 3 copies of objects". Empty where none is on, or the export leaves them out.

    Args:
        document: Of the project.
        has_edits: Whether the export applies them.
    """
    titles = [one_line(edit_title(edit, document.objects)) for edit in document.edits if edit.is_on]
    n_copies = sum(copy.is_on for copy in document.copies)
    copied = f"{n_copies} {'copy' if n_copies == 1 else 'copies'} of objects" if n_copies else ""
    if not (titles or copied) or not has_edits:
        return ""
    if not titles:
        return f"{copied} {'is' if n_copies == 1 else 'are'} included"
    more = [f"{len(titles) - MAX_TITLES} more"] if len(titles) > MAX_TITLES else []
    counted = "1 edit is included" if len(titles) == 1 else f"{len(titles)} edits are included"
    return f"{counted}: {', '.join(titles[:MAX_TITLES] + more)}" + (f"; {copied}" if copied else "")
