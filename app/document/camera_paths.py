"""The camera paths of a document, for everything that films a project: how they are stored and checked."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
from msgspec import Meta, Struct

from engine.camera.camera_path import CameraKey, CameraPath
from engine.errors import ProjectError
from engine.text import shown

MAX_PATHS = 1000
MAX_KEYS = 20_000
"""Of all paths together; the file then has some 16 MB."""
MAX_NAME_CHARACTERS = 200

_Row = Annotated[tuple[float, ...], Meta(min_length=4, max_length=4)]


class _StoredKey(Struct, frozen=True, forbid_unknown_fields=True):
    """See CameraKey."""

    frame: float
    world_to_camera: Annotated[tuple[_Row, ...], Meta(min_length=4, max_length=4)]
    fov_y_rad: float


class StoredPath(Struct, frozen=True, forbid_unknown_fields=True):
    """See CameraPath."""

    name: Annotated[str, Meta(min_length=1, max_length=MAX_NAME_CHARACTERS)]
    is_closed: bool
    keys: tuple[_StoredKey, ...]


def stored_path(path: CameraPath) -> StoredPath:
    """A camera path as it is stored."""
    keys = (_StoredKey(key.frame, tuple(map(tuple, key.world_to_camera.tolist())), key.fov_y_rad) for key in path.keys)
    return StoredPath(path.name, path.is_closed, tuple(keys))


def to_path(stored: StoredPath) -> CameraPath:
    """A camera path as it was stored.

    Raises:
        ProjectError: It is not valid.
    """
    try:
        keys = tuple(
            CameraKey(key.frame, np.array(key.world_to_camera, dtype=np.float64), key.fov_y_rad) for key in stored.keys
        )
        return CameraPath(stored.name, keys, stored.is_closed)
    except ValueError as error:
        raise ProjectError(f"A camera path is not valid: {error}.") from error


def camera_path_named(paths: Sequence[CameraPath], name: str, folder: Path) -> CameraPath:
    """One of the camera paths of a project, ready to be followed. folder: Of the project, for messages.

    Raises:
        ProjectError: There is no such path or it has no keys.
    """
    found = next((path for path in paths if path.name == name), None)
    if found is None:
        known = ", ".join(path.name for path in paths[:8]) + (" and more" if len(paths) > 8 else "")
        hint = f"Camera paths are: {known}." if paths else "The project has no camera paths; make one in the window."
        raise ProjectError(f"There is no camera path called {shown(name)}.", hint=hint, path=folder)
    if not found.keys:
        raise ProjectError(f"The camera path {shown(name)} has no keys.", hint="Add keys to it in the window.")
    return found


def check_paths(paths: Sequence[CameraPath]) -> None:
    """Check that paths can be kept and distinguished: each has its own name, and there are not too many.

    Raises:
        ProjectError: They cannot; states the cause.
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
