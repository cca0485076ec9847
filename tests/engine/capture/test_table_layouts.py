"""One scene in every layout with a table of cameras: cameras, lenses and pictures come out as they went in."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from engine.capture.capture import open_capture
from engine.capture.frames import IndexedFrames
from engine.capture.writers.capture_json import Corrections, write_corrections
from engine.errors import CaptureError
from tests.engine.capture.layouts import written_easyvolcap, written_toml, written_transforms
from tests.engine.capture.layouts.scene import check_reads_as, make_points, make_scene, projected
from tests.engine.capture.layouts.tables import TABLES

FORMATS = {
    "capture_json": "capture.json",
    "sample": "sample",
    "panoptic": "panoptic",
    "easyvolcap": "easyvolcap",
    "anipose": "toml",
    "caliscope": "toml",
    "transforms": "transforms.json",
    "immersive": "immersive",
    "panoptic_studio": "panoptic-studio",
    "qualisys": "qualisys",
    "vicon": "vicon",
    "metashape": "metashape",
    "realitycapture": "realitycapture",
    "technicolor": "technicolor",
}
"""What readers call each layout."""


@pytest.mark.parametrize("layout", TABLES)
def test_a_point_falls_where_it_fell(tmp_path: Path, layout: str) -> None:
    scene = TABLES[layout](tmp_path)
    capture = check_reads_as(tmp_path, scene)
    assert capture.format == FORMATS[layout.split("-")[0]]


@pytest.mark.slow
@pytest.mark.parametrize("layout", ["easyvolcap-opencv5", "anipose-fisheye", "transforms-opencv4"])
def test_undistorted_pictures_show_the_scene_where_a_pinhole_camera_sees_it(tmp_path: Path, layout: str) -> None:
    """A point's colour in the undistorted picture is the one that it has in the stored picture."""
    scene = TABLES[layout](tmp_path)
    capture = open_capture(tmp_path)
    points = make_points()
    for row in range(len(scene.names)):
        stored = scene.project(row, points)
        seen = points @ capture.rig.world_to_camera[row, :3, :3].T + capture.rig.world_to_camera[row, :3, 3]
        pixels = seen @ capture.rig.Ks[row].T
        now = pixels[:, :2] / pixels[:, 2:]
        picture = capture.frame(row, 0)
        rows, columns = np.floor(now[:, 1]).astype(int), np.floor(now[:, 0]).astype(int)
        is_inside = (rows >= 0) & (rows < 32) & (columns >= 0) & (columns < 48)
        assert is_inside.sum() > 5
        red = 40 + 160 * (stored[:, 0] - 0.5) / 47  # of the picture at that place: see Scene.picture
        error = np.abs(picture[rows[is_inside], columns[is_inside], 0] - red[is_inside])
        assert np.median(error) < 4  # a pixel is 3.4 wide


def test_color_matrices_are_applied_and_part_of_the_fingerprint(tmp_path: Path) -> None:
    scene = make_scene(lens="pinhole")
    matrix = np.array([[0.5, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.1, 1.0]])
    written_easyvolcap.write(tmp_path / "plain", scene, color_matrix=np.eye(3))
    written_easyvolcap.write(tmp_path / "turned", scene, color_matrix=matrix)
    plain, turned = open_capture(tmp_path / "plain"), open_capture(tmp_path / "turned")
    assert plain.layout.cameras[0].color_matrix is None
    expected = plain.frame(1, 2).astype(float) @ matrix.T
    assert np.abs(turned.frame(1, 2) - expected).max() <= 1
    assert plain.fingerprint != turned.fingerprint


def test_masks_fit_their_frames_or_are_left_with_a_word(tmp_path: Path) -> None:
    scene = make_scene(lens="pinhole")
    written_easyvolcap.write(tmp_path, scene)
    for row, name in enumerate(scene.names):
        scene.write_images(tmp_path / "masks" / name, row)
    (tmp_path / "masks" / "cam2" / "000001.png").unlink()
    capture = open_capture(tmp_path)
    assert [entry.masks is not None for entry in capture.layout.cameras] == [True, False, True, True]
    assert 'Masks of camera "cam2" are not used: no mask for 1 of 4 frames' in " ".join(capture.warnings)


def test_times_of_frames_set_the_clock(tmp_path: Path) -> None:
    scene = make_scene(lens="pinhole", n_frames=6)
    written_toml.write(tmp_path, scene)
    written_toml.wrong_clock(tmp_path, scene, late_frames=2)
    capture = open_capture(tmp_path)
    assert capture.n_frames == 4
    sources = [entry.source for entry in capture.layout.cameras]
    assert all(isinstance(source, IndexedFrames) for source in sources)
    assert [source.frame_indices.tolist() for source in sources] == [[2, 3, 4, 5]] * 3 + [[0, 1, 2, 3]]  # type: ignore[attr-defined]
    assert any("moments at 30 per second" in warning for warning in capture.warnings)


def test_names_that_differ_in_separators_only_are_matched(tmp_path: Path) -> None:
    scene = make_scene(lens="pinhole")
    written_toml.write(tmp_path, scene, has_times=False)
    for name in scene.names:
        (tmp_path / f"{name}.mp4").rename(tmp_path / f"Cam_{int(name[3:]):03d}.mp4")
    assert check_reads_as(tmp_path, scene).rig.names == scene.names


