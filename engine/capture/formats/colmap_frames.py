"""A COLMAP folder per frame: frame000000/images/cam00.jpg, or colmap_0/input/cam00.png; the cameras stand still.

3DGStream and ClipGStream name folders frameNNNNNN, with the images in them or in images/; SpacetimeGaussians names
them colmap_T without leading zeros. Poses are those of the first frame, or of a model for all of them.
"""

from __future__ import annotations

import os
import re
from itertools import pairwise
from pathlib import Path

from engine.capture.cameras.camera_files import match_names
from engine.capture.colmap.model_cameras import ModelRig, find_model, read_rig
from engine.capture.files.frame_files import IMAGE_SUFFIXES, Files, folders_in, images_in, listed
from engine.capture.formats.colmap import layout_of
from engine.capture.layout.format_checks import shortened
from engine.capture.layout.format_result import MATCH, Layout, Probe
from engine.errors import CaptureError
from engine.text import shown

FORMAT = "colmap frames"
LAYOUT = "a COLMAP folder per frame (frame000000 or colmap_0), the cameras of the first one for all"
"""The layout in words."""
INNER_FOLDERS = ("images", "input", "")
"""Where in the folder of a frame its images lie: those in `images` are the undistorted ones, if there are both."""
MODEL_FOLDERS = ("sparse/0", "sparse")
POINTS = ("plys/0.ply",)
"""The first cloud of another trainer, which is better than the points of one frame."""
_FRAME = re.compile(r"(frame|colmap)_?(\d{1,9})")
_FEW = 10


def probe(folder: Path) -> Probe:
    """Whether the folder looks like this layout."""
    try:
        frames = _frame_folders(folder)
    except OSError:
        frames = []
    if not frames:
        return Probe(False, lacks="no folders frame000000 or colmap_0")
    if _model_folder(folder, frames) is not None:
        return MATCH
    hint = f"Put the model of the first frame into {frames[0]}/sparse/0, or that of all frames into sparse/0."
    return Probe(False, f"{len(frames)} folders of frames such as {frames[0]}", "no COLMAP model (sparse/0)", hint)


def read(folder: Path, *, follow_links: bool = False) -> Layout:
    """Read cameras and the headers of their frames; no pixels.

    Args:
        follow_links: Whether files may lie outside of the folder.
    Raises:
        CaptureError: Listing every problem found.
    """
    frames = _frame_folders(folder)
    model_folder = _model_folder(folder, frames)
    assert model_folder is not None  # the probe saw it
    rig = read_rig(model_folder)
    files = _files(folder, frames, rig, follow_links=follow_links)
    numbers = [_number(name) for name in frames]
    gaps = [b for a, b in pairwise(numbers) if b - a != numbers[1] - numbers[0]]
    if gaps:
        rig.warnings.append(
            f"Folders of frames are missing before {shortened([str(gap) for gap in gaps])}; the others are taken one "
            "after the other."
        )
    if (folder / "plys").is_dir():
        rig.warnings.append("plys/ holds another program's point clouds; only plys/0.ply is used.")
    return layout_of(folder, FORMAT, rig, files, model_folder, follow_links=follow_links, other_points=POINTS)


def _frame_folders(folder: Path) -> list[str]:
    """Names of the folders of frames in order of their numbers; those of one kind, the more frequent one."""
    names = [name for name in folders_in(folder) if _FRAME.fullmatch(name)]
    kinds = [[name for name in names if name.startswith(kind)] for kind in ("frame", "colmap")]
    return sorted(max(kinds, key=len), key=_number)


def _number(name: str) -> int:
    match = _FRAME.fullmatch(name)
    assert match is not None
    return int(match[2])


def _model_folder(folder: Path, frames: list[str]) -> Path | None:
    """The model of the first frame that has one among the first few, else that of the whole capture."""
    for name in frames[:1]:
        if (found := find_model(folder / name, MODEL_FOLDERS)) is not None:
            return found
    if (found := find_model(folder, MODEL_FOLDERS)) is not None:
        return found
    return next((found for name in frames[1:_FEW] if (found := find_model(folder / name, MODEL_FOLDERS))), None)


def _files(folder: Path, frames: list[str], rig: ModelRig, *, follow_links: bool) -> dict[str, Files]:
    """One image per camera and frame; adds what is missing to the problems of the rig."""
    names = [camera.name for camera in rig.cameras]
    files: dict[str, list[Path]] = {name: [] for name in names}
    missing: dict[str, list[str]] = {}
    left_over: set[str] = set()
    images: list[str] = []
    by_stem: dict[str, str] = {}
    matched: dict[str, str] = {}
    for frame in frames:
        try:
            inner = next((place for place in INNER_FOLDERS if (folder / frame / place).is_dir()), "")
            directory = f"{frame}/{inner}" if inner else frame
            found = listed(folder / directory, IMAGE_SUFFIXES)
            if found != images:  # most frames have images of the same names
                images, by_stem = found, {os.path.splitext(image)[0]: image for image in reversed(found)}
                matched = match_names(names, list(by_stem))
            used = [by_stem[matched[name]] for name in names if name in matched]
            if used:
                paths = images_in(folder, directory, used, follow_links=follow_links, named_in=folder / frame)
                for name, path in zip([name for name in names if name in matched], paths, strict=True):
                    files[name].append(path)
        except (CaptureError, OSError) as error:
            text = error.message if isinstance(error, CaptureError) else f"It cannot be read ({error.strerror})."
            hint = error.hint if isinstance(error, CaptureError) else "Check that you may read it."
            rig.problems.append(CaptureError(f"Frame {frame}: {text}", hint=hint, path=folder / frame))
            continue
        left_over |= set(by_stem) - set(matched.values())
        for name in names:
            if name not in matched:
                missing.setdefault(name, []).append(frame)
    for name, frames_without in missing.items():
        n = len(frames_without)
        where = "all frames" if n == len(frames) else f"{n} of {len(frames)} frames: {shortened(frames_without)}"
        text = f"Camera {shown(name)} has no image in {where}."
        hint = "Images are named as in the model, the same in each frame. Add them or take the camera out of it."
        rig.problems.append(CaptureError(text, hint=hint, path=folder / frames_without[0]))
    if left_over:
        listed_names = shortened([shown(name) for name in sorted(left_over)])
        rig.warnings.append(f"Images without a pose in the model are ignored: {listed_names}.")
    return {name: paths for name, paths in files.items() if name not in missing}
