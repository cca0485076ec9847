"""The sample capture written in every layout that can say it: the same cameras and the same pictures, bit by bit.

Trainings are deterministic, so that equal captures train to equal results, whatever layout they came in.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from engine.assets import asset_path
from engine.camera.lens import Lens
from engine.capture.capture import Capture, open_capture
from tests.engine.capture.layouts import (
    written_capture_json,
    written_colmap,
    written_colmap_frames,
    written_easyvolcap,
    written_panoptic,
    written_panoptic_studio,
    written_sample,
    written_technicolor,
    written_toml,
    written_transforms,
)
from tests.engine.capture.layouts.all_layouts import ALL
from tests.engine.capture.layouts.scene import Scene

CAMERAS = (0, 5, 10, 15)
"""Of the sample."""
NUMBERED = ("0", "1", "2", "3")
LAYOUTS = {
    "capture_json": (written_capture_json.write, None),
    "sample": (written_sample.write, None),
    "panoptic": (written_panoptic.write, NUMBERED),
    "panoptic_studio": (written_panoptic_studio.write, ("00_00", "00_01", "00_02", "00_03")),
    "easyvolcap": (written_easyvolcap.write, None),
    "easyvolcap videos": (partial(written_easyvolcap.write, has_videos=True, has_vectors=False), None),
    "anipose": (written_toml.write, None),
    "caliscope": (partial(written_toml.write, kind="caliscope"), ("cam_0", "cam_1", "cam_2", "cam_3")),
    "technicolor": (written_technicolor.write, ("00", "01", "02", "03")),
    "transforms": (written_transforms.write, None),
    "transforms videos": (partial(written_transforms.write, kind="videos"), None),
    "colmap binary": (partial(written_colmap.write, lens="pinhole"), None),
    "colmap text": (partial(written_colmap.write, lens="pinhole", is_binary=False, frames="folders"), None),
    "colmap_frames": (partial(written_colmap_frames.write, lens="pinhole"), None),
}
"""All but three: n3dv knows one focal length for all, immersive knows fisheyes only, multipleview has JPEGs."""


@dataclass(frozen=True, eq=False)
class CopiedScene(Scene):
    """Some cameras of the sample: its videos as they are, or its pictures without loss."""

    capture: Capture | None = None
    png_folder: Path = Path()

    def picture(self, camera_index: int, frame_index: int) -> np.ndarray:
        assert self.capture is not None
        return self.capture.frame(CAMERAS[camera_index], frame_index)

    def write_video(self, path: Path, camera_index: int) -> None:
        assert self.capture is not None
        path.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(self.capture.layout.cameras[CAMERAS[camera_index]].source.path, path)

    def write_images(self, folder: Path, camera_index: int, name: Callable[[int], str] = "{:06d}.png".format) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        for frame_index in range(self.n_frames):
            assert name(frame_index).endswith(".png")
            shutil.copyfile(self.png_folder / f"{camera_index}-{frame_index}.png", folder / name(frame_index))


@pytest.fixture(scope="module")
def sample(tmp_path_factory: pytest.TempPathFactory) -> CopiedScene:
    """The scene of the sample."""
    png_folder = tmp_path_factory.mktemp("png")
    capture = open_capture(asset_path("sample"))
    rows = list(CAMERAS)
    rig = capture.rig
    width, height = (int(side) for side in rig.image_sizes[0])
    names = tuple(rig.names[row] for row in rows)
    for camera_index, row in enumerate(rows):
        for frame_index, picture in enumerate(capture.frames_of(row, range(capture.n_frames))):
            path = png_folder / f"{camera_index}-{frame_index}.png"
            Image.fromarray(picture).save(path, compress_level=1)
    return CopiedScene(
        names,
        rig.Ks[rows].copy(),
        (Lens(),) * len(rows),
        rig.world_to_camera[rows].copy(),
        (width, height),
        capture.n_frames,
        capture.fps,
        capture,
        png_folder,
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    "layout", [pytest.param(name, marks=[pytest.mark.slow] * (name == "colmap_frames")) for name in LAYOUTS]
)
def test_the_sample_is_the_same_in_every_layout(tmp_path: Path, sample: CopiedScene, layout: str) -> None:
    write, names = LAYOUTS[layout]
    write(tmp_path, sample if names is None else replace(sample, names=names))
    capture = open_capture(tmp_path)
    assert capture.n_frames == sample.n_frames
    assert np.abs(capture.rig.Ks - sample.Ks).max() < 1e-8
    assert np.abs(capture.rig.world_to_camera - sample.world_to_camera).max() < 1e-9
    for row in range(len(CAMERAS)):
        assert capture.valid(row) is None
        for frame_index in (0, 13, sample.n_frames - 1):
            assert np.array_equal(capture.frame(row, frame_index), sample.picture(row, frame_index))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("layout", "like"),
    [
        ("easyvolcap-videos", "capture_json-opencv5"),
        ("anipose-opencv5", "capture_json-opencv5"),
        ("anipose-fisheye", "capture_json-fisheye"),
        ("transforms-videos", "capture_json-fisheye"),
        ("colmap-fisheye-binary", "capture_json-fisheye"),
    ],
)
def test_undistorted_pictures_are_the_same_in_every_layout(tmp_path: Path, layout: str, like: str) -> None:
    ALL[layout](tmp_path / "a")
    ALL[like](tmp_path / "b")
    one, other = open_capture(tmp_path / "a"), open_capture(tmp_path / "b")
    assert np.abs(one.rig.Ks - other.rig.Ks).max() < 1e-6
    for row in range(len(one.rig)):
        valid, expected = one.valid(row), other.valid(row)
        assert (valid is None) == (expected is None)
        assert valid is None or expected is None or np.array_equal(valid, expected)
        for frame_index in (0, one.n_frames - 1):
            difference = one.frame(row, frame_index).astype(int) - other.frame(row, frame_index)
            assert np.abs(difference).max() <= 1  # numbers that are written with ten digits
            assert (difference != 0).mean() < 0.001


@pytest.mark.slow
def test_pictures_without_loss_are_what_image_layouts_get(tmp_path: Path, sample: CopiedScene) -> None:
    """The check itself: a lossy copy would not be the same."""
    picture = sample.picture(0, 0)
    Image.fromarray(picture).save(tmp_path / "a.jpg", quality=95)
    assert not np.array_equal(np.asarray(Image.open(tmp_path / "a.jpg")), picture)
