"""history.json: the way back and forth from the document of project.json, as chains of patches.

Steps of the past begin with the last one: each holds the patch from the document after it to the one before it. Steps
that were taken back likewise, beginning with the one that would be done again next. A damaged file costs the way back,
and nothing else.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

from msgspec import Meta, Struct

from app.document.history import MAX_NAME_CHARACTERS, MAX_STEPS, DocumentHistory, Step
from app.document.project_document import ProjectDocument
from app.document.storing.document_patch import document_difference, document_with
from app.document.storing.kept_json import kept_text, read_kept, write_kept
from app.document.storing.plain_patch import PatchError
from engine.errors import ProjectError
from engine.storage.typed_json import EntryError, to_type

HISTORY_FILE = "history.json"
FORMAT = 1
MAX_BYTES = 64 << 20
MAX_KEPT_BYTES = 24 << 20
"""Of the steps of the past, and likewise of those that were taken back; older ones are left out."""


class _StoredStep(Struct, frozen=True, forbid_unknown_fields=True):
    name: Annotated[str, Meta(max_length=MAX_NAME_CHARACTERS)]
    patch: dict[str, Any]
    merge: str | None = None


class StoredHistory(Struct, frozen=True, forbid_unknown_fields=True):
    """The contents of the file.

    Attributes:
        step, document: Number of the step and checksum of the project.json that it belongs to.
        past, future: See above.
    """

    history: int
    step: Annotated[int, Meta(ge=0)]
    document: str
    past: Annotated[tuple[_StoredStep, ...], Meta(max_length=MAX_STEPS)]
    future: Annotated[tuple[_StoredStep, ...], Meta(max_length=MAX_STEPS)]


def write_history(folder: Path, history: DocumentHistory, *, step: int, document: str) -> None:
    """Write the way back and forth.

    Raises:
        ProjectError: A step cannot be kept.
        DiskError: The disk refused.
    """
    past, future = _chain(history.present, history.past), _chain(history.present, history.future)
    content = {"history": FORMAT, "step": step, "document": document, "past": past, "future": future}
    write_kept(folder / HISTORY_FILE, kept_text(content, max_bytes=MAX_BYTES, is_for_people=False))


def _chain(present: ProjectDocument, steps: Sequence[Step]) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = []
    n_bytes, document = 0, present
    for step in reversed(steps):
        row: dict[str, Any] = {"name": step.name, "patch": document_difference(document, step.document)}
        if isinstance(step.merge, str):
            row["merge"] = step.merge
        n_bytes += len(json.dumps(row))
        if n_bytes > MAX_KEPT_BYTES:
            break
        found.append(row)
        document = step.document
    return found


def read_history(folder: Path) -> StoredHistory | None:
    """The contents of the file; None where there is none.

    Raises:
        ProjectError: It is damaged.
    """
    path = folder / HISTORY_FILE
    content = read_kept(path, "The undo history file", hint="", max_bytes=MAX_BYTES)
    if content is None:
        return None
    try:
        found = to_type(content, StoredHistory)
        if found.history != FORMAT:
            raise EntryError(f"history is {found.history}, not {FORMAT}")
    except EntryError as error:
        message = f"The undo history file has a missing or wrong entry ({error})."
        raise ProjectError(message, path=path) from error
    return found


def history_of(present: ProjectDocument, stored: StoredHistory) -> DocumentHistory:
    """The history of a document.

    Raises:
        ProjectError: A step does not fit it.
    """
    return DocumentHistory(present, _steps(present, stored.past), _steps(present, stored.future))


def _steps(present: ProjectDocument, stored: Sequence[_StoredStep]) -> tuple[Step, ...]:
    found, document = [], present
    for step in stored:
        try:
            document = document_with(document, step.patch)
        except PatchError as error:
            raise ProjectError(f"An undo step does not fit the document ({error}).") from error
        found.append(Step(step.name, document, step.merge))
    return tuple(reversed(found))
