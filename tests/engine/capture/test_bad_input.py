"""Captures that cannot be used: each gets plain messages that name the file, say what was found and what to do."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

from engine.capture.capture import open_capture
from engine.children.messages import Refusal, decoded, encoded
from engine.errors import CaptureError

MakeCapture = Callable[..., Path]


def problem_of(folder: Path) -> CaptureError:
    """The one error that opening raises; a single problem has a hint and a path."""
    with pytest.raises(CaptureError) as caught:
        open_capture(folder)
    for problem in caught.value.problems or (caught.value,):
        assert problem.hint
        assert problem.path is not None
        assert str(problem.path) in str(caught.value)
    return caught.value


def camera(document: dict[str, Any], row: int) -> dict[str, Any]:
    return document["cameras"][row]


def test_a_folder_that_is_not_a_capture_says_what_was_looked_for(tmp_path: Path) -> None:
    message = str(problem_of(tmp_path))
    assert "not a capture (no known layout was recognised)" in message
    assert "In it: nothing." in message
    assert "docs/capture_formats.md" in message
    assert list(tmp_path.iterdir()) == []


def test_a_folder_above_a_capture_points_to_it(make_sample: MakeCapture) -> None:
    assert "Open sample inside it" in str(problem_of(make_sample().parent))


@pytest.mark.parametrize(
    ("name", "whose", "hint"),
    [
        ("other/Calib.qca.txt", "Qualisys", "Put it into the folder or into calibration/"),
        ("take/Take 1.mcal", "OptiTrack", "write its cameras into capture.json"),
        ("calibration/Cameras.PICKLE", "OpenCap", "Pickles are not read"),
        ("Calib.qca", "Qualisys", "as text (.qca.txt)"),
    ],
)
def test_calibrations_of_other_programs_are_named(tmp_path: Path, name: str, whose: str, hint: str) -> None:
    (tmp_path / "videos").mkdir()
    (tmp_path / "videos" / "a.mp4").touch()
    (tmp_path / name).parent.mkdir(exist_ok=True)
    (tmp_path / name).touch()
    message = str(problem_of(tmp_path))
    assert f"not a capture ({name} looks like a calibration of {whose})" in message
    assert hint in message


def test_a_missing_folder_and_a_file_are_named(make_sample: MakeCapture) -> None:
    folder = make_sample()
    assert "no such folder" in str(problem_of(folder / "nowhere"))
    assert "Open " + str(folder) in str(problem_of(folder / "cameras.json"))


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("", "not valid JSON"),
        ('{"schema": 1, "cam', "not valid JSON"),
        ("\x00\x01", "not valid JSON"),
        ("[1]", "holds a list, not an object"),
        ('{"schema": 7}', "schema 7"),
        ('{"schema": 1, "fps": 30}', 'no list "cameras"'),
        ('{"schema": 1, "fps": 30, "cameras": []}', "no cameras"),
    ],
)
def test_a_damaged_cameras_file(make_sample: MakeCapture, text: str, found: str) -> None:
    folder = make_sample(n_cameras=1)
    (folder / "cameras.json").write_text(text)
    error = problem_of(folder)
    assert found in str(error)
    assert error.path == folder / "cameras.json"


@pytest.mark.parametrize(
    ("edit", "found"),
    [
        (lambda d: camera(d, 1).update(name="cam00"), '2 cameras are called "cam00"'),
        (lambda d: camera(d, 1).pop("file"), "number 1 has no name or no file"),
        (lambda d: camera(d, 1).update(width=0), 'camera "cam01" has width and height 0 and 32'),
        (lambda d: camera(d, 1).update(width=50), "48x32 frames, its calibration is for 50x32"),
        (lambda d: camera(d, 1).update(K=[1, 2]), "no 3x3 matrix K"),
        (lambda d: camera(d, 1)["K"][0].__setitem__(0, -5.0), "fx -5"),
        (lambda d: camera(d, 1)["K"][0].__setitem__(0, float("nan")), "NaN or infinity in K"),
        (lambda d: camera(d, 1)["K"][0].__setitem__(1, 3.0), "skew 3"),
        (lambda d: camera(d, 1)["K"][2].__setitem__(2, 2.0), "last row is not 0 0 1"),
        (lambda d: camera(d, 1)["K"][0].__setitem__(2, 400.0), "principal point 400"),
        (lambda d: camera(d, 1).update(world_to_camera="x"), "no 4x4 matrix world_to_camera"),
        (lambda d: camera(d, 1)["world_to_camera"][1].__setitem__(3, float("nan")), "NaN or infinity in its pose"),
        (lambda d: camera(d, 1)["world_to_camera"][0].__setitem__(0, 2.0), "is not a rotation"),
        (lambda d: camera(d, 1)["world_to_camera"].__setitem__(0, [-1, 0, 0, 0]), "is not a rotation"),
        (lambda d: camera(d, 1)["world_to_camera"].__setitem__(3, [0, 0, 0, 2]), "0 0 0 2 as its last row"),
        (lambda d: d.update(fps=0), "fps is 0"),
        (lambda d: d.update(fps="fast"), "fps is 'fast'"),
        (lambda d: d.update(n_frames=7), "n_frames is 7, every video has 6 frames"),
        (lambda d: d.update(default_holdout=["cam7"]), "default_holdout names cam7"),
    ],
)
def test_one_wrong_value_gives_one_message(make_sample: MakeCapture, edit: Callable[..., None], found: str) -> None:
    error = problem_of(make_sample(edit=edit))
    assert found.lower() in str(error).lower()
    assert error.problems == ()


def test_a_mirrored_pose_is_not_a_rotation(make_sample: MakeCapture) -> None:
    def mirror(document: dict[str, Any]) -> None:
        row = camera(document, 0)["world_to_camera"][0]
        row[:3] = [-value for value in row[:3]]

    assert "determinant is -1" in str(problem_of(make_sample(edit=mirror)))


def test_cameras_with_different_frame_counts(make_sample: MakeCapture) -> None:
    error = problem_of(make_sample(n_frames_of={"cam01": 4}))
    assert 'Camera "cam01" has 4 frames, 2 other cameras have 6.' in str(error)
    assert error.path is not None
    assert error.path.name == "cam01.mp4"


@pytest.mark.parametrize(
    ("damage", "found"),
    [
        (lambda path: path.unlink(), "video is missing"),
        (lambda path: path.write_bytes(b""), "empty (0 bytes)"),
        (lambda path: path.write_bytes(b"this is text, not a video" * 50), "cannot be opened"),
        (lambda path: path.write_bytes(path.read_bytes()[:200]), "truncated"),
        (lambda path: path.write_bytes(path.read_bytes()[:-300]), "truncated: its index lists 6 frames"),
        (lambda path: path.write_bytes(path.read_bytes()[:-1]), "only 5 lie within"),
    ],
)
def test_a_camera_without_a_whole_video(make_sample: MakeCapture, damage: Callable[[Path], Any], found: str) -> None:
    folder = make_sample()
    damage(folder / "cam01.mp4")
    error = problem_of(folder)
    assert found in str(error)
    assert 'Camera "cam01"' in str(error)
    assert error.path == folder / "cam01.mp4"


def test_video_data_damaged_inside_is_found_when_decoding(make_sample: MakeCapture) -> None:
    folder = make_sample(n_frames=30)
    path = folder / "cam01.mp4"
    data = bytearray(path.read_bytes())
    start = data.index(b"mdat") + 4
    data[start:] = bytes(len(data) - start)  # the container is whole, the pictures are gone
    path.write_bytes(data)
    capture = open_capture(folder)
    with pytest.raises(CaptureError, match=r"Frame 12 of 30 cannot be decoded.*cam01\.mp4"):
        capture.frame(1, 12)
    assert capture.frame(0, 12).shape == (32, 48, 3)  # the others are not harmed


def test_all_problems_are_listed_at_once_and_survive_a_process_boundary(make_sample: MakeCapture) -> None:
    def edit(document: dict[str, Any]) -> None:
        camera(document, 0)["K"][0][0] = float("nan")
        camera(document, 1)["world_to_camera"][0][0] = float("nan")
        document["fps"] = -1

    folder = make_sample(edit=edit)
    (folder / "cam02.mp4").unlink()
    error = problem_of(folder)
    assert len(error.problems) == 4
    for found in ("4 problems", 'Camera "cam00" has NaN', 'Camera "cam01" has NaN', "cam02.mp4", "fps is -1"):
        assert found in str(error)
    assert str(decoded(encoded(Refusal.of(error)), Refusal).error()) == str(error)


def test_panoptic_camera_without_frames(make_panoptic: MakeCapture) -> None:
    folder = make_panoptic()
    for path in (folder / "ims" / "10").iterdir():
        path.unlink()
    error = problem_of(folder)
    assert 'Camera "10" has no frames' in str(error)
    assert error.path == folder / "ims" / "10"


def test_panoptic_missing_frame_in_one_camera(make_panoptic: MakeCapture) -> None:
    folder = make_panoptic()
    (folder / "ims" / "2" / "000001.jpg").unlink()
    message = str(problem_of(folder))
    assert 'Camera "2" has 2 frames, 3 other cameras have 3.' in message
    assert "lacks 1 of 3 listed frames: 2/000001.jpg" in message


def test_panoptic_truncated_and_empty_images(make_panoptic: MakeCapture) -> None:
    folder = make_panoptic()
    cut, empty = folder / "ims" / "1" / "000002.jpg", folder / "ims" / "2" / "000000.jpg"
    cut.write_bytes(cut.read_bytes()[:400])
    empty.write_bytes(b"")
    error = problem_of(folder)
    assert {problem.path for problem in error.problems} == {cut, empty}
    assert "truncated: the JPEG ends after 400 bytes" in str(error)
    assert "is empty" in str(error)


def test_panoptic_image_damaged_inside_is_found_when_decoding(make_panoptic: MakeCapture) -> None:
    folder = make_panoptic()
    path = folder / "ims" / "1" / "000001.jpg"
    whole = path.read_bytes()
    path.write_bytes(whole[: whole.index(b"\xff\xda")] + b"\xff\xd9")  # header and end marker, nothing between
    capture = open_capture(folder)
    with pytest.raises(CaptureError, match=r"cannot be decoded.*000001\.jpg"):
        capture.frame(1, 1)


def test_panoptic_wrong_image_size(make_panoptic: MakeCapture) -> None:
    folder = make_panoptic()
    for path in (folder / "ims" / "1").iterdir():
        Image.new("RGB", (20, 10)).save(path)
    error = problem_of(folder)
    assert 'Camera "1" has 20x10 frames, its calibration is for 48x32' in str(error)


def test_panoptic_one_later_image_of_another_size_is_named(make_panoptic: MakeCapture) -> None:
    folder = make_panoptic()
    Image.new("RGB", (20, 10)).save(folder / "ims" / "1" / "000002.jpg")
    error = problem_of(folder)
    assert 'Camera "1" has 20x10 frames, its calibration is for 48x32' in str(error)
    assert str(error).endswith("000002.jpg")


@pytest.mark.parametrize(
    ("edit", "found"),
    [
        (lambda d: d["train_meta.json"].pop("w2c"), "lacks w2c"),
        (lambda d: d["train_meta.json"].update(w="wide"), "w and h are 'wide' and 32"),
        (lambda d: d["train_meta.json"].update(fn=[]), "at least one frame"),
        (lambda d: d["train_meta.json"]["k"].pop(), "k must hold one 3x3 for each of 3 frames and 3 cameras"),
        (lambda d: d["train_meta.json"]["w2c"][1].pop(), "w2c must hold one 4x4"),
        (lambda d: d["train_meta.json"]["cam_id"][1].reverse(), "same whole numbers in the same order"),
        (lambda d: d["test_meta.json"].update(cam_id=[[0.5]] * 3), "same whole numbers in the same order"),
        (
            lambda d: d["train_meta.json"]["cam_id"].__setitem__(slice(None), [[1, 10, 1]] * 3),
            '2 cameras are called "1"',
        ),
        (lambda d: d["train_meta.json"]["w2c"][0][1][2].__setitem__(0, float("nan")), '"10" has NaN'),
        (lambda d: d["test_meta.json"]["w2c"][2][0][0].__setitem__(3, 9.0), '"0" moves from frame 2'),
        (
            lambda d: d["test_meta.json"]["w2c"][2][0][0].__setitem__(3, float("nan")),
            '"0" has NaN or infinity in its calibration of frame 2',
        ),
        (lambda d: d["test_meta.json"]["w2c"][0][0].__setitem__(0, [1, 1, 0, 0]), "is not a rotation"),
    ],
)
def test_panoptic_wrong_values(make_panoptic: MakeCapture, edit: Callable[..., None], found: str) -> None:
    assert found in str(problem_of(make_panoptic(edit=edit)))


def test_panoptic_without_its_main_file(make_panoptic: MakeCapture) -> None:
    folder = make_panoptic()
    (folder / "train_meta.json").unlink()
    error = problem_of(folder)
    assert error.path == folder / "train_meta.json"
    assert "missing" in str(error)


def test_panoptic_frames_listed_differently_in_the_two_files(make_panoptic: MakeCapture) -> None:
    def edit(documents: dict[str, dict[str, Any]]) -> None:
        for key in ("k", "w2c", "fn", "cam_id"):
            documents["test_meta.json"][key].pop()

    message = str(problem_of(make_panoptic(edit=edit)))
    assert 'Camera "0" has 2 frames, 3 other cameras have 3' in message


def test_a_file_that_may_not_be_read(make_panoptic: MakeCapture, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = make_panoptic()  # a mode of 000 would not stop root, so the refusal is played
    secret = folder / "ims" / "2" / "000001.jpg"
    real_open = os.open

    def refuse(path: Any, *args: Any, **kwargs: Any) -> int:
        if path == secret:
            raise PermissionError(13, "Permission denied", str(path))
        return real_open(path, *args, **kwargs)

    monkeypatch.setattr(os, "open", refuse)
    error = problem_of(folder)
    assert "cannot be read (Permission denied)" in str(error)
    assert error.path == secret


def test_nothing_is_written_when_opening_fails(make_sample: MakeCapture) -> None:
    folder = make_sample(edit=lambda document: document.update(fps=0))
    before = sorted(folder.rglob("*"))
    problem_of(folder)
    assert sorted(folder.rglob("*")) == before
    assert json.loads((folder / "cameras.json").read_text())["fps"] == 0