def test_a_camera_that_moves_is_said(tmp_path: Path) -> None:
    scene = make_scene(lens="pinhole")
    written_transforms.write(tmp_path, scene)
    document = json.loads((tmp_path / "transforms.json").read_text())
    document["frames"] = [frame | {"time": row} for row, frame in enumerate(document["frames"][:: scene.n_frames])]
    (tmp_path / "transforms.json").write_text(json.dumps(document))
    with pytest.raises(CaptureError, match="the camera moves"):
        open_capture(tmp_path)


def test_views_in_radians_and_points_that_came_along(tmp_path: Path) -> None:
    scene = make_scene(lens="pinhole", is_centered=True)
    written_transforms.write(tmp_path, scene, kind="folders")
    path = tmp_path / "transforms.json"
    document = json.loads(path.read_text())
    for frame in document["frames"]:
        angles = [
            2 * np.arctan(side / 2 / frame.pop(key)) for side, key in zip(scene.size, ("fl_x", "fl_y"), strict=True)
        ]
        frame |= {"camera_angle_x": angles[0], "camera_angle_y": angles[1], "file_path": frame["file_path"][:-4]}
        del frame["cx"], frame["cy"]
    del document["w"], document["h"]
    path.write_text(json.dumps(document | {"ply_file_path": "points.ply", "fps": 25}))
    (tmp_path / "points.ply").write_text("ply\n")
    capture = check_reads_as(tmp_path, scene)
    assert capture.layout.points == tmp_path / "points.ply"
    assert capture.fps == 25


@pytest.mark.parametrize(
    ("taken", "seen", "hint"),
    [
        ("extri.yml", "there is intri.yml, but no extri.yml", "Put extri.yml next to it"),
        ("intri.yml", "there is extri.yml, but no intri.yml", "Put intri.yml next to it"),
    ],
)
def test_half_a_layout_says_what_is_missing(tmp_path: Path, taken: str, seen: str, hint: str) -> None:
    TABLES["easyvolcap-pinhole"](tmp_path)
    (tmp_path / taken).unlink()
    with pytest.raises(CaptureError) as caught:
        open_capture(tmp_path)
    assert seen in str(caught.value)
    assert hint in str(caught.value)


def test_other_halves_say_what_is_missing_too(tmp_path: Path) -> None:
    TABLES["panoptic_studio-pinhole"](tmp_path / "a")
    (tmp_path / "a" / "hdVideos").rename(tmp_path / "a" / "elsewhere")
    TABLES["technicolor"](tmp_path / "b")
    for path in (tmp_path / "b").glob("*.png"):
        path.unlink()
    TABLES["transforms-split"](tmp_path / "c")
    (tmp_path / "c" / "transforms_train.json").unlink()
    (tmp_path / "d").mkdir()
    (tmp_path / "d" / "cal.toml").write_text("[cam_0\n")
    (tmp_path / "e").mkdir()
    (tmp_path / "e" / "calibration.toml").write_text('[cam_0]\nname = "a"\nmatrix = [[1]]\n')
    for name, said in (
        ("a", "no hdVideos/"),
        ("b", "no pictures named by frame and camera"),
        ("c", "no transforms_train.json"),
        ("d", "cal.toml"),
        ("e", "no camera in it has matrix, rotation and translation"),
    ):
        with pytest.raises(CaptureError) as caught:
            open_capture(tmp_path / name)
        assert said in str(caught.value), name


def test_lenses_are_what_was_written() -> None:
    """The check itself: a lens that is left out, or a pixel centre that is not moved, is more than 0.01 px."""
    scene = make_scene(lens="opencv4")
    K = scene.Ks[0].copy()
    K[:2, 2] -= 0.5
    points = make_points()
    pose = scene.world_to_camera[0]
    assert np.abs(projected(K, scene.lenses[0], pose, points) - scene.project(0, points)).max() > 0.4
    assert np.abs(projected(scene.Ks[0], type(scene.lenses[0])(), pose, points) - scene.project(0, points)).max() > 0.05


def test_a_clock_survives_corrections(tmp_path: Path) -> None:
    """Frames that a clock chose are the same after capture.json was written, which knows no times."""
    scene = make_scene(lens="pinhole", n_frames=8)
    written_toml.write(tmp_path, scene)
    rows = ["cam_id,frame_time"]
    for t in range(scene.n_frames):
        for camera in range(len(scene.names)):  # the last camera takes twice as many pictures
            rows.append(f"{camera},{100 + t / (15 if camera < 3 else 30):.6f}")
    (tmp_path / "timestamps.csv").write_text("\n".join(rows))
    before = open_capture(tmp_path)
    write_corrections(before.layout, tmp_path, Corrections(holdout=["cam2"]))
    after = open_capture(tmp_path)
    assert after.format == "capture.json"
    assert after.n_frames == before.n_frames == 4
    for row in range(4):
        for frame_index in range(4):
            assert np.array_equal(after.frame(row, frame_index), before.frame(row, frame_index))
    write_corrections(after.layout, tmp_path, Corrections(offset_frames={"cam1": 1}))
    shifted = open_capture(tmp_path)
    assert shifted.n_frames == 3
    assert np.array_equal(shifted.frame(0, 0), before.frame(0, 1))
    assert np.array_equal(shifted.frame(3, 2), before.frame(3, 2))


def test_a_video_whose_camera_is_not_in_the_toml_file_is_named(tmp_path: Path) -> None:
    TABLES["anipose-opencv5"](tmp_path)
    path = tmp_path / "Calib_scene.toml"
    tables = path.read_text().split("\n\n")
    path.write_text("\n\n".join(table for table in tables if 'name = "cam10"' not in table))
    capture = open_capture(tmp_path)
    assert "cam10" not in capture.rig.names
    assert "Videos of which the calibration has no camera are left out: cam10.mp4." in capture.warnings
