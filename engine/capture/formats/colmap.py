"""A rig calibrated with COLMAP: a sparse model, and next to it a video, a folder of images or one image per camera.

The model lies in sparse/0, sparse or colmap/sparse/0, as binary files or text. Cameras and frames belong together by
name: "cam00.jpg", "cam00/000000.jpg" and "images/cam00.png" are all of camera cam00.
"""

from __future__ import annotations

from pathlib import Path

from engine.capture.cameras.camera_files import find_camera_frames, missing_frames
from engine.capture.cameras.described_camera import DescribedCamera
from engine.capture.colmap.model_cameras import ModelRig, find_model, read_rig
from engine.capture.files.frame_files import Files
from engine.capture.layout.assembling import assemble
from engine.capture.layout.format_checks import shortened
from engine.capture.layout.format_result import MATCH, Layout, Probe
from engine.capture.points import points_that_came
from engine.text import shown

FORMAT = "colmap"
LAYOUT = "a COLMAP model in sparse/0 with a video, a folder of images or an image per camera"
"""The layout in words."""
POINTS = ("points3D.bin", "points3D.txt", "points3D.ply")
"""Point clouds next to a model, best first."""


def probe(folder: Path) -> Probe:
    """Whether the folder looks like this layout."""
    if find_model(folder) is not None:
        return MATCH
    for place in ("sparse/0", "sparse", "colmap"):
        if (folder / place).is_dir():
            lacks = "no cameras and images of a model in it (.bin or .txt)"
            hint = "Put the files cameras.bin and images.bin that COLMAP wrote into sparse/0."
            return Probe(False, f"{place}/", lacks, hint)
    if any((folder / name).is_file() for name in ("database.db", "cameras.bin", "cameras.txt")):
        hint = "Run COLMAP's mapper and put its output into sparse/0."
        return Probe(False, "a COLMAP project", "no images.bin or images.txt with poses", hint)
    return Probe(False, lacks="no sparse/0")


def read(folder: Path, *, follow_links: bool = False) -> Layout:
    """Read cameras and the headers of their frames; no pixels.

    Args:
        follow_links: Whether files may lie outside of the folder.
    Raises:
        CaptureError: Listing every problem found.
    """
    model_folder = find_model(folder)
    assert model_folder is not None  # the probe saw it
    rig = read_rig(model_folder)
    names = [camera.name for camera in rig.cameras]
    found = find_camera_frames(folder, names, follow_links=follow_links, named_in=rig.said_in)
    rig.problems.extend(missing_frames(names, found, rig.said_in))
    if found.left_over and found.files:
        listed = shortened([shown(name) for name in found.left_over])
        rig.warnings.append(f"Frames without a pose in the model are ignored: {listed}.")
    return layout_of(folder, FORMAT, rig, found.files, model_folder, follow_links=follow_links)


def layout_of(
    folder: Path,
    format_name: str,
    rig: ModelRig,
    files: dict[str, Files],
    model_folder: Path,
    *,
    follow_links: bool,
    other_points: tuple[str, ...] = (),
) -> Layout:
    """A layout from the cameras of a model and their frames; those without frames are left out.

    Args:
        other_points: Names of point clouds relative to the capture's folder, better than those next to the model.
    Raises:
        CaptureError: Listing every problem found.
    """
    cameras = [
        DescribedCamera(
            name=camera.name,
            K=camera.K,
            world_to_camera=camera.world_to_camera,
            files=files[camera.name],
            said_in=rig.said_in,
            calibrated_size=camera.size,
            lens=camera.lens,
        )
        for camera in rig.cameras
        if camera.name in files
    ]
    beside = [str((model_folder / name).relative_to(folder)) for name in POINTS]
    return assemble(
        folder,
        format_name,
        cameras,
        points=points_that_came(folder, [*other_points, *beside], follow_links=follow_links),
        problems=rig.problems,
        warnings=rig.warnings,
        said_in=rig.said_in,
    )
