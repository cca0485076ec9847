"""A ProjectDocument as plain data for JSON, and back, strictly. The same document always gives the same data."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Hashable, Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

from msgspec import Struct, to_builtins

from app.document.camera_paths import StoredPath, check_paths, stored_path, to_path
from app.document.project_document import Label, Marker, ProjectDocument, World
from app.document.project_settings import ProjectSettings, check_bounds
from engine.capture.exclusions import Exclusions
from engine.editing.edit import Edit, Picked, PickedRows
from engine.editing.fills.fill import unpacked_fill
from engine.editing.picks import unpack_rows
from engine.editing.scene_object import NO_OBJECTS, Objects, SceneObject
from engine.errors import ProjectError
from engine.gate.regions import parse_region
from engine.storage.typed_json import EntryError, to_type
from engine.timing.segment import Segment
from engine.timing.timing import check_length
from engine.training.retired_settings import without_retired

_sound: set[bytes] = set()
"""Digests of packed numbers that could be unpacked, of this process."""


class _Stored(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The declared entries; regions are parsed by their own reader. Earlier versions wrote none of those that have a
    default."""

    settings: ProjectSettings
    regions: tuple[dict[str, Any], ...]
    camera_paths: tuple[StoredPath, ...]
    edits: tuple[Edit, ...]
    markers: tuple[Marker, ...]
    labels: tuple[Label, ...]
    exclusions: Exclusions
    timing: tuple[Segment, ...] = ()
    objects: Objects = NO_OBJECTS  # what earlier versions did not write
    world: World


ENTRIES = tuple(_Stored.__struct_fields__)
"""Names of the entries that hold a document."""


def plain_document(document: ProjectDocument) -> dict[str, Any]:
    """A document as lists, objects, numbers and texts.

    Raises:
        ProjectError: It cannot be kept, because `document_of` would refuse it.
    """
    check_paths(document.camera_paths)
    check_numbers(document.edits)
    check_timing(document.timing)
    check_objects(document.objects)
    return {name: plain_entry(name, getattr(document, name)) for name in ENTRIES}


def plain_entry(name: str, value: Any) -> Any:
    """One entry of a document as plain data. Raises ProjectError like `plain_document`."""
    codec = CODECS[name]
    return [codec.plain(item) for item in value] if codec.is_list else codec.plain(value)


@dataclass(frozen=True, slots=True)
class Codec:
    """How one entry of a document, or each item of it, is stored.

    Attributes:
        is_list: Whether the entry is a list of items.
        plain: An item as plain data, which `value` takes again. Raises ProjectError for one that cannot be kept.
        value: The item that plain data holds. Raises EntryError or ProjectError.
        key: Identifies items while they change; None for those that only have their place.
    """

    is_list: bool
    plain: Callable[[Any], Any]
    value: Callable[[Any], Any]
    key: Callable[[Any], Hashable] | None = None


def _checked(kind: type[Any]) -> Callable[[Any], Any]:
    """Values as plain data that has gone through their declaration, which they themselves need not have done."""

    def plain(value: Any) -> Any:
        try:
            return to_builtins(to_type(to_builtins(value), kind))
        except EntryError as error:
            raise ProjectError(f"This cannot be saved ({error}).") from error

    return plain


def _struct(kind: type[Any], key: Callable[[Any], Hashable] | None = None, *, is_list: bool = True) -> Codec:
    return Codec(is_list, _checked(kind), lambda data: to_type(data, kind), key)


def _plain_settings(settings: ProjectSettings) -> dict[str, Any]:
    plain = _checked(ProjectSettings)(asdict(settings))
    return {**plain, "overrides": dict(sorted(plain["overrides"].items()))}


def _to_settings(data: Any) -> ProjectSettings:
    settings = to_type(data, ProjectSettings)
    settings = replace(settings, overrides=without_retired(settings.overrides))
    settings.config()
    return settings


def _to_edit(data: Any) -> Edit:
    edit = to_type(data, Edit)
    check_picks(edit)
    return edit


def _to_object(data: Any) -> SceneObject:
    found = to_type(data, SceneObject)
    check_rows(f"Object {found.object_id}", _rows_of(found))
    return found


