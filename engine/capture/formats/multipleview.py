"""The "multipleview" layout of 4DGaussians: cam01/frame_00001.jpg and so on, and a COLMAP model in sparse_.

The model was made from the first frame of each camera, copied to image1.jpg, image2.jpg and so on: the number in the
name is that of the camera.
"""

from __future__ import annotations

import re
from pathlib import Path

from engine.capture.cameras.camera_files import match_names
from engine.capture.colmap.model_cameras import find_model, read_rig
from engine.capture.colmap.model_files import has_model
from engine.capture.files.frame_files import Files, folders_in, frames_in_folder
from engine.capture.formats.colmap import layout_of
from engine.capture.layout.format_checks import check_equal_counts, shortened
from engine.capture.layout.format_result import MATCH, Layout, Probe
from engine.errors import CaptureError
from engine.text import shown

FORMAT = "multipleview"
LAYOUT = "4DGaussians multipleview: cam01/frame_00001.jpg and a COLMAP model in sparse_"
"""The layout in words."""
MODEL = "sparse_"
POINTS = "points3D_multipleview.ply"
POSES = "poses_bounds_multipleview.npy"
_IMAGE = re.compile(r"image0*(\d{1,9})")
_CAMERA = re.compile(r"cam_?0*(\d{1,9})")


def probe(folder: Path) -> Probe:
    """Whether the folder looks like this layout."""
    try:
        cameras = _camera_folders(folder)
    except OSError:
        cameras = []
    if has_model(folder / MODEL) and cameras:
        return MATCH
    seen = next((name for name in (MODEL, POSES, POINTS) if (folder / name).exists()), "")
    if not seen:
        return Probe(False, lacks=f"no {MODEL}")
    if not cameras:
        return Probe(False, seen, "no folders of frames such as cam01", "Put the frames into cam01, cam02 and so on.")
    hint = f"Put cameras.bin and images.bin of COLMAP into {MODEL}; {POSES} is not enough, it does not name cameras."
    return Probe(False, f"{seen} and {len(cameras)} folders of frames", f"no COLMAP model in {MODEL}", hint)


def read(folder: Path, *, follow_links: bool = False) -> Layout:
    """Read cameras and the headers of their frames; no pixels.

    Args:
        follow_links: Whether files may lie outside of the folder.
    Raises:
        CaptureError: Listing every problem found.
    """
    model_folder = find_model(folder, (MODEL,))
    assert model_folder is not None  # the probe saw it
    rig = read_rig(model_folder)
    folders = _camera_folders(folder)
    folder_of = _folder_of([camera.name for camera in rig.cameras], folders)
    files: dict[str, Files] = {}
    for camera in rig.cameras:
        directory = folder_of.get(camera.name)
        try:
            if directory is None:
                hint = "image7.jpg of the model belongs to the folder cam07. Add it or take the image out of the model."
                raise CaptureError("Its folder of frames is missing.", hint=hint, path=rig.said_in)
            files[camera.name] = frames_in_folder(folder, directory, follow_links=follow_links, named_in=rig.said_in)
        except CaptureError as error:
            rig.problems.append(error.said_of(f"Camera {shown(camera.name)}"))
    counts = {name: len(paths) for name, paths in files.items() if isinstance(paths, list)}
    rig.problems.extend(check_equal_counts(counts, {name: folder / folder_of[name] for name in counts}))
    left_over = [name for name in folders if name not in folder_of.values()]
    if left_over:
        rig.warnings.append(f"Folders without a pose in the model are ignored: {shortened(left_over)}.")
    for row, camera in enumerate(rig.cameras):  # the user knows the folders, not what they were copied to
        if camera.name in files:
            name = folder_of[camera.name]
            files[name] = files.pop(camera.name)
            rig.cameras[row] = camera.renamed(name)
    return layout_of(folder, FORMAT, rig, files, model_folder, follow_links=follow_links, other_points=(POINTS,))


def _camera_folders(folder: Path) -> list[str]:
    return [name for name in folders_in(folder) if _CAMERA.fullmatch(name.lower())]


def _folder_of(names: list[str], folders: list[str]) -> dict[str, str]:
    """The folder of each camera of the model: of the same name, or of the number in the name of its image."""
    found = match_names(names, folders)
    by_number = {int(match[1]): name for name in folders if (match := _CAMERA.fullmatch(name.lower()))}
    for name in names:
        match = _IMAGE.fullmatch(name.lower())
        if name not in found and match and int(match[1]) in by_number:
            found[name] = by_number[int(match[1])]
    return found
