"""Patches between two documents: per entry, and per item where an entry is a list.

Only items that are not the same objects are compared, so that the cost of a step follows from its changes, however many
edits the document holds. Unchanged items are shared between all documents of a history.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from app.document.camera_paths import check_paths
from app.document.project_document import ProjectDocument
from app.document.storing.plain_patch import Patch, PatchError, difference, patched, pieces_of
from app.document.storing.stored_document import (
    CODECS,
    Codec,
    check_copies,
    check_numbers,
    check_objects,
    check_timing,
)
from engine.storage.typed_json import EntryError


def document_difference(before: ProjectDocument, after: ProjectDocument) -> dict[str, Patch]:
    """The patch of each entry that differs.

    Raises:
        ProjectError: A new value in `after` cannot be kept.
    """
    found: dict[str, Patch] = {}
    for name, codec in CODECS.items():
        old, new = getattr(before, name), getattr(after, name)
        if old is new:
            continue
        patch = _of_items(codec, old, new) if codec.is_list else difference(codec.plain(old), codec.plain(new))
        if patch is not None:
            found[name] = patch
    _check(after, found)
    return found


def _of_items(codec: Codec, before: Sequence[Any], after: Sequence[Any]) -> Patch | None:
    places = {id(item): i for i, item in enumerate(before)}
    by_key = {} if codec.key is None else {codec.key(item): i for i, item in enumerate(before)}
    items: list[Any] = []
    for place, item in enumerate(after):
        index = places.get(id(item))
        if index is None:
            index = by_key.get(codec.key(item)) if codec.key is not None else place if place < len(before) else None
            plain = codec.plain(item)
            patch = {"is": plain} if index is None else difference(codec.plain(before[index]), plain)
            if patch is not None:
                items.append(patch if "is" in patch else {"of": index, **patch})
                continue
        assert index is not None
        if items and isinstance(items[-1], list) and items[-1][1] == index:
            items[-1][1] += 1
        else:
            items.append([index, index + 1])
    is_same = len(before) == len(after) and items in ([], [[0, len(before)]])
    return None if is_same else {"items": items}


def document_with(before: ProjectDocument, patch: Any) -> ProjectDocument:
    """A document with a patch applied.

    Raises:
        PatchError: It is not a patch, or one for another document.
        ProjectError: A value is not valid.
    """
    if not isinstance(patch, dict) or not patch.keys() <= CODECS.keys():
        raise PatchError("a patch is for entries that a document does not have")
    found: dict[str, Any] = {}
    try:
        for name, change in patch.items():
            codec, old = CODECS[name], getattr(before, name)
            found[name] = _items_with(codec, old, change) if codec.is_list else _with(codec, old, change)
    except EntryError as error:
        raise PatchError(f"a patch has a missing or wrong entry: {error}") from error
    after = replace(before, **found)
    _check(after, found)
    return after


def _with(codec: Codec, before: Any, patch: Any) -> Any:
    return codec.value(patched(codec.plain(before), patch))


def _items_with(codec: Codec, before: tuple[Any, ...], patch: Any) -> tuple[Any, ...]:
    if not isinstance(patch, dict) or patch.keys() != {"items"}:
        raise PatchError("a patch of a list is for something else")
    after: list[Any] = []
    for piece in pieces_of(patch["items"], len(before)):
        match piece:
            case (int(first), int(stop)):
                after += before[first:stop]
            case (int(index), dict(change)):
                after.append(_with(codec, before[index], change))
            case (None, value):
                after.append(codec.value(value))
    return tuple(after)


def _check(document: ProjectDocument, changed: dict[str, Any]) -> None:
    """Check that items can be distinguished, where they have changed. Raises ProjectError."""
    if "camera_paths" in changed:
        check_paths(document.camera_paths)
    if "edits" in changed:
        check_numbers(document.edits)
    if "timing" in changed:
        check_timing(document.timing)
    if "objects" in changed:
        check_objects(document.objects)
    if "copies" in changed:
        check_copies(document.copies)
