"""A scene that another program made: views of it, but no pictures. Written by `clipgstream import`.

imported.json names the frames, their rate and virtual cameras around the contents, so that the scene can be framed and
exported like any other. Its Gaussians lie in the clips of the project.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal, NoReturn

import numpy as np
from msgspec import Meta, Struct, to_builtins

from engine.camera.rig import CameraRig
from engine.capture.layout.format_checks import (
    check_fps,
    check_K,
    check_names,
    check_pose,
    parse_matrix,
    raise_problems,
    read_json_object,
)
from engine.capture.layout.format_result import MATCH, CameraEntry, Layout, Probe
from engine.capture.layout.limits import MAX_SIDE
from engine.errors import CaptureError
from engine.storage.files import atomic_path
from engine.storage.json_files import json_text
from engine.storage.typed_json import EntryError, to_type

FORMAT = "imported scene"
LAYOUT = "imported.json, the views of a scene from another program, which has no pictures"
"""The layout in words."""
FILE = "imported.json"
MAX_SCALE = 1e9
QUAT_TOLERANCE = 1e-4
NO_PICTURES = "This scene was imported and has no pictures."

Quat = tuple[float, float, float, float]
_Side = Annotated[int, Meta(ge=1, le=MAX_SIDE)]


class ImportedView(Struct, frozen=True, forbid_unknown_fields=True):
    """A virtual camera; as in capture.json."""

    name: str
    width: _Side
    height: _Side
    K: list[list[float]]
    world_to_camera: list[list[float]]


class ScenePlace(Struct, frozen=True, forbid_unknown_fields=True):
    """Where an export of our own placed a scene: a rotation and a scale away from the capture that it was made of.

    Attributes:
        quat: wxyz, unit length.
        scale: Units of the scene per unit of that capture, > 0.
    """

    quat: Quat
    scale: float

    def __post_init__(self) -> None:
        """Raises ValueError where it is no such thing."""
        length = math.hypot(*self.quat)
        if not abs(length - 1.0) < QUAT_TOLERANCE:
            raise ValueError(f"its quat has length {length:g}, not 1")
        if not 0.0 < self.scale < MAX_SCALE:
            raise ValueError(f"its scale is {self.scale:g}")


class ImportedDocument(Struct, frozen=True, forbid_unknown_fields=True):
    """The whole file.

    Attributes:
        n_frames, fps: Of the scene.
        source: File or folder that it was read from, as a name for people.
        views: At least one.
        notes: What of the scene is not kept, as sentences.
        place: None where it is not known.
    """

    schema: Literal[1]
    n_frames: Annotated[int, Meta(ge=1, lt=2**31)]
    fps: float
    source: str
    views: list[ImportedView]
    notes: list[str] = []
    place: ScenePlace | None = None


@dataclass(frozen=True, slots=True)
class NoFrames:
    """The frames of a camera that took none."""

    path: Path
    n_frames: int

    def read(self, frame_indices: Sequence[int]) -> Iterator[np.ndarray]:
        """Raises CaptureError."""
        raise_no_pictures(self.path)

    def close(self) -> None:
        """Nothing is open."""


def finished_word(*, has_pictures: bool) -> str:
    """What users call a finished clip of a capture with or without pictures."""
    return "trained" if has_pictures else "imported"


def raise_no_pictures(path: Path) -> NoReturn:
    """Refuse what needs pictures. Raises CaptureError."""
    raise CaptureError(NO_PICTURES, hint="It can be viewed, edited and exported, not trained or measured.", path=path)


def probe(folder: Path) -> Probe:
    """Whether the folder looks like this layout."""
    return MATCH if (folder / FILE).is_file() else Probe(False, lacks=f"no {FILE}")


def read(folder: Path, *, follow_links: bool = False) -> Layout:
    """Read the views.

    Raises:
        CaptureError: Listing every problem found.
    """
    path, document = folder / FILE, _document(folder)
    problems = check_fps(document.fps, path) + check_names([view.name for view in document.views], path)
    cameras, source = [], NoFrames(path, document.n_frames)
    for view in document.views:
        K, pose = parse_matrix(view.K, (3, 3)), parse_matrix(view.world_to_camera, (4, 4))
        if K is None or pose is None:
            problems.append(CaptureError(f'View "{view.name}" has no K or pose.', hint="Import again.", path=path))
            continue
        size = (view.width, view.height)
        problems += check_K(view.name, K, size, path) + check_pose(view.name, pose, path)
        cameras.append(CameraEntry(name=view.name, K=K, world_to_camera=pose, image_size=size, source=source))
    raise_problems(problems, folder)
    return Layout(
        format=FORMAT,
        cameras=tuple(cameras),
        n_frames=document.n_frames,
        fps=document.fps,
        warnings=tuple(document.notes),
        has_pictures=False,
    )


def _document(folder: Path) -> ImportedDocument:
    path = folder / FILE
    try:
        return to_type(read_json_object(path), ImportedDocument)
    except EntryError as error:
        raise CaptureError(f"The file cannot be used ({error}).", hint="Import the scene again.", path=path) from error


def read_place(folder: Path) -> ScenePlace | None:
    """Where the scene of a capture folder was placed; None where that is not known. Raises CaptureError."""
    return _document(folder).place if (folder / FILE).is_file() else None


def write_imported(
    folder: Path,
    rig: CameraRig,
    *,
    n_frames: int,
    fps: float,
    source: str,
    notes: Sequence[str],
    place: ScenePlace | None = None,
) -> None:
    """Write the file into a folder. Inverse of `read`. Raises OSError."""
    views = [
        ImportedView(
            name, int(rig.image_sizes[i, 0]), int(rig.image_sizes[i, 1]), rig.Ks[i].tolist(),
            rig.world_to_camera[i].tolist(),
        )
        for i, name in enumerate(rig.names)
    ]  # fmt: skip
    document = ImportedDocument(1, n_frames, fps, source, views, list(notes), place)
    with atomic_path(folder / FILE) as partial:
        partial.write_text(json_text(to_builtins(document), indent=1) + "\n", encoding="utf-8")
