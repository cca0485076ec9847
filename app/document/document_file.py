"""project.json: the document of a project. Read strictly, written with a checksum; earlier schemas are taken over.

An edit by hand is accepted where the entry "checksum" was taken out; otherwise it looks like damage, and the message
says so.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from app.document.camera_paths import StoredPath
from app.document.kept_json import read_kept, write_kept
from app.document.project_document import ProjectDocument
from app.document.stored_document import ENTRIES, document_of, plain_document
from engine.errors import ProjectError
from engine.storage.json_files import HAND_EDITED, MAX_JSON_BYTES
from engine.storage.typed_json import EntryError, to_type

SCHEMA = 2
PROJECT_FILE = "project.json"
GATE_FILE, CAMERA_PATHS_FILE = "gate.json", "camera_paths.json"
"""Of schema 1: regions and camera paths, which are part of the document now."""
_RESTORE = "Restore it from a copy."
_REMOVE = "Correct or remove the file."


def read_document(folder: Path) -> ProjectDocument:
    """Read project.json, and of schema 1 what lay beside it.

    Raises:
        ProjectError: It is missing, damaged, of a newer schema, or holds unknown or ill-typed values.
    """
    path = folder / PROJECT_FILE
    content = read_kept(path, "The project file", hint=_RESTORE, max_bytes=MAX_JSON_BYTES)
    if content is None:
        if not folder.exists():
            raise ProjectError("There is no such folder.", hint="Check the path.", path=folder)
        raise ProjectError(
            f"This is not a project folder: it has no {PROJECT_FILE}.",
            hint="Train a capture first, or open the folder that holds that file.",
            path=folder,
        )
    schema = content.pop("schema", None)
    if type(schema) is not int or schema not in (1, SCHEMA):
        raise ProjectError(
            f"The project has schema {schema!r:.60}, this version reads {SCHEMA}.",
            hint="Use the version that wrote it, or restore the file from a copy.",
            path=path,
        )
    if schema == 1:
        content = _from_schema_1(folder, content)
    unknown = sorted(content.keys() - set(ENTRIES))
    if unknown:
        raise ProjectError(
            f"The project file has unknown entries: {', '.join(unknown):.200}.", hint=HAND_EDITED, path=path
        )
    try:
        return document_of(content)
    except ProjectError as error:
        raise ProjectError(error.message, hint="Correct it or restore the file from a copy.", path=path) from error
    except EntryError as error:
        raise ProjectError(
            f"The project file has a missing or wrong entry ({error}).", hint=_RESTORE, path=path
        ) from error


def write_document(folder: Path, document: ProjectDocument) -> None:
    """Write project.json, and remove what lay beside that of schema 1.

    Raises:
        ProjectError: The document cannot be kept.
        DiskError: The disk refused.
    """
    write_kept(folder / PROJECT_FILE, {"schema": SCHEMA, **plain_document(document)})
    for name in (GATE_FILE, CAMERA_PATHS_FILE):
        (folder / name).unlink(missing_ok=True)


def _from_schema_1(folder: Path, settings: dict[str, Any]) -> dict[str, Any]:
    """Plain data of schema 2: the file held the settings only."""
    regions = read_kept(folder / GATE_FILE, "The file of the gate's regions", hint=_REMOVE) or {"regions": []}
    if regions.keys() != {"regions"} or not isinstance(regions["regions"], list):
        message = 'The file holds something else than a list "regions".'
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
