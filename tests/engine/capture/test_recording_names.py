"""Videos that are not called as their cameras: Pose2Sim's folders, serial numbers, trials, order."""

from __future__ import annotations

from pathlib import Path

import pytest

from engine.capture.capture import open_capture
from engine.capture.files.recording_names import by_order, by_pattern, by_serial, folder_names
from engine.errors import CaptureError
from tests.engine.capture.layouts import written_qualisys, written_toml
from tests.engine.capture.layouts.scene import Scene, check_reads_as, make_scene

NAMES = ("cam1", "cam2", "cam10", "cam11")


def written(folder: Path, scene: Scene, videos: dict[str, str], place: str = "videos") -> None:
    """The scene as a TOML file, its videos under other names."""
    written_toml.write(folder, scene, has_times=False)
    (folder / place).mkdir(exist_ok=True)
    for name, video in videos.items():
        (folder / f"{name}.mp4").rename(folder / place / f"{video}.mp4")


def test_names_of_folders_and_of_serial_numbers() -> None:
    assert folder_names("int_cam01_img") == ["cam01"]
    assert folder_names("ext_cam2") == ["cam2"]
    assert folder_names("interior") == folder_names("cam1") == []
    videos = ["videos/Trial 12_Miqus_1_26578.avi", "Trial 12_Miqus_2_26579.avi"]
    assert by_serial(["26578", "26579", "12", "99999"], videos) == {"26578": videos[0], "26579": videos[1]}
    assert by_serial(["26578"], [*videos, "Trial 13_Miqus_1_26578.avi"]) == {}  # which of the two?


@pytest.mark.parametrize(
    ("names", "videos", "expected"),
    [
        (("cam1", "cam2"), ("trial01_cam2.mp4", "trial01_cam1.mp4"), (1, 0)),
        (("cam1", "cam2"), ("trial01_cam_002.mp4", "trial01_cam_001.mp4", "other.mp4"), (1, 0)),
        (("A", "B"), ("2019-vid01-camA.MOV", "2019-vid01-camB.MOV"), (0, 1)),
        (("cam1", "cam10", "cam11"), ("t1cam10.mp4", "t1cam11.mp4", "t1cam1.mp4"), (2, 0, 1)),
        (("a", "b"), ("x.mp4", "y.mp4"), ()),
        (("a",), ("ta.mp4",), ()),
        (("a", "A"), ("ta.mp4", "tA.mp4"), ()),
    ],
)
def test_what_names_of_videos_share_is_the_trial(
    names: tuple[str, ...], videos: tuple[str, ...], expected: tuple[int, ...]
) -> None:
    found = by_pattern(names, videos)
    assert found == {name: videos[row] for name, row in zip(names, expected, strict=False)}
    assert len(found) == len(expected)


def test_two_trials_are_not_chosen_from() -> None:
    with pytest.raises(CaptureError, match=r"2 recordings match the cameras: that of 'cam1' may be 't1_cam1.mp4'"):
        by_pattern(("cam1", "cam2"), ("t1_cam1.mp4", "t1_cam2.mp4", "t2_cam1.mp4", "t2_cam2.mp4"))


def test_order_is_that_in_which_people_count() -> None:
    assert by_order(("b10", "b2"), ("x3.mp4", "x20.mp4")) == {"b2": "x3.mp4", "b10": "x20.mp4"}
    assert by_order(("b10", "b2"), ("x3.mp4",)) == {}


def test_a_project_of_pose2sim_opens(tmp_path: Path) -> None:
    """Its board calibration calls cameras after their folders."""
    scene = make_scene(lens="opencv4").named([f"int_{name}_img" for name in NAMES])
    written(tmp_path, scene, dict(zip(scene.names, NAMES, strict=True)))
    (tmp_path / "calibration").mkdir()
    (tmp_path / "Calib_scene.toml").rename(tmp_path / "calibration" / "Calib_board.toml")
    check_reads_as(tmp_path, scene)


def test_videos_of_a_trial_open(tmp_path: Path) -> None:
    scene = make_scene(lens="opencv5")
    written(tmp_path, scene, {name: f"trial01_{name}" for name in NAMES})
    capture = check_reads_as(tmp_path, scene)
    assert "Videos are matched by similar names: cam1 is videos/trial01_cam1.mp4" in capture.warnings[0]


def test_videos_are_taken_in_order_and_that_is_said(tmp_path: Path) -> None:
    scene = make_scene(lens="opencv5").named(("front", "left", "rear", "right"))
    written(tmp_path, scene, dict(zip(scene.names, ("GX1", "GX2", "GX3", "GX10"), strict=True)))
    capture = check_reads_as(tmp_path, scene)
    assert "in name order, as Pose2Sim does: front is videos/GX1.mp4" in capture.warnings[0]


@pytest.mark.parametrize("videos", [("cam1", "GX2", "GX3", "GX10"), ("GX1", "GX2", "GX3")])
def test_neither_order_nor_trial_where_names_or_numbers_say_otherwise(tmp_path: Path, videos: tuple[str, ...]) -> None:
    scene = make_scene(lens="opencv5")
    written(tmp_path, scene, dict(zip(NAMES, videos, strict=False)))
    (tmp_path / "cam11.mp4").unlink(missing_ok=True)
    with pytest.raises(CaptureError, match="No video or folder of images is called 'cam2'"):
        open_capture(tmp_path)


def test_cameras_that_see_markers_only_are_left_out(tmp_path: Path) -> None:
    scene = make_scene(lens="opencv5", names=written_qualisys.SERIALS)
    written_qualisys.write(tmp_path, scene)
    path = tmp_path / "calibration" / "Calib.qca.txt"
    path.write_text(path.read_text().replace("</cameras>", written_qualisys.marker_camera("30001") + "</cameras>"))
    capture = check_reads_as(tmp_path, scene)
    assert "Cameras of the calibration that have no video are left out: '30001'." in capture.warnings


def test_a_toml_next_to_a_calibration_of_qualisys_is_said(tmp_path: Path) -> None:
    scene = make_scene(lens="opencv5", names=written_qualisys.SERIALS)
    written_qualisys.write(tmp_path, scene)
    written_toml.write(tmp_path, scene, has_times=False)
    capture = open_capture(tmp_path)
    assert capture.format == "toml"
    assert any(text.startswith("Calib.qca.txt is ignored in favour of Calib_scene.toml.") for text in capture.warnings)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("<calibration", "<!DOCTYPE a><calibration", "The file is not XML (it has a DOCTYPE"),
        ('focalLengthU="', 'focalLengthU="x', "Its focalLengthU is 'x"),
        ('right="47"', 'right="46.5"', "Its fov_video has sides of 47.5"),
        ("<transform", "<nothing", "It has no transform."),
        ('r11="', 'r11="1', "rotation"),
        ("<camera ", '<camera active="0" was', "No calibrated camera is in it."),
    ],
)
def test_what_is_wrong_with_a_calibration_of_qualisys_is_said(tmp_path: Path, old: str, new: str, said: str) -> None:
    scene = make_scene(lens="opencv5", names=written_qualisys.SERIALS)
    written_qualisys.write(tmp_path, scene)
    path = tmp_path / "calibration" / "Calib.qca.txt"
    if old == "<camera ":
        path.write_text(path.read_text().replace('active="1"', 'active="0"'))
    else:
        path.write_text(path.read_text().replace(old, new))
    with pytest.raises(CaptureError) as caught:
        open_capture(tmp_path)
    assert said in str(caught.value)
    assert "Calib.qca.txt" in str(caught.value)
