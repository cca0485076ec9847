"""Captures that someone else made: what they name, claim or hold may not harm, hang or mislead."""

from __future__ import annotations

import json
import os
import shutil
import socket
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from engine.capture.capture import open_capture
from engine.capture.capture_summary import describe
from engine.capture.layout.limits import MAX_SIDE
from engine.errors import CaptureError
from tests.engine.capture.layouts import written_transforms
from tests.engine.capture.layouts.scene import make_scene

MakeCapture = Callable[..., Path]


def refusal(folder: Path) -> str:
    """The message with which opening ends."""
    with pytest.raises(CaptureError) as caught:
        open_capture(folder)
    for problem in caught.value.problems or (caught.value,):
        assert problem.hint
    return str(caught.value)


def camera(document: dict[str, Any], row: int) -> dict[str, Any]:
    return document["cameras"][row]


def pipe(path: Path) -> None:
    os.mkfifo(path)


def device(path: Path) -> None:
    path.symlink_to("/dev/zero")


def listening_socket(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as server:
        here = os.getcwd()
        os.chdir(path.parent)  # names of sockets are short
        server.bind(path.name)
        os.chdir(here)


# ---------------------------------------------------------------- what lies under a name


@pytest.mark.parametrize("put", [pipe, device, listening_socket, Path.mkdir])
def test_only_regular_files_are_read(make_sample: MakeCapture, put: Callable[[Path], Any]) -> None:
    folder = make_sample()
    for name in ("cam01.mp4", "cameras.json"):
        shutil.copytree(folder, other := folder.with_name(f"with {name}"))
        (other / name).unlink()
        put(other / name)
        message = refusal(other)
        assert name in message


@pytest.mark.parametrize("put", [pipe, device, listening_socket, Path.mkdir])
@pytest.mark.parametrize("name", ["train_meta.json", "test_meta.json", "ims/1/000001.jpg"])
def test_only_regular_files_are_read_of_panoptic(
    make_panoptic: MakeCapture, put: Callable[[Path], Any], name: str
) -> None:
    folder = make_panoptic()
    (folder / name).unlink()
    put(folder / name)
    assert name in refusal(folder)


def test_a_device_is_not_read_to_its_end_where_links_may_lead_outside(make_panoptic: MakeCapture) -> None:
    folder = make_panoptic(edit=lambda d: d["train_meta.json"]["fn"][0].__setitem__(0, "1/zero.jpg"))
    (folder / "ims" / "1" / "zero.jpg").symlink_to("/dev/zero")
    with pytest.raises(CaptureError, match="pipe or a device"):
        open_capture(folder, follow_links=True)


def test_a_playlist_is_not_followed(make_sample: MakeCapture) -> None:
    folder = make_sample()
    (folder / "cam01.mp4").write_text("#EXTM3U\n#EXTINF:1,\ncam02.mp4\n#EXT-X-ENDLIST\n")
    assert "cannot be opened" in refusal(folder)
    (folder / "cam01.mp4").write_text("ffconcat version 1.0\nfile 'cam02.mp4'\n")
    assert "cannot be opened" in refusal(folder)


def test_a_name_that_is_a_protocol_to_the_decoder_is_a_file_name_here(
    make_sample: MakeCapture, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = make_sample(edit=lambda d: camera(d, 1).update(file="concat:cam01.mp4|cam02.mp4"))
    monkeypatch.chdir(folder)
    with pytest.raises(CaptureError, match="video is missing"):
        open_capture(".")
    (folder / "cam01.mp4").rename(folder / "concat:cam01.mp4|cam02.mp4")
    assert open_capture(".").frame(1, 0).shape == (32, 48, 3)


def test_a_video_of_an_unknown_kind(make_sample: MakeCapture) -> None:
    folder = make_sample()
    path = folder / "cam01.mp4"
    path.write_bytes(path.read_bytes().replace(b"avc1", b"zzzz"))
    assert "has an unknown format" in refusal(folder)


def test_postscript_is_not_run_as_an_image(make_panoptic: MakeCapture) -> None:
    folder = make_panoptic(edit=lambda d: d["train_meta.json"]["fn"][0].__setitem__(0, "1/a.eps"))
    (folder / "ims/1/a.eps").write_text("%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 48 32\nshowpage\n")
    assert "not a readable image" in refusal(folder)


# ---------------------------------------------------------------- names


@pytest.mark.parametrize("name", ["../outside.mp4", "/etc/hostname", "../sample-2/cam01.mp4", ".", ""])
def test_names_stay_inside_the_folder(make_sample: MakeCapture, name: str) -> None:
    folder = make_sample(edit=lambda d: camera(d, 1).update(file=name))
    shutil.copytree(folder, folder.with_name("sample-2"))
    message = refusal(folder)
    assert "not inside its folder" in message or "file name is empty" in message
    assert 'Camera "cam01"' in message


def test_a_name_that_comes_back_inside_is_read(make_sample: MakeCapture) -> None:
    folder = make_sample(edit=lambda d: camera(d, 1).update(file="../sample/cam01.mp4"))
    assert open_capture(folder).n_frames == 6


def test_links_that_lead_outside_are_followed_only_when_the_user_says_so(make_sample: MakeCapture) -> None:
    folder = make_sample()
    elsewhere = folder.with_name("elsewhere.mp4")
    (folder / "cam01.mp4").rename(elsewhere)
    (folder / "cam01.mp4").symlink_to(elsewhere)
    message = refusal(folder)
    assert "cam01.mp4' is a link that leads out of the capture folder, to " in message
    assert "--follow-links" in message
    capture = open_capture(folder, follow_links=True)
    assert capture.follow_links
    assert capture.n_frames == 6
    (folder / "cam01.mp4").unlink()
    elsewhere.rename(folder / "moved.mp4")
    (folder / "cam01.mp4").symlink_to("moved.mp4")
    assert open_capture(folder).n_frames == 6  # a link inside the folder harms nobody


def test_links_of_panoptic_that_lead_outside(make_panoptic: MakeCapture) -> None:
    folder = make_panoptic()
    image = folder / "ims" / "1" / "000001.jpg"
    image.rename(elsewhere := folder.with_name("elsewhere.jpg"))
    image.symlink_to(elsewhere)
    assert "000001.jpg' is a link that leads out" in refusal(folder)
    assert open_capture(folder, follow_links=True).n_frames == 3
    (folder / "ims").rename(ims := folder.with_name("images elsewhere"))
    (folder / "ims").symlink_to(ims)
    assert "is a link that leads out" in refusal(folder)
    assert open_capture(folder, follow_links=True).n_frames == 3


@pytest.mark.parametrize("name", ["../../outside.jpg", "/etc/hostname", "../../../../../../etc/hostname", "..", ""])
def test_names_of_panoptic_stay_inside_the_folder(make_panoptic: MakeCapture, name: str) -> None:
    folder = make_panoptic(edit=lambda d: d["train_meta.json"]["fn"][1].__setitem__(0, name))
    folder.with_name("outside.jpg").write_bytes((folder / "ims/1/000001.jpg").read_bytes())
    refusal(folder)


@pytest.mark.parametrize("name", ["", "  ", "a\nb", "\x1b[2Jcam", "\u202ecam", "x" * 101, "\x00"])
def test_a_camera_has_a_name_that_can_be_read_and_typed(make_sample: MakeCapture, name: str) -> None:
    message = refusal(make_sample(edit=lambda d: camera(d, 1).update(name=name)))
    assert "Camera number 1 is called" in message
    message.encode("utf-8")
    assert message.isprintable()


@pytest.mark.parametrize("name", ["\ud800.mp4", "a\x00b", "x" * 300, "y/" * 3000, "a\nb", "\x1b[31m.mp4"])
def test_no_file_name_is_more_than_a_message(make_sample: MakeCapture, name: str) -> None:
    message = refusal(make_sample(edit=lambda d: camera(d, 1).update(file=name)))
    message.encode("utf-8")
    assert message.isprintable()
    assert len(message) < 2000


def test_names_that_only_look_odd_are_fine(make_sample: MakeCapture) -> None:
    def edit(document: dict[str, Any]) -> None:
        for row, name in enumerate(("a##b", "c##b", "%s%n")):
            camera(document, row)["name"] = name

    assert open_capture(make_sample(edit=edit)).rig.names == ("a##b", "c##b", "%s%n")


# ---------------------------------------------------------------- numbers


@pytest.mark.parametrize(
    ("place", "text", "found"),
    [
        ("fps", "1" + "0" * 400, "401 digits"),
        ("fps", "9" * 5000, "5000 digits"),
        ("fps", "1e400", "too large"),
        ("fps", "NaN", "fps is nan"),
        ("fps", "1e-300", "fps is 1e-300"),
        ("fps", "true", "fps is True"),
        ("fps", "0", "fps is 0"),
        ("fps", "[" * 5000 + "]" * 5000, "nested more than"),
        ("schema", "true", "schema True"),
        ("schema", "1.0", "schema 1.0"),
        ("n_frames", "true", "n_frames is True"),
        ("n_frames", "6.5", "n_frames is 6.5"),
        ("cameras.1.width", "true", "width and height True and 32"),
        ("cameras.1.width", str(MAX_SIDE + 1), f"whole numbers from 1 to {MAX_SIDE:,}"),
        ("cameras.1.width", "1" + "0" * 30, "width and height 1000"),
        ("cameras.1.K.0.0", "1e-300", "fx is 2.08e-302 times the side"),
        ("cameras.1.K.0.0", "1e300", "fx is 2.08e+298 times the side"),
        ("cameras.1.K.0.2", "1e300", "principal point 1e+300"),
        ("cameras.1.K.1.1", '"40"', "no 3x3 matrix K of numbers"),
        ("cameras.1.K", "[[[[[[[[1]]]]]]]]", "no 3x3 matrix K of numbers"),
        ("cameras.1.world_to_camera.0.0", "1e300", "1e+300 in its rotation"),
        ("cameras.1.world_to_camera.0.3", "1e300", "moves it by 1e+300"),
        ("cameras.1.world_to_camera.0.3", "1e400", "too large"),
    ],
)
def test_absurd_numbers_are_refused(make_sample: MakeCapture, place: str, text: str, found: str) -> None:
    def edit(document: dict[str, Any]) -> None:
        *path, key = [int(part) if part.isdigit() else part for part in place.split(".")]
        node: Any = document
        for part in path:
            node = node[part]
        node[key] = "HERE"

    folder = make_sample(edit=edit)
    (folder / "cameras.json").write_text((folder / "cameras.json").read_text().replace('"HERE"', text))
    message = refusal(folder)
    assert found in message
    assert len(message) < 1000


@pytest.mark.parametrize(
    ("key", "value", "found"),
    [
        ("w", True, "w and h are True and 32"),
        ("h", 2**31, "w and h are 48 and 2147483648"),
        ("cam_id", [[-1, 10, 2]] * 3, "cam_id goes from -1"),
        ("cam_id", [[1e300, 10, 2]] * 3, "cam_id goes from 2 to 1e+300"),
        ("cam_id", [["1", "10", "2"]] * 3, "cam_id must hold one number"),
        ("fn", [[1, 2, 3]] * 3, "fn must list"),
    ],
)
def test_absurd_numbers_of_panoptic_are_refused(make_panoptic: MakeCapture, key: str, value: Any, found: str) -> None:
    assert found in refusal(make_panoptic(edit=lambda d: d["train_meta.json"].update({key: value})))


def test_an_image_that_claims_to_be_huge(make_panoptic: MakeCapture) -> None:
    folder = make_panoptic()
    path = folder / "ims" / "1" / "000001.jpg"
    data = path.read_bytes()
    at = data.index(b"\xff\xc0")
    huge = data[: at + 5] + b"\xff\xff\xff\xff" + data[at + 9 :]
    path.write_bytes(huge)
    assert "claims more than 80,000,000 pixels" in refusal(folder)
    path.write_bytes(data)
    capture = open_capture(folder)
    path.write_bytes(huge)  # it changed after it was looked at
    with pytest.raises(CaptureError, match="cannot be decoded"):
        capture.frame(1, 1)


@pytest.mark.slow
def test_a_message_repeats_no_megabytes(make_sample: MakeCapture) -> None:
    def edit(document: dict[str, Any]) -> None:
        document["fps"] = "x" * 2_000_000
        camera(document, 0)["name"] = "y" * 2_000_000
        camera(document, 1)["width"] = ["z"] * 1_000_000

    assert len(refusal(make_sample(edit=edit))) < 3000


def test_a_file_of_millions_of_numbers_is_refused_before_it_is_parsed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("engine.capture.layout.format_checks.MAX_META_VALUES", 1000)
    parsed: list[int] = []
    monkeypatch.setattr("engine.storage.json_files.json.loads", lambda *_, **__: parsed.append(1))
    (tmp_path / "transforms.json").write_text(f'{{"frames": [], "x": [{"0," * 1001}0]}}')
    assert "The file has 1,002 values, at most 1,000 are read." in refusal(tmp_path)
    assert not parsed


# ---------------------------------------------------------------- right in itself, wrong in fact


@pytest.mark.parametrize("value", ["1e308", "-1e308", "1e300"])
def test_poses_of_transforms_json_beyond_all_numbers_are_refused_without_a_warning(tmp_path: Path, value: str) -> None:
    written_transforms.write(tmp_path, make_scene(size=(32, 24)))
    path = tmp_path / "transforms.json"
    document = json.loads(path.read_text())
    for row, column in ((0, 3), (0, 0), (1, 2)):
        document["frames"][0]["transform_matrix"][row][column] = "here"
    path.write_text(json.dumps(document).replace('"here"', value))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert path.name in refusal(tmp_path)


def test_two_cameras_with_one_file(make_sample: MakeCapture) -> None:
    folder = make_sample(edit=lambda d: camera(d, 2).update(file="cam01.mp4"))
    message = refusal(folder)
    assert 'Cameras "cam01" and "cam02" use the same file: cam01.mp4.' in message
    assert "take one out" in message


def test_two_cameras_with_copies_of_one_video(make_sample: MakeCapture) -> None:
    folder = make_sample()
    shutil.copyfile(folder / "cam01.mp4", folder / "cam02.mp4")
    assert "cam01.mp4 and cam02.mp4 hold the same bytes" in refusal(folder)


def test_two_cameras_of_panoptic_with_the_same_images(make_panoptic: MakeCapture) -> None:
    folder = make_panoptic()
    shutil.rmtree(folder / "ims" / "2")
    shutil.copytree(folder / "ims" / "10", folder / "ims" / "2")
    assert 'Cameras "2" and "10" show the same pictures' in refusal(folder)


def test_cameras_at_one_point_and_what_may_be_behind_it(make_sample: MakeCapture) -> None:
    def without_positions(document: dict[str, Any]) -> None:
        for row in document["cameras"]:
            rotation = np.array(row["world_to_camera"])[:3, :3]
            row["world_to_camera"] = np.block(
                [[rotation, np.zeros((3, 1))], [np.zeros((1, 3)), np.ones((1, 1))]]
            ).tolist()

    folder = make_sample(edit=without_positions)
    message = refusal(folder)
    assert "All 3 cameras stand at one point (0, 0, 0)" in message
    assert "Export their positions too" in message


def test_poses_written_the_wrong_way_round_are_noticed(make_sample: MakeCapture) -> None:
    def invert(document: dict[str, Any]) -> None:
        for row in document["cameras"]:
            row["world_to_camera"] = np.linalg.inv(np.array(row["world_to_camera"])).tolist()
            row["world_to_camera"][3] = [0.0, 0.0, 0.0, 1.0]

    folder = make_sample(n_cameras=6, edit=invert)
    assert "look like camera-to-world maps" in " ".join(open_capture(folder).warnings)


def test_so_are_those_of_rigs_whose_world_has_another_axis_up(make_sample: MakeCapture) -> None:
    def invert(document: dict[str, Any]) -> None:
        for row in document["cameras"]:
            turned = np.array(row["world_to_camera"]) @ np.array(
                [[0, 0, 1, 0], [1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1]]
            )
            row["world_to_camera"] = np.linalg.inv(turned).tolist()
            row["world_to_camera"][3] = [0.0, 0.0, 0.0, 1.0]

    folder = make_sample(n_cameras=6, edit=invert)
    assert "look like camera-to-world maps" in " ".join(open_capture(folder).warnings)


def test_right_rigs_do_not_look_wrong(make_sample: MakeCapture, make_panoptic: MakeCapture) -> None:
    assert open_capture(make_sample(n_cameras=6)).warnings == ()
    assert open_capture(make_panoptic()).warnings == ()


def test_what_is_missing_or_disagrees_about_time_is_said(make_sample: MakeCapture) -> None:
    def edit(document: dict[str, Any]) -> None:
        del document["n_frames"]
        document["fps"] = 25

    warnings = open_capture(make_sample(edit=edit)).warnings
    assert "does not state n_frames; the 6 frames of the videos are taken" in warnings[0]
    assert "fps is 25, but these videos state another rate: cam00 30" in warnings[1]


def test_an_exif_rotation_is_said(make_panoptic: MakeCapture, pictures: Callable[..., np.ndarray]) -> None:
    folder = make_panoptic()
    exif = Image.Exif()
    exif[0x0112] = 3
    Image.fromarray(pictures(1, 0)).save(folder / "ims/1/000000.jpg", exif=exif)
    warnings = describe(open_capture(folder))["warnings"]
    assert any("EXIF entry that turns them" in warning and "ims/1/000000.jpg" in warning for warning in warnings)
    exif[0x0112] = 6
    Image.fromarray(pictures(1, 0).transpose(1, 0, 2)).save(folder / "ims/1/000000.jpg", exif=exif)
    message = refusal(folder)
    assert "32x48 frames, its calibration is for 48x32. An EXIF entry turns them" in message


@pytest.mark.slow
def test_a_long_list_of_missing_frames_is_one_sentence(make_panoptic: MakeCapture) -> None:
    def edit(documents: dict[str, dict[str, Any]]) -> None:
        for document in documents.values():
            for key in ("k", "w2c", "cam_id"):
                document[key] = document[key][:1] * 2000
            ids = document["cam_id"][0]
            document["fn"] = [[f"{i}/{t:06d}.jpg" for i in ids] for t in range(2000)]

    folder = make_panoptic(n_frames=2, edit=edit)
    capture = open_capture(folder)
    assert capture.n_frames == 2
    assert "lists 2000 frames, the first 2 are there" in capture.warnings[0]


def test_a_folder_of_another_kind_is_described(tmp_path: Path) -> None:
    for name in ("a.mp4", "b.MP4", "settings.toml", "notes.bin"):
        (tmp_path / name).touch()
    (tmp_path / "images").mkdir()
    message = refusal(tmp_path)
    assert "In it: 2 videos, 1 TOML file, 1 other file and 1 folder." in message
    assert "clipgstream calibrate" in message
    assert "sample layout" not in message


def test_a_description_is_json_whatever_the_names(make_sample: MakeCapture) -> None:
    folder = make_sample(edit=lambda d: camera(d, 1).update(name="Süd ##1"))
    text = json.dumps(describe(open_capture(folder)), allow_nan=False)
    assert json.loads(text)["cameras"][1]["name"] == "Süd ##1"
