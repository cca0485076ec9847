"""CMU Panoptic captures as packaged for Dynamic 3D Gaussians: train_meta.json, test_meta.json and ims/<camera>/.

Both files hold `w`, `h` and, per frame t and camera i, `k[t][i]` 3x3, `w2c[t][i]` 4x4 (OpenCV axes), `fn[t][i]` (file
below ims/) and `cam_id[t][i]`. The cameras of the two files are merged and sorted by id; those of test_meta.json are
the default hold-out. Cameras must not move. The dome records at 30 frames per second, which the files do not say.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from engine.capture.cameras.described_camera import DescribedCamera
from engine.capture.files.duplicates import CameraFiles, check_duplicates
from engine.capture.files.frame_files import natural_key
from engine.capture.files.media import ImageHeader, read_image_header
from engine.capture.files.places import place_in
from engine.capture.frames import ImageFrames
from engine.capture.growing.mode import is_growing
from engine.capture.growing.numbered_files import NumberedFiles
from engine.capture.growing.reading import as_long_as_the_longest, numbered
from engine.capture.layout.format_checks import (
    check_equal_counts,
    check_image_header,
    check_K,
    check_names,
    check_pose,
    parse_matrix,
    parse_size,
    raise_problems,
    read_json_object,
    shortened,
    size_problem,
)
from engine.capture.layout.format_result import MATCH, CameraEntry, Layout, Probe
from engine.capture.layout.limits import MAX_CAMERA_ID
from engine.capture.points import points_that_came
from engine.errors import CaptureError

FORMAT = "panoptic"
LAYOUT = "train_meta.json, test_meta.json and images below ims/ (CMU Panoptic, as for Dynamic 3D Gaussians)"
"""The layout in words."""
FPS = 30.0
POINTS = "init_pt_cld.npz"
META_FILES = ("train_meta.json", "test_meta.json")
MAX_HEADERS = 6000
"""Images whose headers are read on opening, spread over cameras and time; others are looked at when decoded."""
KEYS = ("w", "h", "k", "w2c", "fn", "cam_id")


@dataclass(frozen=True, slots=True)
class _MetaCamera:
    """One camera of one meta file, not yet checked for its frames."""

    camera_id: int
    K: np.ndarray  # [3, 3]
    world_to_camera: np.ndarray  # [4, 4]
    image_size: tuple[int, int]
    files: tuple[str, ...]  # below ims/, one per frame
    meta_path: Path
    is_test: bool


def probe(folder: Path) -> Probe:
    """Whether the folder looks like this layout."""
    if any((folder / name).is_file() for name in META_FILES):
        return MATCH
    return Probe(False, lacks="no train_meta.json or test_meta.json")


def read(folder: Path, *, follow_links: bool = False) -> Layout:
    """Read cameras and the frame index; no pixels.

    Args:
        follow_links: Whether images may lie outside of the folder.
    Raises:
        CaptureError: Listing every problem found.
    """
    place_in(folder, "ims", follow_links=follow_links, named_in=folder)  # often a link to another disk: said once
    problems: list[CaptureError] = []
    cameras: list[_MetaCamera] = []
    for name in META_FILES:
        if name == META_FILES[1] and not (folder / name).exists():
            continue  # a capture may come without its own hold-out
        try:
            cameras += _read_meta(folder / name, problems)
        except CaptureError as error:
            problems.append(error)
    cameras.sort(key=lambda camera: camera.camera_id)
    if cameras or not problems:
        problems += check_names([str(camera.camera_id) for camera in cameras], folder / META_FILES[0])

    entries, warnings = _read_frames(folder, cameras, problems, follow_links=follow_links)
    raise_problems(problems, folder)
    return Layout(
        is_growing=is_growing(),
        format=FORMAT,
        cameras=tuple(entries),
        n_frames=entries[0].source.n_frames,
        fps=FPS,
        default_holdout=tuple(str(camera.camera_id) for camera in cameras if camera.is_test),
        warnings=tuple(warnings),
        points=points_that_came(folder, (POINTS,), follow_links=follow_links),
    )


def _read_meta(path: Path, problems: list[CaptureError]) -> list[_MetaCamera]:
    """The cameras of one meta file. Adds what is wrong with single cameras; raises when the file is unusable."""
    meta = read_json_object(path)
    hint = "Export the capture again."
    missing = [key for key in KEYS if key not in meta]
    if missing:
        raise CaptureError(f"The file lacks {', '.join(missing)}.", hint=hint, path=path)
    image_size = _image_size(meta, path)
    n_frames, n_cameras = _table_shape(meta["fn"])
    if n_frames == 0 or n_cameras == 0:
        raise CaptureError("fn must list at least one frame with at least one camera.", hint=hint, path=path)
    Ks = parse_matrix(meta["k"], (n_frames, n_cameras, 3, 3))
    poses = parse_matrix(meta["w2c"], (n_frames, n_cameras, 4, 4))
    camera_ids = parse_matrix(meta["cam_id"], (n_frames, n_cameras))
    if Ks is None or poses is None or camera_ids is None:
        key, shape = ("k", "3x3") if Ks is None else ("w2c", "4x4") if poses is None else ("cam_id", "number")
        found = f"{key} must hold one {shape} for each of {n_frames} frames and {n_cameras} cameras, as fn does."
        raise CaptureError(found, hint=hint, path=path)
    if (
        not (np.isfinite(camera_ids) & (camera_ids == np.round(camera_ids))).all()
        or (camera_ids != camera_ids[0]).any()
    ):
        found = "cam_id must list the same whole numbers in the same order in each frame."
        raise CaptureError(found, hint=hint, path=path)
    if camera_ids.min() < 0 or camera_ids.max() > MAX_CAMERA_ID:
        found = f"cam_id goes from {camera_ids.min():.0f} to {camera_ids.max():.3g}, expected 0 to {MAX_CAMERA_ID:,}."
        raise CaptureError(found, hint="Number the cameras from 0.", path=path)

    cameras = []
    for i in range(n_cameras):
        camera = _MetaCamera(
            camera_id=int(camera_ids[0, i]),
            K=Ks[0, i],
            world_to_camera=poses[0, i],
            image_size=image_size,
            files=tuple(str(row[i]) for row in meta["fn"]),
            meta_path=path,
            is_test=path.name == META_FILES[1],
        )
        found = check_K(str(camera.camera_id), camera.K, image_size, path)
        found += check_pose(str(camera.camera_id), camera.world_to_camera, path)
        problems += found or _check_motionless(str(camera.camera_id), Ks[:, i], poses[:, i], path)
        cameras.append(camera)
    return cameras


def _image_size(meta: dict[str, Any], path: Path) -> tuple[int, int]:
    size = parse_size(meta["w"], meta["h"])
    if size is None:
        raise size_problem("w and h are", meta["w"], meta["h"], path)
    return size


def _table_shape(table: Any) -> tuple[int, int]:
    """Frames and cameras of a table of file names; zeros when it is none."""
    if not isinstance(table, list) or not table or not all(isinstance(row, list) for row in table):
        return 0, 0
    n_cameras = len(table[0])
    if any(len(row) != n_cameras or not all(isinstance(name, str) for name in row) for row in table):
        return 0, 0
    return len(table), n_cameras


def _check_motionless(name: str, Ks: np.ndarray, poses: np.ndarray, path: Path) -> list[CaptureError]:
    is_number = np.isfinite(Ks).all((1, 2)) & np.isfinite(poses).all((1, 2))  # [T]
    if not is_number.all():
        return [
            CaptureError(
                f'Camera "{name}" has NaN or infinity in its calibration of frame {int(np.argmin(is_number))}.',
                hint="Export the calibration again.",
                path=path,
            )
        ]
    is_same = (np.abs(Ks - Ks[0]).max((1, 2)) < 1e-6) & (np.abs(poses - poses[0]).max((1, 2)) < 1e-6)  # [T]
    if is_same.all():
        return []
    return [
        CaptureError(
            f'Camera "{name}" moves from frame {int(np.argmin(is_same))} on.',
            hint="Only cameras that stand still are supported; take this one out.",
            path=path,
        )
    ]


def _read_frames(
    folder: Path, cameras: list[_MetaCamera], problems: list[CaptureError], *, follow_links: bool
) -> tuple[list[CameraEntry], list[str]]:
    """Match the meta files against what lies in ims/. Adds problems; returns entries and warnings."""
    present = _present_files(folder, cameras, problems, follow_links=follow_links)
    if is_growing():
        return _growing_frames(folder, cameras, present, problems), []
    n_listed = max((len(camera.files) for camera in cameras), default=0)
    found = [[name in present for name in camera.files] for camera in cameras]
    n_common = min((_leading(row) for row in found), default=0)
    is_cut_alike = n_common > 0 and all(sum(row) == n_common for row in found)
    if is_cut_alike:  # the meta files may describe more frames than were unpacked, if it is the same for all
        cameras_files = [camera.files[:n_common] for camera in cameras]
    else:
        cameras_files = [camera.files for camera in cameras]
        problems += _missing_frames(folder, cameras, found)

    entries, turned = [], []
    headers: dict[str, dict[Path, ImageHeader]] = {}
    for camera, files in zip(cameras, cameras_files, strict=True):
        name = str(camera.camera_id)
        paths = [folder / "ims" / file for file in files]
        there = [path for path, file in zip(paths, files, strict=True) if file in present]
        read = _read_headers(camera, spread(there, MAX_HEADERS // max(len(cameras), 1)), problems)
        headers[name] = read
        turned += [path for path, header in read.items() if header.orientation != 1][:1]
        source = ImageFrames(paths[0].parent, paths)
        entries.append(CameraEntry(name, camera.K, camera.world_to_camera, camera.image_size, source))
    if not problems:
        problems += check_duplicates(
            {
                name: CameraFiles(list(read), [header.n_bytes for header in read.values()])
                for name, read in headers.items()
            }
        )
    warnings = []
    if is_cut_alike and n_common < n_listed:
        warnings.append(f"The calibration lists {n_listed} frames, the first {n_common} are there and are used.")
    if turned:
        warnings.append(
            f"Images of {len(turned)} cameras have an EXIF entry that turns them for display, such as "
            f"{turned[0].relative_to(folder)}. They are used as stored; if they were calibrated rotated, save them "
            "rotated, without that entry."
        )
    return entries, warnings


def _growing_frames(
    folder: Path, cameras: list[_MetaCamera], present: set[str], problems: list[CaptureError]
) -> list[CameraEntry]:
    """Entries of a capture that is still being recorded: the meta files need not list its frames yet."""
    described = []
    for camera in cameras:
        directory, suffix = camera.files[0].rpartition("/")[0], Path(camera.files[0]).suffix
        own = [name for name in present if name.rpartition("/")[0] == directory and name.endswith(suffix)]
        files = [folder / "ims" / name for name in sorted(own, key=natural_key)]
        described.append(
            DescribedCamera(str(camera.camera_id), camera.K, camera.world_to_camera, files, camera.meta_path)
        )
    described, found = numbered(described, folder)
    problems += found
    entries = []
    for camera, one in zip(cameras, described, strict=True):
        if isinstance(one.files, NumberedFiles):
            _read_headers(camera, [one.files.seen], problems)
            source = ImageFrames(one.files.seen.parent, one.files)
            entries.append(CameraEntry(one.name, one.K, one.world_to_camera, camera.image_size, source))
    return as_long_as_the_longest(entries)


def _present_files(
    folder: Path, cameras: list[_MetaCamera], problems: list[CaptureError], *, follow_links: bool
) -> set[str]:
    """Names below ims/ that exist, by one listing of each folder. Adds a problem for each name that leads outside."""
    named_in = {name.rpartition("/")[0]: camera.meta_path for camera in cameras for name in camera.files}
    present: set[str] = set()
    for directory, meta_path in named_in.items():
        below = f"ims/{directory}" if directory else "ims"
        try:
            full = place_in(folder, below, follow_links=follow_links, named_in=meta_path)
            if not full.is_dir():
                continue
            with os.scandir(full) as listed:
                for entry in listed:
                    if entry.is_symlink():
                        place_in(folder, f"{below}/{entry.name}", follow_links=follow_links, named_in=meta_path)
                    present.add(f"{directory}/{entry.name}" if directory else entry.name)
        except CaptureError as error:
            problems.append(error)
    return present


def _leading(row: list[bool]) -> int:
    """How many frames are there before the first missing one."""
    return row.index(False) if False in row else len(row)


def _missing_frames(folder: Path, cameras: list[_MetaCamera], found: list[list[bool]]) -> list[CaptureError]:
    counts = {str(camera.camera_id): sum(row) for camera, row in zip(cameras, found, strict=True)}
    paths = {str(camera.camera_id): (folder / "ims" / camera.files[0]).parent for camera in cameras}
    problems = check_equal_counts(counts, paths)
    for camera, row in zip(cameras, found, strict=True):
        missing = [name for name, is_there in zip(camera.files, row, strict=True) if not is_there]
        if missing and len(missing) < len(row):
            problems.append(
                CaptureError(
                    f'Camera "{camera.camera_id}" lacks {len(missing)} of {len(row)} listed frames: '
                    f"{shortened(missing)}.",
                    hint="Put these images back or take the frames out of the meta file.",
                    path=folder / "ims" / missing[0],
                )
            )
    return problems


def spread(paths: list[Path], n_most: int) -> list[Path]:
    """Evenly chosen from a list, the first and the last included; all of them where they are not more."""
    if len(paths) <= max(n_most, 2):
        return paths
    return [paths[i * (len(paths) - 1) // (max(n_most, 2) - 1)] for i in range(max(n_most, 2))]


def _read_headers(camera: _MetaCamera, paths: list[Path], problems: list[CaptureError]) -> dict[Path, ImageHeader]:
    """Headers of images of a camera. Adds what is wrong with one, and one problem per size not calibrated for."""
    headers: dict[Path, ImageHeader] = {}
    for path in paths:
        try:
            headers[path] = read_image_header(path)
        except CaptureError as error:
            text = f'Camera "{camera.camera_id}": {error.message}'
            problems.append(CaptureError(text, hint=error.hint, path=error.path))
    first_of_size: dict[tuple[int, int], Path] = {}
    for path, header in headers.items():
        first_of_size.setdefault(header.size, path)
    for path in first_of_size.values():
        problems += check_image_header(str(camera.camera_id), headers[path], camera.image_size, path)
    return headers
