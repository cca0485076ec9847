"""camera_paths.json: the camera paths of a project, for everything that films it. Read strictly, with a checksum."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
from msgspec import Meta, Struct, to_builtins

from app.project.kept_json import read_kept, write_kept
from engine.camera.camera_path import CameraKey, CameraPath
from engine.errors import ProjectError
from engine.storage.json_files import MAX_JSON_BYTES
from engine.storage.typed_json import EntryError, to_type
from engine.text import shown

CAMERA_PATHS_FILE = "camera_paths.json"
SCHEMA = 1
MAX_PATHS = 1000
MAX_KEYS = 20_000
"""Of all paths together; the file then has some 16 MB."""
MAX_NAME_CHARACTERS = 200
_HINT = "Correct or remove the file; nothing else of the project depends on it."

_Row = Annotated[tuple[float, ...], Meta(min_length=4, max_length=4)]


class _StoredKey(Struct, frozen=True, forbid_unknown_fields=True):
    """See CameraKey."""

    frame: float
    world_to_camera: Annotated[tuple[_Row, ...], Meta(min_length=4, max_length=4)]
    fov_y_rad: float


class _StoredPath(Struct, frozen=True, forbid_unknown_fields=True):
    """See CameraPath."""

    name: Annotated[str, Meta(min_length=1, max_length=MAX_NAME_CHARACTERS)]
    is_closed: bool
    keys: tuple[_StoredKey, ...]


class _Stored(Struct, frozen=True, forbid_unknown_fields=True):
    """The file."""

    schema: int
    paths: tuple[_StoredPath, ...]


def read_camera_paths(folder: Path) -> tuple[CameraPath, ...]:
    """The camera paths of a project in the user's order; none where there is no such file. folder: Of the project.

    Raises:
        ProjectError: The file is damaged, of a newer schema, or holds something that is not a camera path.
    """
    path = folder / CAMERA_PATHS_FILE
    content = read_kept(path, "The file of the camera paths", hint=_HINT, max_bytes=MAX_JSON_BYTES)
    if content is None:
        return ()
    if content.get("schema") != SCHEMA or type(content["schema"]) is not int:
        raise ProjectError(
            f"The camera paths have schema {content.get('schema')!r:.60}, this version reads {SCHEMA}.",
            hint="Use the version that wrote them, or remove the file.",
            path=path,
        )
    try:
        stored = to_type(content, _Stored)
    except EntryError as error:
        raise ProjectError(
            f"The file of the camera paths has a missing or wrong entry ({error}).", hint=_HINT, path=path
        ) from error
    try:
        paths = tuple(_path(values) for values in stored.paths)
        check_paths(paths)
    except ValueError as error:
        raise ProjectError(f"A camera path makes no sense: {error}.", hint=_HINT, path=path) from error
    except ProjectError as error:
        raise ProjectError(error.message, hint=_HINT, path=path) from error
    return paths


def write_camera_paths(folder: Path, paths: Sequence[CameraPath]) -> None:
    """Replace the camera paths of a project, atomically.

    Raises:
        ProjectError: They cannot be kept, see `check_paths`.
        DiskError: The disk refused.
    """
    check_paths(paths)
    stored = tuple(
        _StoredPath(
            path.name,
            path.is_closed,
            tuple(
                _StoredKey(key.frame, tuple(tuple(row) for row in key.world_to_camera.tolist()), key.fov_y_rad)
                for key in path.keys
            ),
        )
        for path in paths
    )
    write_kept(folder / CAMERA_PATHS_FILE, to_builtins(_Stored(SCHEMA, stored)))


def camera_path_named(folder: Path, name: str) -> CameraPath:
    """One camera path of a project, ready to be followed. folder: Of the project.

    Raises:
        ProjectError: There is no such path or it has no keys; or see `read_camera_paths`.
    """
    paths = read_camera_paths(folder)
    found = next((path for path in paths if path.name == name), None)
    if found is None:
        known = ", ".join(path.name for path in paths[:8]) + (" and more" if len(paths) > 8 else "")
        hint = f"Camera paths are: {known}." if paths else "The project has no camera paths; make one in the window."
        raise ProjectError(f"There is no camera path called {shown(name)}.", hint=hint, path=folder)
    if not found.keys:
        raise ProjectError(f"The camera path {shown(name)} has no keys.", hint="Add keys to it in the window.")
    return found


def check_paths(paths: Sequence[CameraPath]) -> None:
    """See that paths can be kept and told apart: each has a name of its own, and there are not too many.

    Raises:
        ProjectError: They cannot; says why.
    """
    names: set[str] = set()
    for path in paths:
        if len(path.name) > MAX_NAME_CHARACTERS:
            raise ProjectError(
                f"The name of a camera path has {len(path.name)} characters, at most {MAX_NAME_CHARACTERS} are kept.",
                hint="Use a shorter name.",
            )
        if not _is_unicode(path.name):
            raise ProjectError(f"The name {shown(path.name)} is not Unicode.", hint="Use another name.")
        if path.name in names:
            raise ProjectError(f"There are two camera paths called {shown(path.name)}.", hint="Use another name.")
        names.add(path.name)
    n_keys = sum(len(path.keys) for path in paths)
    if len(paths) > MAX_PATHS or n_keys > MAX_KEYS:
        raise ProjectError(
            f"There are {len(paths)} camera paths with {n_keys} keys; at most {MAX_PATHS} with {MAX_KEYS} are kept.",
            hint="Delete some that are not needed.",
        )


def _is_unicode(name: str) -> bool:
    try:
        name.encode("utf-8")
    except UnicodeEncodeError:
        return False
    return True


def _path(values: _StoredPath) -> CameraPath:
    keys = tuple(
        CameraKey(key.frame, np.array(key.world_to_camera, dtype=np.float64), key.fov_y_rad) for key in values.keys
    )
    return CameraPath(values.name, keys, values.is_closed)
