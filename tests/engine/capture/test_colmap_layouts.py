"""Layouts calibrated with COLMAP: one scene through each of them, and what is wrong with them in words."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from engine.camera.lens import Lens
from engine.capture.capture import open_capture
from engine.capture.colmap.model_cameras import read_rig
from engine.errors import CaptureError
from tests.engine.capture.layouts import written_colmap, written_colmap_frames, written_multipleview
from tests.engine.capture.layouts.scene import check_reads_as, make_points, make_scene, projected
from tests.engine.capture.layouts.written_colmap import MODELS, write_frames, write_model

ODD_NAMES = ("Kamera-ä3", "cam 1", "cam.2", "左4")


@pytest.mark.parametrize("is_binary", [True, False])
@pytest.mark.parametrize("lens", ["pinhole", "opencv4", "opencv5", "fisheye"])
def test_a_rig_reads_as_its_scene(tmp_path: Path, lens: str, is_binary: bool) -> None:
    scene = make_scene(lens=lens)
    written_colmap.write(tmp_path, scene, lens=lens, is_binary=is_binary)
    capture = check_reads_as(tmp_path, scene)
    assert capture.format == "colmap"
    assert not capture.warnings


@pytest.mark.parametrize("is_binary", [True, False])
@pytest.mark.parametrize("frames", ["folders", "videos"])
def test_odd_names_stay_as_they_are(tmp_path: Path, frames: str, is_binary: bool) -> None:
    scene = make_scene(lens="opencv4", names=ODD_NAMES)
    written_colmap.write(tmp_path / "a folder.1", scene, lens="opencv4", frames=frames, is_binary=is_binary)
    check_reads_as(tmp_path / "a folder.1", scene)


def test_one_image_per_camera_is_a_capture_of_one_frame(tmp_path: Path) -> None:
    scene = make_scene(lens="pinhole", n_frames=1)
    written_colmap.write(tmp_path, scene, lens="pinhole", frames="images")
    check_reads_as(tmp_path, scene)


@pytest.mark.parametrize(
    "image_name", ["{}.png", "{}/000000.jpg", "images/{}.png", "images/{}/0001.jpg", "rig\\{}\\1.png", "a/b/{}/1.png"]
)
def test_images_of_the_model_name_cameras_in_several_ways(tmp_path: Path, image_name: str) -> None:
    scene = make_scene(lens="pinhole")
    write_model(tmp_path / "sparse", scene, "PINHOLE", image_name=image_name.format)
    write_frames(tmp_path, scene, "folders")
    check_reads_as(tmp_path, scene)


@pytest.mark.parametrize("model", sorted(MODELS))
def test_every_model_projects_as_its_parameters_say(tmp_path: Path, model: str) -> None:
    _, form = MODELS[model]
    kinds = {"FOV": "fov", "THIN_PRISM_FISHEYE": "thin_prism_fisheye"}
    kind = kinds.get(model, "fisheye" if "FISHEYE" in model else "pinhole" if "PINHOLE" in model else "opencv")
    values = (0.05, -0.02, 0.003, -0.002, 0.004, 0.001, 0.002, -0.001)[: int(form.lstrip("fc") or 0)]
    lens = Lens(kind, (0.9,) if model == "FOV" else values)  # type: ignore[arg-type]
    scene = make_scene(lens="pinhole", is_one_focal=form.startswith("fc"))
    object.__setattr__(scene, "lenses", (lens,) * 4)
    for is_binary in (True, False):
        write_model(tmp_path, scene, model, is_binary=is_binary)
        rig = read_rig(tmp_path)
        assert [camera.name for camera in rig.cameras] == list(scene.names)
        for row, camera in enumerate(rig.cameras):
            found = projected(camera.K, camera.lens, camera.world_to_camera, make_points())
            assert np.abs(found - scene.project(row, make_points())).max() < 1e-6
        for path in tmp_path.glob("*.bin"):
            path.unlink()


@pytest.mark.parametrize(
    ("frame", "inner", "model", "first"),
    [
        ("frame{:06d}", "images", "frame000000/sparse/0", 0),
        ("frame{:06d}", "", "sparse/0", 0),
        ("frame{:06d}", "", "frame000000/sparse", 0),
        ("colmap_{}", "images", "colmap_8/sparse/0", 8),
        ("colmap_{}", "input", "colmap_8/sparse/0", 8),
    ],
)
def test_frames_in_folders_of_their_own(tmp_path: Path, frame: str, inner: str, model: str, first: int) -> None:
    scene = make_scene(lens="opencv4")
    written_colmap_frames.write(tmp_path, scene, lens="opencv4", frame=frame, inner=inner, model=model, first=first)
    capture = check_reads_as(tmp_path, scene)
    assert capture.format == "colmap frames"
    assert capture.layout.points is not None


def test_multipleview(tmp_path: Path) -> None:
    scene = make_scene(lens="opencv4", names=written_multipleview.NAMES)
    written_multipleview.write(tmp_path, scene, lens="opencv4")
    assert check_reads_as(tmp_path, scene).format == "multipleview"


def test_leading_zeros_and_case_do_not_matter_for_names(tmp_path: Path) -> None:
    scene = make_scene(lens="pinhole", names=("cam01", "cam02", "cam03"))
    write_model(tmp_path / "sparse", scene.named(("Cam1", "Cam2", "Cam3")), "PINHOLE")
    write_frames(tmp_path, scene, "videos")
    capture = open_capture(tmp_path)
    assert capture.rig.names == ("Cam1", "Cam2", "Cam3")
    assert capture.n_frames == scene.n_frames


def test_smaller_frames_scale_the_calibration(tmp_path: Path) -> None:
    large = make_scene(lens="opencv4", size=(96, 64))
    small = make_scene(lens="opencv4", size=(48, 32))
    write_model(tmp_path / "sparse", large, "OPENCV")
    write_frames(tmp_path, small, "folders")
    capture = open_capture(tmp_path)
    assert np.allclose(capture.layout.cameras[1].K[:2], large.Ks[1][:2] / 2)
    assert any("another size than their calibration" in text for text in capture.warnings)


def test_frames_without_a_pose_are_left_out_and_named(tmp_path: Path) -> None:
    scene = make_scene(lens="pinhole")
    written_colmap.write(tmp_path, scene, lens="pinhole")
    scene.write_video(tmp_path / "cam99.mp4", 0)
    (warning,) = open_capture(tmp_path).warnings
    assert "cam99.mp4" in warning


def test_several_poses_of_one_camera_that_differ_are_said(tmp_path: Path) -> None:
    scene = make_scene(lens="pinhole", names=("a", "b"))
    moved = scene.world_to_camera.copy()
    moved[:, 0, 3] += 0.3
    doubled = make_scene(lens="pinhole", names=("a/1", "b/1", "a/2", "b/2"))
    object.__setattr__(doubled, "world_to_camera", np.concatenate([scene.world_to_camera, moved]))
    object.__setattr__(doubled, "Ks", np.concatenate([scene.Ks, scene.Ks]))
    write_model(tmp_path / "sparse", doubled, "PINHOLE")
    write_frames(tmp_path, scene, "folders")
    capture = check_reads_as(tmp_path, scene)
    assert any("poses that differ" in text for text in capture.warnings)


def test_a_second_model_and_files_of_newer_versions_change_nothing(tmp_path: Path) -> None:
    scene = make_scene(lens="opencv4")
    written_colmap.write(tmp_path, scene, lens="opencv4")
    for name in ("rigs.bin", "frames.bin"):
        (tmp_path / "sparse/0" / name).write_bytes(b"\x01" * 50)
    write_model(tmp_path / "sparse/1", scene, "OPENCV")
    capture = check_reads_as(tmp_path, scene)
    assert any("Other models" in text for text in capture.warnings)


Spoil = Callable[[Path], object]


def unlink(name: str) -> Spoil:
    return lambda folder: (folder / name).unlink()


def cut(name: str, n_bytes: int) -> Spoil:
    return lambda folder: (folder / name).write_bytes((folder / name).read_bytes()[:n_bytes])


def put(name: str, data: bytes) -> Spoil:
    return lambda folder: (folder / name).write_bytes(data)


def replaced(name: str, old: bytes, new: bytes) -> Spoil:
    def spoil(folder: Path) -> None:
        data = (folder / name).read_bytes()
        assert old in data
        (folder / name).write_bytes(data.replace(old, new))

    return spoil


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (cut("sparse/0/cameras.bin", 100), "announces 4 cameras"),
        (cut("sparse/0/images.bin", 400), "ends too early|do not|announces"),
        (put("sparse/0/images.bin", b""), "ends too early"),
        (put("sparse/0/images.bin", b"\0" * 8), "no images"),
        (put("sparse/0/cameras.bin", b"\xff" * 8), "announces 18446744073709551615"),
        (put("sparse/0/images.bin", b"\x89PNG\r\n\x1a\n" * 100), "damaged or not a COLMAP file"),
        (put("sparse/0/images.bin", b"\0" * 8 + b"more"), "left over"),
        (unlink("cam2.mp4"), "No frames found for 1 of 4 cameras: 'cam2'"),
        (put("cam2.mp4", b""), "cam2"),
        (replaced("sparse/0/images.bin", b"cam2.jpg", b"cam1.png"), "same name but for their suffix: 'cam1'"),
        (replaced("sparse/0/images.bin", b"cam2.jpg", b"\xff\xfe\xfd2.jpg"), "not UTF-8"),
    ],
)
def test_what_is_wrong_with_a_rig_is_said(tmp_path: Path, spoil: Spoil, said: str) -> None:
    scene = make_scene(lens="opencv4")
    written_colmap.write(tmp_path, scene, lens="opencv4")
    spoil(tmp_path)
    with pytest.raises(CaptureError, match=said):
        open_capture(tmp_path)


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (replaced("sparse/0/cameras.txt", b"OPENCV", b"EUCM"), "8 parameters, EUCM has 6"),
        (replaced("sparse/0/cameras.txt", b"OPENCV", b"MAGIC"), "unknown model 'MAGIC'"),
        (replaced("sparse/0/cameras.txt", b"48 32", b"48 0"), "48 x 0"),
        (replaced("sparse/0/cameras.txt", b"48 32", b"48 -3"), "'-3' is not a number"),
        (replaced("sparse/0/cameras.txt", b"48 32", b"48 99999"), "99999"),
        (replaced("sparse/0/cameras.txt", b"48 32", b"48 x"), "'x' is not a number"),
        (put("sparse/0/images.txt", b"1 2 3\n\n"), "is not an image"),
        (put("sparse/0/images.txt", b"1 1 0 0 0 0 0 nan 1 cam1.jpg\n\n"), "NaN or infinity in its pose"),
        (put("sparse/0/images.txt", b"1 0.5 0 0 0 0 0 1 1 cam1.jpg\n\n"), "is not a rotation"),
        (put("sparse/0/images.txt", b"1 0 0 0 0 0 0 1 1 cam1.jpg\n\n"), "is not a rotation"),
        (put("sparse/0/images.txt", b"1 1 0 0 0 0 0 1 77 cam1.jpg\n\n"), "camera 77"),
        (put("sparse/0/images.txt", b"1 a 0 0 0 0 0 1 77 cam1.jpg\n\n"), "are not numbers"),
    ],
)
def test_what_is_wrong_with_a_model_in_text_is_said(tmp_path: Path, spoil: Spoil, said: str) -> None:
    scene = make_scene(lens="opencv4")
    written_colmap.write(tmp_path, scene, lens="opencv4", is_binary=False)
    spoil(tmp_path)
    with pytest.raises(CaptureError, match=said):
        open_capture(tmp_path)


def test_a_model_that_is_not_supported_is_named_with_what_to_do(tmp_path: Path) -> None:
    scene = make_scene(lens="opencv4")
    written_colmap.write(tmp_path, scene, lens="opencv4", is_binary=False)
    path = tmp_path / "sparse/0/cameras.txt"
    lines = [line.split() for line in path.read_text().splitlines() if not line.startswith("#")]
    path.write_text("\n".join(" ".join([line[0], "EUCM", *line[2:10]]) for line in lines))
    with pytest.raises(CaptureError) as caught:
        open_capture(tmp_path)
    assert len(caught.value.problems) == 4
    assert "EUCM is not supported" in str(caught.value)
    assert "image_undistorter" in str(caught.value)


def test_all_problems_come_at_once(tmp_path: Path) -> None:
    scene = make_scene(lens="opencv4")
    written_colmap.write(tmp_path, scene, lens="opencv4", is_binary=False, frames="folders")
    path = tmp_path / "sparse/0/images.txt"
    path.write_text(path.read_text().replace(" 2 cam2.jpg", " 99 cam2.jpg"))
    for file in (tmp_path / "images/cam1").iterdir():
        file.unlink()
    Image.new("RGB", (48, 32)).save(tmp_path / "images/cam10/000009.jpg")
    with pytest.raises(CaptureError) as caught:
        open_capture(tmp_path)
    assert len(caught.value.problems) == 3


def test_names_that_match_nothing_are_listed(tmp_path: Path) -> None:
    scene = make_scene(lens="pinhole")
    write_model(tmp_path / "sparse", scene, "PINHOLE")
    write_frames(tmp_path, scene.named(("north", "east", "south", "west")), "videos")
    with pytest.raises(CaptureError) as caught:
        open_capture(tmp_path)
    assert "No frames found for 4 of 4 cameras" in str(caught.value)
    assert "north.mp4" in str(caught.value)


def test_links_that_lead_outside_or_to_themselves_are_refused(tmp_path: Path) -> None:
    scene = make_scene(lens="pinhole")
    folder = tmp_path / "capture"
    written_colmap.write(folder, scene, lens="pinhole", frames="folders")
    (folder / "images/cam1").rename(tmp_path / "elsewhere")
    (folder / "images/cam1").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(CaptureError, match="leads out of the capture folder"):
        open_capture(folder)
    check_reads_as(folder, scene, follow_links=True)
    (folder / "images/cam1").unlink()
    (folder / "images/cam1").symlink_to(folder / "images/cam1")
    with pytest.raises(CaptureError, match="cam1"):
        open_capture(folder)


@pytest.mark.parametrize("place", ["frame000002/images/cam10.png", "frame000000/images/cam1.png"])
def test_a_frame_without_an_image_is_named(tmp_path: Path, place: str) -> None:
    scene = make_scene(lens="opencv4")
    written_colmap_frames.write(tmp_path, scene, lens="opencv4")
    (tmp_path / place).unlink()
    with pytest.raises(CaptureError, match="no image in 1 of 4 frames"):
        open_capture(tmp_path)


def test_folders_of_frames_that_are_missing_are_said(tmp_path: Path) -> None:
    import shutil

    scene = make_scene(lens="opencv4", n_frames=5)
    written_colmap_frames.write(tmp_path, scene, lens="opencv4")
    shutil.rmtree(tmp_path / "frame000003")
    capture = open_capture(tmp_path)
    assert capture.n_frames == 4
    assert any("missing before 4" in text for text in capture.warnings)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda folder: (folder / "sparse/0").mkdir(parents=True), "no cameras and images of a model"),
        (lambda folder: (folder / "database.db").touch(), "a COLMAP project"),
        (lambda folder: (folder / "frame000000").mkdir(), "folders of frames such as frame000000"),
        (lambda folder: (folder / "poses_bounds_multipleview.npy").touch(), "no folders of frames such as cam01"),
    ],
)
def test_parts_of_a_layout_are_recognised_and_what_is_missing_is_said(
    tmp_path: Path, make: Callable[[Path], None], said: str
) -> None:
    make(tmp_path)
    with pytest.raises(CaptureError) as caught:
        open_capture(tmp_path)
    assert said in str(caught.value)
