"""poses_bounds.npy with videos or frames: the scene through it, and what is wrong with it in words."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from engine.capture.capture import open_capture
from engine.errors import CaptureError
from tests.engine.capture.layouts import written_n3dv
from tests.engine.capture.layouts.scene import Scene, check_reads_as, make_scene


def n3dv_scene(**options: object) -> Scene:
    return make_scene(lens="pinhole", is_centered=True, is_one_focal=True, **options)  # type: ignore[arg-type]


@pytest.mark.parametrize("frames", ["videos", "images", ""])
@pytest.mark.parametrize("times", [1.0, 2.0])
def test_it_reads_as_its_scene(tmp_path: Path, frames: str, times: float) -> None:
    scene = n3dv_scene()
    written_n3dv.write(tmp_path, scene, frames=frames, times=times)
    capture = check_reads_as(tmp_path, scene)
    assert capture.format == "n3dv"
    assert capture.default_holdout == ("cam1",)


def test_odd_names(tmp_path: Path) -> None:
    scene = n3dv_scene(names=("Kamera-ä3", "cam 1", "cam.2", "左4"))
    written_n3dv.write(tmp_path, scene)
    check_reads_as(tmp_path, scene)


def test_a_single_moment_as_of_llff(tmp_path: Path) -> None:
    scene = n3dv_scene(n_frames=1)
    (tmp_path / "images").mkdir()
    for row, name in enumerate(scene.names):
        Image.fromarray(scene.picture(row, 0)).save(tmp_path / "images" / f"{name}.png")
    np.save(tmp_path / "poses_bounds.npy", written_n3dv.poses_bounds(scene))
    check_reads_as(tmp_path, scene)


def test_other_numbers_of_videos_and_rows_say_which(tmp_path: Path) -> None:
    written_n3dv.write(tmp_path, n3dv_scene(names=("cam00", "cam01", "cam02", "cam03")))
    (tmp_path / "cam02.mp4").unlink()
    with pytest.raises(CaptureError) as caught:
        open_capture(tmp_path)
    assert "4 rows, but there are 3 videos" in str(caught.value)
    assert "cam02 would fit" in str(caught.value)


def test_the_frames_are_read_where_videos_do_not_fit_the_rows(tmp_path: Path) -> None:
    scene = n3dv_scene()
    written_n3dv.write(tmp_path, scene, frames="images")
    scene.write_video(tmp_path / "preview.mp4", 0)
    check_reads_as(tmp_path, scene)


def test_a_left_handed_camera_is_refused(tmp_path: Path) -> None:
    scene = n3dv_scene()
    written_n3dv.write(tmp_path, scene)
    rows = written_n3dv.poses_bounds(scene)
    rows[2, [2, 7, 12]] *= -1
    np.save(tmp_path / "poses_bounds.npy", rows)
    with pytest.raises(CaptureError, match=r'"cam10" is not a rotation.*determinant is -1'):
        open_capture(tmp_path)


def spoiled(edit: Callable[[np.ndarray], object]) -> Callable[[Path, np.ndarray], None]:
    def spoil(path: Path, rows: np.ndarray) -> None:
        edit(rows)
        np.save(path, rows)

    return spoil


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (spoiled(lambda rows: rows.__setitem__((1, 3), np.nan)), "NaN or infinity in its pose"),
        (spoiled(lambda rows: rows.__setitem__((1, 4), np.nan)), "width and height"),
        (spoiled(lambda rows: rows.__setitem__((1, 14), np.inf)), "NaN or infinity in K"),
        (spoiled(lambda rows: rows.__setitem__((1, 14), 1e-9)), "bad K"),
        (spoiled(lambda rows: rows.__imul__(3.0)), "is not a rotation|entries are at most 1"),
        (lambda path, rows: np.save(path, rows[:, :9]), "4 x 9 numbers, not 17"),
        (lambda path, rows: np.save(path, rows[:0]), "0 x 17"),
        (lambda path, rows: np.save(path, rows[:3]), "take out what has no row"),
        (lambda path, rows: np.save(path, rows.astype(object), allow_pickle=True), "does not hold numbers"),
        (lambda path, rows: np.save(path, np.array(["x"] * 17)), "does not hold numbers"),
        (lambda path, rows: path.write_bytes(path.read_bytes()[:-8]), "announces 68 numbers"),
        (lambda path, rows: path.write_bytes(path.read_bytes()[:30]), "header is damaged"),
        (lambda path, rows: path.write_bytes(b""), "not a .npy file"),
        (lambda path, rows: path.write_text("[1, 2, 3]"), "not a .npy file"),
        (lambda path, rows: (path.with_name("cam2.mp4")).write_bytes(b"\0" * 100), "cam2"),
    ],
)
def test_what_is_wrong_is_said(tmp_path: Path, spoil: Callable[[Path, np.ndarray], None], said: str) -> None:
    scene = n3dv_scene()
    written_n3dv.write(tmp_path, scene)
    spoil(tmp_path / "poses_bounds.npy", written_n3dv.poses_bounds(scene))
    with pytest.raises(CaptureError, match=said):
        open_capture(tmp_path)


def test_poses_alone_are_recognised(tmp_path: Path) -> None:
    np.save(tmp_path / "poses_bounds.npy", written_n3dv.poses_bounds(n3dv_scene()))
    with pytest.raises(CaptureError, match=r"there is poses_bounds.npy, but no videos.*cam00.mp4"):
        open_capture(tmp_path)
