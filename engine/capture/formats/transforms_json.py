"""transforms.json of nerfstudio and instant-ngp, also split into transforms_train.json, _val and _test.

`frames` lists pictures with their `transform_matrix`, camera to world with OpenGL axes (x right, y up, z back), and
maybe a `time`. Intrinsics stand at the top or with each picture: `fl_x fl_y cx cy w h`, or `camera_angle_x`, and
`k1 k2 k3 k4 p1 p2` of OPENCV or OPENCV_FISHEYE. Pixel centres are at +0.5. Pictures with one pose are of one camera.
Where no times are given and each camera has one picture, its other frames are those of its folder or its video.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from engine.capture.cameras.described_camera import DescribedCamera
from engine.capture.cameras.transforms_numbers import K_of, lens_of, world_to_camera_of
from engine.capture.files.frame_files import IMAGE_SUFFIXES, VIDEO_SUFFIXES, Files, images_in, listed
from engine.capture.files.frame_search import FrameSearch
from engine.capture.files.media import read_image_header
from engine.capture.files.places import place_in
from engine.capture.layout.assembling import assemble
from engine.capture.layout.findings import Findings
from engine.capture.layout.format_checks import check_fps, parse_matrix, parse_size, read_json_object, size_problem
from engine.capture.layout.format_result import MATCH, Layout, Probe
from engine.capture.layout.grouped_frames import FrameGroup, ListedFrame, grouped, time_faults
from engine.errors import CaptureError
from engine.text import shown

FORMAT = "transforms.json"
LAYOUT = "transforms.json, or transforms_train.json, with images or videos (nerfstudio, instant-ngp)"
"""The layout in words."""
WHOLE = "transforms.json"
SPLITS = ("transforms_train.json", "transforms_val.json", "transforms_test.json")
FRAME_FOLDERS = ("videos", "images", "")
VALUES = (
    *("fl_x", "fl_y", "cx", "cy", "w", "h", "k1", "k2", "k3", "k4", "p1", "p2"),
    *("camera_angle_x", "camera_angle_y", "camera_model", "is_fisheye"),
)
"""Keys that may stand at the top or with a picture."""
HINT = "docs/layouts/transforms_json.md describes the file."
MAX_PROBLEMS = 50
"""Limit of the pictures whose faults are reported."""


def probe(folder: Path) -> Probe:
    """Whether the folder looks like this layout."""
    if (folder / WHOLE).is_file() or (folder / SPLITS[0]).is_file():
        return MATCH
    for name in SPLITS[1:]:
        if (folder / name).is_file():
            return Probe(False, seen=name, lacks=f"no {SPLITS[0]}", hint=f"Put {SPLITS[0]} next to it.")
    return Probe(False, lacks=f"no {WHOLE}")


def read(folder: Path, *, follow_links: bool = False) -> Layout:
    """Read cameras and the headers of their frames; no pixels.

    Args:
        follow_links: Whether frames may lie outside of the folder.
    Raises:
        CaptureError: Listing every problem found.
    """
    findings = Findings()
    names = [WHOLE] if (folder / WHOLE).is_file() else [name for name in SPLITS if (folder / name).exists()]
    documents: dict[str, dict[str, Any]] = {}
    for name in names:
        document = findings.tried(lambda name=name: read_json_object(folder / name))
        if document is not None:
            documents[name] = document
    listed_frames = [
        frame for name, document in documents.items() for frame in _frames(name, document, folder, findings)
    ]
    if findings.problems or not listed_frames:
        return assemble(folder, FORMAT, [], problems=findings.problems, said_in=folder / names[0])
    place = _Place(folder, folder / names[0], follow_links, findings)
    groups = grouped(listed_frames)
    has_times = _check_times(groups, place)
    warnings: list[str] = []
    cameras = [_described(group, groups, place, has_times=has_times) for group in groups]
    points = _points(documents, place, warnings)
    return assemble(
        folder,
        FORMAT,
        [camera for camera in cameras if camera is not None],
        fps=_fps(documents, place),
        default_holdout=_holdout(groups, documents),
        points=points,
        problems=findings.problems,
        warnings=warnings,
        said_in=place.path,
    )


@dataclass(frozen=True, eq=False)
class _Place:
    """Where a capture lies and what was found about it."""

    folder: Path
    path: Path
    follow_links: bool
    findings: Findings

    def file(self, name: str) -> Path:
        """Path of a file that the table names; a missing suffix is that of an image which is there."""
        plain = name[2:] if name.startswith("./") else name
        path = place_in(self.folder, plain, follow_links=self.follow_links, named_in=self.path)
        if path.suffix.lower() not in IMAGE_SUFFIXES and not path.exists():
            for suffix in (".png", ".jpg", ".jpeg"):
                if (self.folder / (plain + suffix)).exists():
                    return place_in(self.folder, plain + suffix, follow_links=self.follow_links, named_in=self.path)
        return path


def _frames(table: str, document: dict[str, Any], folder: Path, findings: Findings) -> list[ListedFrame]:
    """The pictures of one file, its own values for all where they have none."""
    path = folder / table
    rows = document.get("frames")
    if not isinstance(rows, list) or not rows:
        findings.add(CaptureError("The file lists no frames.", hint=HINT, path=path))
        return []
    common = {key: document[key] for key in VALUES if key in document}
    found: list[ListedFrame] = []
    for row, entry in enumerate(rows):
        if len(findings.problems) >= MAX_PROBLEMS:
            break
        frame = findings.tried(lambda row=row, entry=entry: _frame(row, entry, common, table, path))
        if frame is not None:
            found.append(frame)
    return found


def _frame(row: int, entry: object, common: dict[str, Any], table: str, path: Path) -> ListedFrame:
    if not isinstance(entry, dict) or not isinstance(entry.get("file_path"), str):
        raise CaptureError(f"Frame {row} has no file_path.", hint=HINT, path=path)
    matrix = entry.get("transform_matrix")
    pose = parse_matrix(matrix, (4, 4))
    if pose is None and (short := parse_matrix(matrix, (3, 4))) is not None:
        pose = np.vstack([short, [0.0, 0.0, 0.0, 1.0]])
    if pose is None:
        text = f"Frame {row} ({shown(entry['file_path'])}) has no 4x4 transform_matrix of numbers."
        raise CaptureError(text, hint=HINT, path=path)
    time = entry.get("time")
    if time is not None and not _is_number(time):
        raise CaptureError(f"Frame {row} has the time {shown(time)}.", hint="Give a number.", path=path)
    mask = entry.get("mask_path")
    own = {key: entry[key] for key in VALUES if key in entry}
    return ListedFrame(entry["file_path"], pose, common | own, time, mask if isinstance(mask, str) else None, table)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e12  # NaN compares false


def _check_times(groups: Sequence[FrameGroup], place: _Place) -> bool:
    """Whether pictures have times. Adds what is wrong with them."""
    has_time = [frame.time is not None for group in groups for frame in group.frames]
    if not any(has_time):
        return False
    if not all(has_time):
        n_without = len(has_time) - sum(has_time)
        text = f"{n_without} of {len(has_time)} frames have no time."
        place.findings.add(CaptureError(text, hint="Give a time to all of them or to none.", path=place.path))
        return True
    for fault in time_faults(groups)[1]:
        hint = "Cameras must stand still and have a picture at every time."
        text = f"{fault[0].upper()}{fault[1:]}."
        place.findings.add(CaptureError(text, hint=hint, path=place.path))
    return True


def _described(
    group: FrameGroup, groups: Sequence[FrameGroup], place: _Place, *, has_times: bool
) -> DescribedCamera | None:
    """One camera; None where something is wrong with it, which is kept."""
    first = group.frames[0]
    tried = place.findings.tried
    if any(frame.values != first.values for frame in group.frames):
        text = "Its intrinsics differ between frames."
        place.findings.add(
            CaptureError(text, hint="Give each camera one calibration.", path=place.path), camera=group.name
        )
    files = tried(lambda: _files(group, groups, place, has_times=has_times), camera=group.name)
    if files is None:
        return None
    size = tried(lambda: _size(first.values, files, place), camera=group.name)
    lens = tried(lambda: lens_of(first.values, place.path), camera=group.name)
    K = None if size is None else tried(lambda: K_of(first.values, size, place.path), camera=group.name)
    pose = tried(lambda: world_to_camera_of(first.camera_to_world, place.path), camera=group.name)
    masks = tried(lambda: [_masks(group, files, place)], camera=group.name)
    if size is None or lens is None or K is None or pose is None or masks is None:
        return None
    return DescribedCamera(
        name=group.name,
        K=K,
        world_to_camera=pose,
        files=files,
        said_in=place.path,
        calibrated_size=size,
        lens=lens,
        masks=masks[0],
    )


def _files(group: FrameGroup, groups: Sequence[FrameGroup], place: _Place, *, has_times: bool) -> Files:
    paths = [place.file(frame.file) for frame in group.frames]
    if has_times or any(len(other.frames) > 1 for other in groups):
        return paths
    path = paths[0]
    if path.suffix.lower() in VIDEO_SUFFIXES:
        return path
    parents = [place.file(other.frames[0].file).parent for other in groups]
    if parents.count(path.parent) == 1 and path.parent != place.folder and path.parent.is_dir():
        names = listed(path.parent, IMAGE_SUFFIXES)
        if len(names) > 1:
            below = path.parent.relative_to(place.folder).as_posix()
            return images_in(place.folder, below, names, follow_links=place.follow_links, named_in=place.path)
    search = FrameSearch(place.folder, FRAME_FOLDERS, follow_links=place.follow_links, named_in=place.path)
    try:
        return search.files([path.stem])
    except CaptureError:  # a single picture of each camera is a capture of one frame
        return paths


def _masks(group: FrameGroup, files: Files, place: _Place) -> list[Path] | None:
    if isinstance(files, Path) or len(files) != len(group.frames):
        return None
    names = [frame.mask for frame in group.frames if frame.mask is not None]
    return [place.file(name) for name in names] if len(names) == len(group.frames) else None


def _size(values: dict[str, Any], files: Files, place: _Place) -> tuple[int, int]:
    sides = [values.get("w"), values.get("h")]
    if sides == [None, None]:
        if isinstance(files, Path):
            raise CaptureError("It has no w and h.", hint=HINT, path=place.path)
        return read_image_header(files[0]).size
    whole = [int(side) if isinstance(side, float) and side.is_integer() else side for side in sides]
    size = parse_size(whole[0], whole[1])
    if size is None:
        raise size_problem("w and h are", sides[0], sides[1], place.path)
    return size


def _points(documents: dict[str, dict[str, Any]], place: _Place, warnings: list[str]) -> Path | None:
    name = next((document["ply_file_path"] for document in documents.values() if "ply_file_path" in document), None)
    if not isinstance(name, str):
        return None
    path = place.findings.tried(lambda: place.file(name))
    if path is not None and not path.is_file():
        warnings.append(f"The point cloud {shown(name)} is missing.")
        return None
    return path


def _fps(documents: dict[str, dict[str, Any]], place: _Place) -> float | None:
    fps = next((document["fps"] for document in documents.values() if "fps" in document), None)
    place.findings.problems += [] if fps is None else check_fps(fps, place.path)
    return fps


def _holdout(groups: Sequence[FrameGroup], documents: dict[str, dict[str, Any]]) -> list[str]:
    """Cameras of which no picture is to be trained with."""
    if WHOLE not in documents:
        return [group.name for group in groups if all(frame.table != SPLITS[0] for frame in group.frames)]
    train = documents[WHOLE].get("train_filenames")
    if not isinstance(train, list):
        return []
    names = {name for name in train if isinstance(name, str)}
    return [group.name for group in groups if all(frame.file not in names for frame in group.frames)]
