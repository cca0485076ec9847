"""Captures written anew: the same cameras and pictures through each layout that is written, and nothing half done."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from engine.camera.lens import Lens
from engine.capture.capture import open_capture
from engine.capture.frames import IndexedFrames
from engine.capture.points import points_of
from engine.capture.writers.conversion import TARGETS, convert
from engine.capture.writers.frame_files import FRAMES, safe_names
from engine.errors import CaptureError, DiskError
from tests.engine.capture.layouts import written_capture_json, written_colmap
from tests.engine.capture.layouts.scene import check_reads_as, make_points, make_scene
from tests.engine.capture.layouts.written_colmap import write_model


@pytest.mark.parametrize("frames", ["link", "copy", "png"])
@pytest.mark.parametrize("source", ["videos", "folders"])
@pytest.mark.parametrize("target", TARGETS)
def test_a_converted_capture_reads_as_its_scene(tmp_path: Path, target: str, source: str, frames: str) -> None:
    scene = make_scene(lens="opencv5")
    written_colmap.write(tmp_path / "old", scene, lens="opencv5", frames=source)
    done = convert(open_capture(tmp_path / "old").layout, tmp_path / "new", target, frames=frames)  # type: ignore[arg-type]
    check_reads_as(tmp_path / "new", scene, follow_links=frames == "link")
    assert any("--follow-links" in line for line in done.lines) == (frames == "link")


def test_references_in_capture_json_open_with_links_followed(tmp_path: Path) -> None:
    scene = make_scene(lens="fisheye")
    written_capture_json.write(tmp_path / "old", scene)
    convert(open_capture(tmp_path / "old").layout, tmp_path / "new", "capture.json")
    assert [path.name for path in (tmp_path / "new").iterdir()] == ["capture.json"]
    check_reads_as(tmp_path / "new", scene, follow_links=True)


@pytest.mark.parametrize("source", ["videos", "folders"])
@pytest.mark.parametrize("target", TARGETS)
def test_without_frames_it_opens_or_says_that_it_does_not(tmp_path: Path, target: str, source: str) -> None:
    scene = make_scene(lens="opencv5")
    written_colmap.write(tmp_path / "old", scene, lens="opencv5", frames=source)
    done = convert(open_capture(tmp_path / "old").layout, tmp_path / "new", target, frames="none")  # type: ignore[arg-type]
    if target == "colmap":
        assert any("does not open as a capture" in line for line in done.lines)
    else:
        assert "Frames are not copied; open the folder with --follow-links." in done.lines
        check_reads_as(tmp_path / "new", scene, follow_links=True)


def test_part_of_a_video_cannot_be_referred_to_by_transforms(tmp_path: Path) -> None:
    scene = make_scene(lens="pinhole", n_frames=5)
    written_colmap.write(tmp_path / "old", scene, lens="pinhole")
    layout = open_capture(tmp_path / "old").layout
    late = tuple(replace(entry, source=IndexedFrames(entry.source, np.arange(1, 5))) for entry in layout.cameras)
    with pytest.raises(CaptureError, match="cannot state which frames of the videos"):
        convert(replace(layout, cameras=late, n_frames=4), tmp_path / "new", "transforms")
    assert not (tmp_path / "new").exists()


def test_frames_of_videos_that_begin_later_are_decoded(tmp_path: Path) -> None:
    scene = make_scene(lens="pinhole", n_frames=5)
    written_colmap.write(tmp_path / "old", scene, lens="pinhole")
    layout = open_capture(tmp_path / "old").layout
    late = tuple(replace(entry, source=IndexedFrames(entry.source, np.arange(1, 5))) for entry in layout.cameras)
    convert(replace(layout, cameras=late, n_frames=4), tmp_path / "new", "colmap", frames="copy")
    before, after = open_capture(tmp_path / "old"), open_capture(tmp_path / "new")
    assert after.n_frames == 4
    assert np.array_equal(after.frame(2, 0), before.frame(2, 1))


def test_chosen_image_files_are_copied_in_order(tmp_path: Path) -> None:
    scene = make_scene(lens="pinhole", n_frames=5)
    written_colmap.write(tmp_path / "old", scene, lens="pinhole", frames="folders")
    layout = open_capture(tmp_path / "old").layout
    odd = tuple(
        replace(entry, source=IndexedFrames(IndexedFrames(entry.source, np.arange(1, 5)), np.array([3, 0])))
        for entry in layout.cameras
    )
    convert(replace(layout, cameras=odd, n_frames=2), tmp_path / "new", "capture.json", frames="copy")
    before, after = open_capture(tmp_path / "old"), open_capture(tmp_path / "new")
    assert np.array_equal(after.frame(1, 0), before.frame(1, 4))
    assert np.array_equal(after.frame(1, 1), before.frame(1, 1))


@pytest.mark.parametrize("target", TARGETS)
def test_points_come_along_in_the_world_of_the_cameras(tmp_path: Path, target: str) -> None:
    scene = make_scene(lens="pinhole")
    written_colmap.write(tmp_path / "old", scene, lens="pinhole")
    write_model(tmp_path / "old/sparse/0", scene, "PINHOLE", points=make_points())
    matrix = np.diag([2.0, 2.0, 2.0, 1.0])
    layout = replace(open_capture(tmp_path / "old").layout, points_to_world=matrix)
    convert(layout, tmp_path / "new", target, frames="copy")  # type: ignore[arg-type]
    cloud = points_of(open_capture(tmp_path / "new").layout)
    assert cloud is not None
    assert np.allclose(cloud.points, 2 * make_points(), atol=1e-6)


def test_world_scale_and_up_move_points_with_the_cameras(tmp_path: Path) -> None:
    from engine.capture.writers.capture_json import Corrections, write_corrections

    scene = make_scene(lens="pinhole")
    written_colmap.write(tmp_path, scene, lens="pinhole")
    write_model(tmp_path / "sparse/0", scene, "PINHOLE", points=make_points())
    before = open_capture(tmp_path)
    write_corrections(before.layout, tmp_path, Corrections(world_scale=2.5, up=(0.0, -1.0, 0.0)))
    after = open_capture(tmp_path)
    cloud = points_of(after.layout)
    assert cloud is not None
    for old, new in zip(before.rig.world_to_camera, after.rig.world_to_camera, strict=True):
        seen = make_points() @ old[:3, :3].T + old[:3, 3]
        assert np.allclose(cloud.points @ new[:3, :3].T + new[:3, 3], 2.5 * seen)


def test_what_a_layout_cannot_say_is_refused_with_every_camera_named(tmp_path: Path) -> None:
    scene = make_scene(lens="opencv5")
    written_capture_json.write(tmp_path / "old", scene)
    layout = open_capture(tmp_path / "old").layout
    prism = Lens("opencv", (0.1, 0, 0, 0, 0, 0, 0, 0, 0.01))
    layout = replace(layout, cameras=tuple(replace(entry, lens=prism) for entry in layout.cameras))
    for target in ("colmap", "transforms"):
        with pytest.raises(CaptureError) as caught:
            convert(layout, tmp_path / "new", target)
        assert len(caught.value.problems) == 4
        assert sorted(path.name for path in tmp_path.iterdir()) == ["old"]


def test_what_is_there_is_never_touched(tmp_path: Path) -> None:
    written_colmap.write(tmp_path / "old", make_scene(lens="pinhole"), lens="pinhole")
    layout = open_capture(tmp_path / "old").layout
    (tmp_path / "file").touch()
    for name in ("old", "file"):
        with pytest.raises(CaptureError, match="already taken"):
            convert(layout, tmp_path / name, "colmap")
    (tmp_path / "empty").mkdir()
    convert(layout, tmp_path / "empty", "colmap")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["empty", "file", "old"]


@pytest.mark.parametrize("frames", FRAMES)
def test_a_damaged_frame_leaves_nothing_behind(tmp_path: Path, frames: str) -> None:
    written_colmap.write(tmp_path / "old", make_scene(lens="pinhole"), lens="pinhole", frames="folders")
    layout = open_capture(tmp_path / "old").layout
    (tmp_path / "old/images/cam10/000001.png").unlink()
    if frames == "none":
        convert(layout, tmp_path / "new", "colmap", frames="none")
        return
    with pytest.raises(CaptureError, match=r"000001\.png"):
        convert(layout, tmp_path / "new", "colmap", frames=frames)  # type: ignore[arg-type]
    assert [path.name for path in tmp_path.iterdir()] == ["old"]


def test_a_place_that_cannot_be_written_is_said(tmp_path: Path) -> None:
    written_colmap.write(tmp_path / "old", make_scene(lens="pinhole"), lens="pinhole")
    (tmp_path / "file").touch()
    with pytest.raises(DiskError, match="could not be written"):
        convert(open_capture(tmp_path / "old").layout, tmp_path / "file/new", "colmap")


def test_names_of_cameras_become_names_of_files() -> None:
    found = safe_names(("a/b", "a_b", "..", "A:B", "cam 1", "左", "100%"))
    assert found == {
        "a/b": "a_b",
        "a_b": "a_b_2",
        "..": "cam",
        "A:B": "A_B_3",
        "cam 1": "cam 1",
        "左": "左",
        "100%": "100_",
    }