CODECS = {
    "settings": Codec(False, _plain_settings, _to_settings),
    "regions": Codec(True, lambda region: parse_region(region.as_dict()).as_dict(), parse_region),
    "camera_paths": Codec(
        True,
        lambda path: _checked(StoredPath)(stored_path(path)),
        lambda data: to_path(to_type(data, StoredPath)),
        lambda path: path.name,
    ),
    "edits": Codec(True, _checked(Edit), _to_edit, lambda edit: edit.edit_id),
    "markers": _struct(Marker),
    "labels": _struct(Label, lambda label: (label.kind, label.name)),
    "exclusions": _struct(Exclusions, is_list=False),
    "world": _struct(World, is_list=False),
    "timing": _struct(Segment),
    "objects": Codec(True, _checked(SceneObject), _to_object, lambda one: one.object_id),
}


def document_of(content: Any) -> ProjectDocument:
    """The document that plain data holds.

    Raises:
        EntryError: An entry is missing, not known, or not of its kind.
        ProjectError: A value is not valid; says which.
    """
    stored = to_type(content, _Stored)
    settings = replace(stored.settings, overrides=without_retired(stored.settings.overrides))
    settings.config()
    check_bounds(settings.clip_bounds)
    paths = tuple(to_path(path) for path in stored.camera_paths)
    check_paths(paths)
    check_numbers(stored.edits)
    check_timing(stored.timing)
    check_objects(stored.objects)
    for edit in stored.edits:
        check_picks(edit)
    for one in stored.objects:
        check_rows(f"Object {one.object_id}", _rows_of(one))
    return ProjectDocument(
        settings,
        tuple(parse_region(values) for values in stored.regions),
        paths,
        stored.edits,
        stored.markers,
        stored.labels,
        stored.exclusions,
        stored.world,
        stored.timing,
        stored.objects,
    )


def check_numbers(edits: Sequence[Edit]) -> None:
    """Check that edits can be distinguished.

    Raises:
        ProjectError: They cannot.
    """
    if len({edit.edit_id for edit in edits}) != len(edits):
        raise ProjectError("Two edits have the same number.")


def check_timing(segments: Sequence[Segment]) -> None:
    """Check that a take can be as long as its segments are.

    Raises:
        ProjectError: It cannot.
    """
    try:
        check_length(segments)
    except ValueError as error:
        raise ProjectError(f"The timing is not valid: {error}.") from error


def check_objects(objects: Sequence[SceneObject]) -> None:
    """Check that objects can be distinguished, by number and by name.

    Raises:
        ProjectError: They cannot.
    """
    if len({one.object_id for one in objects}) != len(objects):
        raise ProjectError("Two objects have the same number.")
    if len({one.name.casefold() for one in objects}) != len(objects):
        raise ProjectError("Two objects have the same name.")


def check_picks(edit: Edit) -> None:
    """Check that the picks of an edit, and its fill, can be read.

    Raises:
        ProjectError: They cannot.
    """
    if isinstance(edit.target, Picked):
        check_rows(f"Edit {edit.edit_id}", edit.target.sets)
    if edit.fill is None:
        return
    check_rows(f"The fill of edit {edit.edit_id}", edit.fill.traces)
    try:
        unpacked_fill(edit.fill.gaussians)
    except ValueError as error:
        raise ProjectError(f"Edit {edit.edit_id} cannot be read: {error}.") from error


def check_rows(owner: str, sets: Iterable[PickedRows]) -> None:
    """Check that picked Gaussians can be read. owner: Begins the sentence that says that they cannot.

    Raises:
        ProjectError: They cannot.
    """
    try:
        for picked in sets:
            digest = hashlib.blake2b(picked.rows, digest_size=16).digest()
            if digest not in _sound:  # unpacking takes far longer, and a document is read again and again
                unpack_rows(picked.rows)
                _sound.add(digest)
    except ValueError as error:
        raise ProjectError(f"{owner} cannot be read: {error}.") from error


def _rows_of(found: SceneObject) -> Iterable[PickedRows]:
    for seed in found.seeds:
        yield from (*seed.added, *seed.removed)
    for clip in found.clips:
        yield from clip.sets
