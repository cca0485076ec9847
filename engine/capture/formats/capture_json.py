"""capture.json: the layout that says everything, for recordings that no other layout describes and for corrections.

See docs/layouts/capture_json.md for the file. It is read before every other layout, so that a correction of a capture
holds: excluded cameras, offsets in time, held-out cameras, another calibration.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeVar

import numpy as np
from msgspec import Meta

from engine.camera.lens import PARAMETER_NAMES, Lens, LensModel
from engine.capture.cameras.described_camera import DescribedCamera
from engine.capture.files.frame_files import image_files
from engine.capture.files.places import place_in
from engine.capture.layout.assembling import assemble
from engine.capture.layout.format_checks import check_fps, is_name, parse_matrix, read_json_object
from engine.capture.layout.format_result import MATCH, Layout, Probe
from engine.capture.layout.limits import MAX_SIDE
from engine.capture.pixels.frame_fit import FrameFit
from engine.capture.pixels.transfer_curves import CurveName
from engine.errors import CaptureError
from engine.storage.typed_json import EntryError, to_type
from engine.text import shown

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

FORMAT = "capture.json"
LAYOUT = "capture.json, which names videos or images in any order"
"""The layout in words."""
SCHEMA = 1
FILE = "capture.json"
MAX_OFFSET_FRAMES = 1e6
SEE = "docs/layouts/capture_json.md describes the file."

Matrix = list[list[float]]
Side = Annotated[int, Meta(ge=1, le=MAX_SIDE)]
Files = str | list[str]
T = TypeVar("T", bound="DataclassInstance")


@dataclass(frozen=True, slots=True)
class LensEntry:
    """ "lens" of a camera: a model of engine.camera.lens and its parameters in order."""

    model: LensModel = "pinhole"
    params: list[float] = field(default_factory=list)


@dataclass(frozen=True, slots=True)
class CameraDocument:
    """One entry of "cameras".

    Attributes:
        name: Of the camera.
        width, height: Size that K belongs to.
        K: Intrinsics. 3x3
        world_to_camera: OpenCV axes. 4x4
        video: Its video. Either this or `images`.
        images: One image per frame in order, or one pattern as "images/cam00/*.png", sorted naturally.
        lens: How its lens bends rays.
        masks: A video, a list or a pattern like `images`: bright where something moves.
        color_matrix: New RGB = matrix @ old. 3x3
        offset_frames: Its own frame is the capture's frame plus this.
        frames: Numbers of its own frames that the capture shows, in order, where they are not all or not one by one.
        is_excluded: Not used at all.
    """

    name: str
    width: Side
    height: Side
    K: Matrix
    world_to_camera: Matrix
    video: str | None = None
    images: Files | None = None
    lens: LensEntry = field(default_factory=LensEntry)
    masks: Files | None = None
    color_matrix: Matrix | None = None
    offset_frames: Annotated[float, Meta(ge=-MAX_OFFSET_FRAMES, le=MAX_OFFSET_FRAMES)] = 0.0
    frames: list[int] | None = None
    is_excluded: bool = False


@dataclass(frozen=True, slots=True)
class CaptureDocument:
    """The whole file; `cameras` are looked at one by one.

    Attributes:
        schema: SCHEMA.
        cameras: See `CameraDocument`.
        fps: Frames per second; without it that of the videos.
        pixel_center: Where the middle of the first pixel lies: 0.5 as in COLMAP, 0 as in OpenCV.
        holdout: Names of cameras kept out of training unless the user chooses others.
        points: A .ply, or a file of another layout's points, in the world that `world_to_camera` is written in.
        points_to_world: Brings the points into that world, where they are in another one. 4x4
        fisheye_fov_deg: Horizontal view that fisheye pictures are brought to.
        fit: The fit of frames of another shape than `width` and `height` of their camera.
        curve: Transfer curve of all frames; without, values are kept as they are.
        world_scale: All distances are multiplied by it.
        up: Direction in the world that is up; the world is turned so that it becomes +z.
    """

    cameras: list[Any]
    schema: Literal[1] = SCHEMA
    fps: float | None = None
    pixel_center: Annotated[float, Meta(ge=0, le=0.5)] = 0.5
    holdout: list[str] = field(default_factory=list)
    points: str | None = None
    points_to_world: Matrix | None = None
    fisheye_fov_deg: Annotated[float, Meta(ge=10, le=150)] | None = None
    fit: FrameFit | None = None
    curve: CurveName | None = None
    world_scale: Annotated[float, Meta(gt=0, le=1e9)] = 1.0
    up: tuple[float, float, float] | None = None
    notes: str = ""


def probe(folder: Path) -> Probe:
    """Whether the folder looks like this layout."""
    path = folder / FILE
    if path.is_file():
        return MATCH
    return Probe(False, lacks=f"{FILE} is not a file" if path.exists() else f"no {FILE}")


def read(folder: Path, *, follow_links: bool = False) -> Layout:
    """Read cameras and the headers of their frames; no pixels.

    Args:
        follow_links: Whether files may lie outside of the folder.
    Raises:
        CaptureError: Listing every problem found.
    """
    path = folder / FILE
    document = read_document(folder)
    problems: list[CaptureError] = []
    cameras: list[DescribedCamera] = []
    entries: list[CameraDocument] = []
    for row, entry in enumerate(document.cameras):
        try:
            entries.append(_to_known(entry, CameraDocument))
        except EntryError as error:
            name = entry.get("name") if isinstance(entry, dict) else None
            called = f'"{name}"' if isinstance(name, str) and is_name(name) else f"number {row}"
            text = f"Camera {called}: {error}."
            problems.append(CaptureError(text, hint=SEE, path=path))
    for entry in entries:
        if entry.is_excluded:
            continue
        try:
            cameras.append(_described(entry, document, folder, follow_links=follow_links))
        except CaptureError as error:
            problems.append(error.said_of(f'Camera "{entry.name}"'))
    if document.fps is not None:
        problems += check_fps(document.fps, path)
    points = None
    if document.points is not None:
        try:
            points = place_in(folder, document.points, follow_links=follow_links, named_in=path)
        except CaptureError as error:
            problems.append(error)
    excluded = {entry.name for entry in entries if entry.is_excluded}
    return assemble(
        folder,
        FORMAT,
        cameras,
        fps=document.fps,
        default_holdout=[name for name in document.holdout if name not in excluded],
        points=points,
        points_to_world=_points_to_world(document, path, problems),
        fisheye_fov_deg=document.fisheye_fov_deg,
        fit=document.fit,
        curve=document.curve,
        problems=problems,
        said_in=path,
    )


def read_document(folder: Path) -> CaptureDocument:
    """The file in this folder, its cameras not looked at yet.

    Raises:
        CaptureError: It is missing, not JSON, or its entries are unknown or of the wrong kind.
    """
    path = folder / FILE
    content = read_json_object(path)
    if content.get("schema", SCHEMA) != SCHEMA:
        raise CaptureError(
            f"The file has schema {shown(content['schema'])}, this program reads {SCHEMA}.",
            hint="Use the version that wrote it.",
            path=path,
        )
    try:
        document = _to_known(content, CaptureDocument)
    except EntryError as error:
        raise CaptureError(f"The file cannot be used ({error}).", hint=SEE, path=path) from error
    if document.up is not None and not 1e-6 < float(np.linalg.norm(document.up)) < 1e6:
        raise CaptureError("up is not a direction.", hint="Give three numbers, not all zero.", path=path)
    return document


def _to_known(content: Any, kind: type[T]) -> T:
    """As `to_type`; an entry that is not known is refused too, because a mistyped one would else do nothing."""
    unknown = sorted(content.keys() - {item.name for item in fields(kind)}) if isinstance(content, dict) else []
    if unknown:
        raise EntryError(f"it has an entry {shown(unknown[0])}, which is not known")
    return to_type(content, kind)


def _described(
    entry: CameraDocument, document: CaptureDocument, folder: Path, *, follow_links: bool
) -> DescribedCamera:
    path = folder / FILE
    if (entry.video is None) == (entry.images is None):
        which = "neither video nor images" if entry.video is None else "both video and images"
        raise CaptureError(f"It has {which}.", hint="Give one of them.", path=path)
    K, pose = parse_matrix(entry.K, (3, 3)), parse_matrix(entry.world_to_camera, (4, 4))
    if K is None or pose is None:
        which = "3x3 K" if K is None else "4x4 world_to_camera"
        raise CaptureError(f"It has no {which} of numbers.", hint=SEE, path=path)
    colors = None
    if entry.color_matrix is not None and (colors := parse_matrix(entry.color_matrix, (3, 3))) is None:
        raise CaptureError("Its color_matrix is not 3x3 numbers.", hint=SEE, path=path)
    if len(entry.lens.params) > len(PARAMETER_NAMES[entry.lens.model]):
        most = len(PARAMETER_NAMES[entry.lens.model])
        text = f"Its lens has {len(entry.lens.params)} parameters, {entry.lens.model} has {most}."
        raise CaptureError(text, hint=SEE, path=path)
    K[:2, 2] += 0.5 - document.pixel_center
    if document.up is not None:
        turn = np.eye(4)
        turn[:3, :3] = turn_up(np.array(document.up))
        pose = pose @ turn.T
    pose[:3, 3] *= document.world_scale

    def placed(files: Files) -> list[Path]:
        return image_files(folder, files, follow_links=follow_links, named_in=path)

    def placed_file(name: str) -> Path:
        return place_in(folder, name, follow_links=follow_links, named_in=path)

    masks: Path | list[Path] | None = None
    if entry.masks is not None:
        is_video = isinstance(entry.masks, str) and "*" not in entry.masks
        masks = placed_file(entry.masks) if is_video and isinstance(entry.masks, str) else placed(entry.masks)
    return DescribedCamera(
        name=entry.name,
        K=K,
        world_to_camera=pose,
        files=placed_file(entry.video) if entry.video is not None else placed(entry.images or []),
        said_in=path,
        calibrated_size=(entry.width, entry.height),
        lens=Lens(entry.lens.model, tuple(entry.lens.params)),
        masks=masks,
        color_matrix=colors,
        offset_frames=entry.offset_frames,
        curve=document.curve,
        frame_indices=entry.frames,
    )


def _points_to_world(document: CaptureDocument, path: Path, problems: list[CaptureError]) -> np.ndarray | None:
    """From the points of the file to the world of the cameras as they are read: turned up and scaled, too."""
    matrix = np.eye(4)
    if document.points_to_world is not None:
        given = parse_matrix(document.points_to_world, (4, 4))
        if given is None or not np.isfinite(given).all() or not np.array_equal(given[3], [0.0, 0.0, 0.0, 1.0]):
            text = "points_to_world is not a 4x4 map with the last row 0 0 0 1."
            problems.append(CaptureError(text, hint=SEE, path=path))
        else:
            matrix = given
    if document.up is not None:
        turn = np.eye(4)
        turn[:3, :3] = turn_up(np.array(document.up))
        matrix = turn @ matrix
    matrix[:3] *= document.world_scale
    return None if np.array_equal(matrix, np.eye(4)) else matrix


def turn_up(up: np.ndarray) -> np.ndarray:
    """The smallest rotation that turns a direction [3], not zero, to +z. [3, 3]"""
    up = up / np.linalg.norm(up)
    axis = np.cross(up, [0.0, 0.0, 1.0])
    sin, cos = float(np.linalg.norm(axis)), float(up[2])
    if sin < 1e-12:
        return np.eye(3) if cos > 0 else np.diag([1.0, -1.0, -1.0])
    x, y, z = axis / sin
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    angle = math.atan2(sin, cos)
    return np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross
