"""A ProjectDocument as plain data for JSON, and back, strictly. The same document always gives the same data."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, replace
from typing import Any

from msgspec import Struct, to_builtins

from app.document.camera_paths import StoredPath, check_paths, stored_paths, to_path
from app.document.project_document import Exclusions, Label, Marker, ProjectDocument, World
from app.document.project_settings import ProjectSettings, check_bounds
from engine.editing.edit import Edit, Picked
from engine.editing.picks import unpack_rows
from engine.errors import ProjectError
from engine.gate.regions import parse_region
from engine.storage.typed_json import EntryError, to_type
from engine.training.retired_settings import without_retired


class _Stored(Struct, frozen=True, forbid_unknown_fields=True):
    """What is declared; regions are parsed by their own reader."""

    settings: ProjectSettings
    regions: tuple[dict[str, Any], ...]
    camera_paths: tuple[StoredPath, ...]
    edits: tuple[Edit, ...]
    markers: tuple[Marker, ...]
    labels: tuple[Label, ...]
    exclusions: Exclusions
    world: World


ENTRIES = tuple(_Stored.__struct_fields__)
"""Names of the entries that hold a document."""


def plain_document(document: ProjectDocument) -> dict[str, Any]:
    """A document as lists, objects, numbers and texts.

    Raises:
        ProjectError: It cannot be kept; see `check_paths`.
    """
    check_paths(document.camera_paths)
    return {
        "settings": to_builtins(asdict(document.settings)),
        "regions": [region.as_dict() for region in document.regions],
        "camera_paths": to_builtins(stored_paths(document.camera_paths)),
        "edits": to_builtins(document.edits),
        "markers": to_builtins(document.markers),
        "labels": to_builtins(document.labels),
        "exclusions": to_builtins(document.exclusions),
        "world": to_builtins(document.world),
    }


def document_of(content: Any) -> ProjectDocument:
    """The document that plain data holds.

    Raises:
        EntryError: An entry is missing, not known, or not of its kind.
        ProjectError: A value makes no sense; says which.
    """
    stored = to_type(content, _Stored)
    settings = replace(stored.settings, overrides=without_retired(stored.settings.overrides))
    settings.config()
    check_bounds(settings.clip_bounds)
    paths = tuple(to_path(path) for path in stored.camera_paths)
    check_paths(paths)
    document = ProjectDocument(
        settings,
        tuple(parse_region(values) for values in stored.regions),
        paths,
        stored.edits,
        stored.markers,
        stored.labels,
        stored.exclusions,
        stored.world,
    )
    check_edits(document.edits)
    return document


def check_edits(edits: Sequence[Edit]) -> None:
    """See that edits can be told apart, and that what they picked can be read.

    Raises:
        ProjectError: They cannot.
    """
    ids = [edit.edit_id for edit in edits]
    if len(set(ids)) != len(ids):
        raise ProjectError("Two edits have the same number.")
    for edit in edits:
        if isinstance(edit.target, Picked):
            try:
                for rows in edit.target.sets:
                    unpack_rows(rows.rows)
            except ValueError as error:
                raise ProjectError(f"Edit {edit.edit_id} cannot be read: {error}.") from error


__all__ = ["ENTRIES", "EntryError", "check_edits", "document_of", "plain_document"]
