"""project.json: the document of a project. Read strictly, written with a checksum; earlier schemas are taken over.

An edit by hand is accepted where the entry "checksum" was taken out; otherwise it looks like damage, and the message
says so.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from app.document.camera_paths import StoredPath
from app.document.project_document import ProjectDocument
from app.document.storing.kept_json import KeptText, kept_object, kept_text, read_kept, write_kept
from app.document.storing.stored_document import ENTRIES, document_of, plain_document
from engine.errors import ProjectError
from engine.storage.files import disk_error, partial_path
from engine.storage.json_files import HAND_EDITED, MAX_JSON_BYTES
from engine.storage.typed_json import EntryError, to_type

SCHEMA = 2
PROJECT_FILE, BACKUP_FILE = "project.json", "project.backup.json"
"""The document, and the one before the last write."""
GATE_FILE, CAMERA_PATHS_FILE = "gate.json", "camera_paths.json"
"""Of schema 1: regions and camera paths, which are part of the document now."""
MAX_DOCUMENT_BYTES = 256 << 20
RESTORE = "Restore it from a backup."
"""Hint where the rest of the project has not been looked at."""
_REMOVE = "Correct or remove the file."


class DamagedDocument(ProjectError):
    """project.json is damaged."""


@dataclass(frozen=True, slots=True)
class StoredDocument:
    """The contents of a project.json.

    Attributes:
        document: With the place of the capture as it was written.
        step: How many steps led there since the project was made.
        checksum: Of the file; empty where it has none, because somebody has edited it.
        schema: In which it was written.
    """

    document: ProjectDocument
    step: int
    checksum: str
    schema: int


def read_document(folder: Path) -> ProjectDocument:
    """The document of project.json alone. Raises what `read_stored` raises."""
    return read_stored(folder).document


def read_stored(folder: Path, name: str = PROJECT_FILE) -> StoredDocument:
    """Read project.json, or its backup, and for schema 1 the files next to it.

    Raises:
        DamagedDocument: It is damaged.
        ProjectError: It is missing or of a newer schema.
    """
    path = folder / name
    try:
        found = kept_object(path, "The project file", hint=RESTORE, max_bytes=MAX_DOCUMENT_BYTES)
    except ProjectError as error:
        raise _damaged(error) from error
    if found is None:
        if not folder.exists():
            raise ProjectError("There is no such folder.", hint="Check the path.", path=folder)
        raise ProjectError(
            f"This is not a project folder: it has no {name}.",
            hint="Train a capture first, or open the folder that holds that file.",
            path=folder,
        )
    content, checksum = found
    schema = content.pop("schema", None)
    if type(schema) is not int or schema not in (1, SCHEMA):
        raise ProjectError(
            f"The project has schema {schema!r:.60}, this version reads {SCHEMA}.",
            hint="Use the version that wrote it, or restore the file from a backup.",
            path=path,
        )
    step = content.pop("step", 0) if schema == SCHEMA else 0
    if type(step) is not int or not 0 <= step < 2**53:
        raise DamagedDocument(f"The project file has the step {step!r:.60}.", hint=RESTORE, path=path)
    if schema == 1:
        content = _from_schema_1(folder, content)
    unknown = sorted(content.keys() - set(ENTRIES))
    if unknown:
        raise DamagedDocument(
            f"The project file has unknown entries: {', '.join(unknown):.200}.", hint=HAND_EDITED, path=path
        )
    try:
        return StoredDocument(document_of(content), step, checksum or "", schema)
    except ProjectError as error:
        raise DamagedDocument(error.message, hint="Correct it or restore the file from a backup.", path=path) from error
    except EntryError as error:
        raise DamagedDocument(
            f"The project file has a missing or wrong entry ({error}).", hint=RESTORE, path=path
        ) from error


def _damaged(error: ProjectError) -> DamagedDocument:
    return DamagedDocument(error.message, hint=error.hint, path=error.path)


def document_text(document: ProjectDocument, step: int = 0) -> KeptText:
    """project.json of a document at some step. Raises ProjectError where it cannot be kept."""
    content = {"schema": SCHEMA, "step": step, **plain_document(document)}
    return kept_text(content, max_bytes=MAX_DOCUMENT_BYTES)


def write_document(folder: Path, document: ProjectDocument) -> None:
    """Write project.json of a document without history. Raises what `document_text` and `write_document_text` raise."""
    write_document_text(folder, document_text(document))


def write_document_text(folder: Path, text: KeptText, *, is_backup_kept: bool = True) -> None:
    """Write project.json, keep the one before as its backup, and remove the files that schema 1 has next to it.

    Args:
        is_backup_kept: Whether the one before is sound, so that it may become the backup.
    Raises:
        DiskError: The disk refused; the files before stay.
    """
    path = folder / PROJECT_FILE
    old = [folder / name for name in (GATE_FILE, CAMERA_PATHS_FILE) if (folder / name).exists()]
    if is_backup_kept and not old:  # else a copy of the file alone would lack a part of the document
        _keep_backup(path)
    write_kept(path, text)
    for name in old:
        name.unlink(missing_ok=True)


def _keep_backup(path: Path) -> None:
    """Give the file a second name, under which it stays when it is replaced. Raises DiskError."""
    partial = partial_path(path.with_name(BACKUP_FILE))
    try:
        partial.unlink(missing_ok=True)
        try:
            os.link(path, partial, follow_symlinks=False)
        except FileNotFoundError:
            return
        except OSError:  # a file system without hard links
            partial.write_bytes(path.read_bytes())
        os.replace(partial, path.with_name(BACKUP_FILE))
    except OSError as error:
        raise disk_error(error, what="The project", path=path) from error
    finally:
        partial.unlink(missing_ok=True)


def _from_schema_1(folder: Path, settings: dict[str, Any]) -> dict[str, Any]:
    """Plain data of schema 2: the file held the settings only."""
    regions = read_kept(folder / GATE_FILE, "The file of the gate's regions", hint=_REMOVE) or {"regions": []}
    if regions.keys() != {"regions"} or not isinstance(regions["regions"], list):
        message = 'The file does not hold a list "regions".'
        raise ProjectError(message, hint=_REMOVE, path=folder / GATE_FILE)
    path = folder / CAMERA_PATHS_FILE
    paths = read_kept(path, "The file of the camera paths", hint=_REMOVE, max_bytes=MAX_JSON_BYTES)
    paths = paths or {"schema": 1, "paths": []}
    if paths.get("schema") != 1 or paths.keys() != {"schema", "paths"}:
        message = f"The camera paths have schema {paths.get('schema')!r:.60}, or entries that are not known."
        raise ProjectError(message, hint=_REMOVE, path=path)
    try:
        to_type(paths["paths"], tuple[StoredPath, ...])
    except EntryError as error:
        message = f"The file of the camera paths has a missing or wrong entry ({error})."
        raise ProjectError(message, hint=_REMOVE, path=path) from error
    empty = {"edits": [], "markers": [], "labels": [], "exclusions": {}, "world": {}}
    return {"settings": settings, "regions": regions["regions"], "camera_paths": paths["paths"], **empty}
