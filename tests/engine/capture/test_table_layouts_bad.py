"""Damaged and odd captures of every layout with a table: one message, what is wrong and where, and nothing else."""

from __future__ import annotations

import json
import os
import re
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from engine.capture.capture import open_capture
from engine.errors import CaptureError
from tests.engine.capture.layouts import written_easyvolcap, written_toml, written_transforms
from tests.engine.capture.layouts.scene import check_reads_as, make_scene
from tests.engine.capture.layouts.tables import TABLES

KINDS = {
    "easyvolcap": ("easyvolcap-opencv5", "intri.yml"),
    "toml": ("anipose-opencv5", "Calib_scene.toml"),
    "transforms": ("transforms-opencv4", "transforms.json"),
    "immersive": ("immersive", "models.json"),
    "panoptic_studio": ("panoptic_studio-opencv5", "calibration_160906_pizza1.json"),
    "technicolor": ("technicolor", "cameras_parameters.txt"),
}
"""One layout of each reader, and the file with its cameras."""


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One capture of each reader, for copying."""
    folder = tmp_path_factory.mktemp("written")
    for kind, (layout, _) in KINDS.items():
        TABLES[layout](folder / kind)
    return folder


@pytest.fixture(params=KINDS)
def capture(request: pytest.FixtureRequest, written: Path, tmp_path: Path) -> tuple[Path, Path]:
    """A capture and the file with its cameras, one after the other of each reader."""
    shutil.copytree(written / request.param, tmp_path / "capture")
    return tmp_path / "capture", tmp_path / "capture" / KINDS[request.param][1]


def fault(folder: Path) -> CaptureError:
    with pytest.raises(CaptureError) as caught:
        open_capture(folder)
    assert "Traceback" not in str(caught.value)
    return caught.value


def kind_of(capture: tuple[Path, Path]) -> str:
    return next(kind for kind, (_, name) in KINDS.items() if name == capture[1].name)


def frame_files(folder: Path) -> list[Path]:
    found = [path for path in folder.rglob("*") if path.suffix in (".png", ".mp4")]
    return sorted(found)


def test_an_empty_table_is_said(capture: tuple[Path, Path]) -> None:
    capture[1].write_bytes(b"")
    assert str(fault(capture[0]))


@pytest.mark.parametrize("share", [0.3, 0.7])
def test_a_truncated_table_is_said(capture: tuple[Path, Path], share: float) -> None:
    data = capture[1].read_bytes()
    capture[1].write_bytes(data[: int(len(data) * share)])
    error = fault(capture[0])
    assert str(capture[0]) in str(error)


@pytest.mark.parametrize("content", [b"\xff\xfe\x00\x01", b"\x89PNG\r\n\x1a\n" + bytes(100), b"null\n"])
def test_a_table_of_another_kind_is_said(capture: tuple[Path, Path], content: bytes) -> None:
    capture[1].write_bytes(content)
    assert str(fault(capture[0]))


def test_numbers_that_are_none_name_their_cameras(capture: tuple[Path, Path]) -> None:
    """The first number of a rotation, in whatever the file calls it, in every camera: each is named."""
    folder, path = capture
    path = folder / "extri.yml" if path.name == "intri.yml" else path
    text = path.read_text()
    bad = ".nan" if path.suffix == ".yml" else "nan" if path.suffix in (".toml", ".txt") else "NaN"
    if path.suffix == ".txt":
        rows = text.splitlines()
        text = "\n".join([rows[0], *(" ".join([*row.split()[:-1], bad]) for row in rows[1:])])
    else:
        key = {"extri.yml": r"T_\w+:.*\s+rows.*\s+cols.*\s+dt.*\s+data: \[", "models.json": r'"position": \['}.get(
            path.name,
            {".toml": r"\ntranslation = \["}.get(
                path.suffix, r'"t": \[\[' if "calib" in path.name else r'"transform_matrix": \[\['
            ),
        )
        text = re.sub(rf"({key})[-0-9.e]+", rf"\g<1>{bad}", text)
    path.write_text(text)
    error = fault(folder)
    assert len(error.problems) >= 3
    assert sum("NaN" in str(problem) for problem in error.problems) >= 3


def test_frames_that_are_missing_name_their_camera(capture: tuple[Path, Path]) -> None:
    files = frame_files(capture[0])
    camera = files[0].parent if files[0].suffix == ".png" and files[0].parent != capture[0] else None
    for path in files if camera is None and files[0].suffix == ".png" else files[:1]:
        if camera is None and path.suffix == ".png" and not path.stem.endswith("_00"):
            continue
        path.unlink()
    if camera is not None:
        shutil.rmtree(camera)
    if KINDS[kind_of(capture)][0].startswith(("panoptic_studio", "technicolor")):  # cameras may be left out there
        assert any("left out" in warning for warning in open_capture(capture[0]).warnings)
    else:
        assert "cam" in str(fault(capture[0]))


def test_frames_of_another_kind_and_empty_ones_are_said(capture: tuple[Path, Path]) -> None:
    files = frame_files(capture[0])
    files[0].write_bytes(b"")
    files[-1].write_text("not a picture")
    error = fault(capture[0])
    assert len(error.problems) == 2
    assert "empty" in str(error)


def test_links_to_themselves_and_out_of_the_folder_are_said(capture: tuple[Path, Path], tmp_path: Path) -> None:
    files = frame_files(capture[0])
    files[0].unlink()
    files[0].symlink_to(files[0])
    (tmp_path / "elsewhere").write_bytes(files[-1].read_bytes())
    files[-1].unlink()
    files[-1].symlink_to(tmp_path / "elsewhere")
    assert "leads out of the capture folder" in str(fault(capture[0]))
    capture[1].unlink()
    capture[1].symlink_to(capture[1])
    assert str(fault(capture[0]))


def test_a_read_only_capture_opens(capture: tuple[Path, Path]) -> None:
    places = [capture[0], *capture[0].rglob("*")]
    for path in places:
        path.chmod(0o555 if path.is_dir() else 0o444)
    try:
        assert len(open_capture(capture[0]).rig) >= 3
    finally:
        for path in places:
            path.chmod(0o755 if path.is_dir() else 0o644)


def test_a_table_that_may_not_be_read_is_said(capture: tuple[Path, Path]) -> None:
    if os.geteuid() == 0:
        pytest.skip("root may read everything")
    capture[1].chmod(0)
    assert "cannot be read" in str(fault(capture[0]))


@pytest.mark.parametrize(
    "names", [("kamera 1", "kamera 2", "kamera 3"), ("a.b", "a.c", "b.c"), ("Küche", "сад", "廊下")]
)
@pytest.mark.parametrize("write", [written_easyvolcap.write, written_toml.write, written_transforms.write])
def test_names_with_spaces_dots_and_other_scripts(
    tmp_path: Path, write: Callable[..., None], names: tuple[str, ...]
) -> None:
    scene = make_scene(lens="opencv5", names=names)
    write(tmp_path / "my capture.é", scene)
    check_reads_as(tmp_path / "my capture.é", scene)


@pytest.mark.parametrize(
    ("kind", "edit", "said"),
    [
        ("easyvolcap", lambda t: t.replace("names:", "nombres:", 1), "lists no names"),
        ("easyvolcap", lambda t: t.replace("K_cam2", "K_cam3"), "'K_cam2'"),
        ("easyvolcap", lambda t: t.replace('"cam2"', '"cam1"'), '2 cameras are called "cam1"'),
        (
            "easyvolcap",
            lambda t: t.replace("K_cam2: !!opencv-matrix", "K_cam2: &a !!opencv-matrix"),
            "which is not supported",
        ),
        ("easyvolcap", lambda t: t.replace("cols: 3", "cols: 4"), "not '3' x '4'"),
        ("easyvolcap", lambda t: t.replace("W_cam2: 48", "W_cam2: 480"), "its calibration is for 480x32"),
        ("easyvolcap", lambda t: t.replace("W_cam2: 48", "W_cam2: 1e400"), "W_cam2"),
        ("easyvolcap", lambda t: t.replace("\r\n", "\r\n\t"), "tabs"),
        ("easyvolcap", lambda t: re.sub(r"(D_\w+:[^[]*\[)[^,]*", r"\g<1>1e300", t), "folds back on itself"),
        ("immersive", lambda t: re.sub(r'("orientation": \[)[^,]*', r"\g<1>1e300", t), "NaN or infinity in its pose"),
        ("immersive", lambda t: re.sub(r'("position": \[)[^,]*', r"\g<1>1e300", t), "at most 1e+09 is read"),
        ("toml", lambda t: t.replace('"cam2"', f'"cam{"2" * 90}"'), "called 'cam222"),
        ("transforms", lambda t: t.replace("images/cam2/000001", f"images/cam2/{'1' * 5000}"), "is not a file name"),
        ("toml", lambda t: t.replace("matrix = [[", "matrix = [[0.0, "), "no matrix of 3x3 numbers"),
        ("toml", lambda t: re.sub(r"distortions = \[", "distortions = [1.0, ", t), "6 parameters, not"),
        ("toml", lambda t: t.replace("size = [48, 32]", "size = [48]"), "size"),
        ("toml", lambda t: t.replace("cam2", "cam7"), "called 'cam7'"),
        ("toml", lambda t: t.replace('name = "cam2"', 'name = "cam1"'), "2 cameras are called"),
        ("transforms", lambda t: t.replace('"time": 0.0', '"time": 1.0'), "4 pictures at 3 times"),
        ("transforms", lambda t: t.replace('"OPENCV"', '"EQUIRECTANGULAR"'), "EQUIRECTANGULAR"),
        ("transforms", lambda t: t.replace('"fl_x"', '"focal"'), "camera_angle_x is missing"),
        ("transforms", lambda t: t.replace('"k2"', '"k4"'), "which only OPENCV_FISHEYE has"),
        ("transforms", lambda t: t.replace("images/cam2/000001", "../cam2/000001"), "not inside its folder"),
        ("immersive", lambda t: t.replace('"fisheye"', '"spherical"'), "spherical"),
        ("immersive", lambda t: t.replace('"focal_length"', '"f"'), "no focal_length"),
        ("immersive", lambda t: t.replace('"name": "camera_0002"', '"name": "camera_0001"'), "2 cameras are called"),
        ("panoptic_studio", lambda t: t.replace('"hd"', '"vga"'), "None of the 0 HD cameras"),
        ("panoptic_studio", lambda t: t.replace('"distCoef"', '"dist"'), "no distCoef"),
        ("technicolor", lambda t: "\n".join(t.splitlines()[:3]), "but there are also pictures of 02, 03"),
        ("technicolor", lambda t: t.replace(" 0 ", " 0 0 0 ", 1), "of distorted pictures"),
    ],
)
def test_what_is_wrong_is_said(written: Path, tmp_path: Path, kind: str, edit: Callable[[str], str], said: str) -> None:
    shutil.copytree(written / kind, tmp_path / "capture")
    path = tmp_path / "capture" / KINDS[kind][1]
    text = path.read_bytes().decode()
    assert edit(text) != text
    path.write_bytes(edit(text).encode())
    assert said in str(fault(tmp_path / "capture"))


def test_a_left_handed_and_a_scaled_rotation_are_said(written: Path, tmp_path: Path) -> None:
    shutil.copytree(written / "transforms", tmp_path / "capture")
    path = tmp_path / "capture" / "transforms.json"
    document = json.loads(path.read_text())
    for row, frame in enumerate(document["frames"]):
        for column in range(3):
            frame["transform_matrix"][column][2] *= -1 if row < 4 else 1.1 if row < 8 else 1
    path.write_text(json.dumps(document))
    error = fault(tmp_path / "capture")
    assert len(error.problems) == 2
    assert "the determinant is -1" in str(error)


def test_all_problems_of_a_capture_come_at_once(written: Path, tmp_path: Path) -> None:
    shutil.copytree(written / "easyvolcap", tmp_path / "capture")
    path = tmp_path / "capture" / "intri.yml"
    path.write_text(path.read_text().replace("K_cam1:", "K_x:").replace("D_cam2:", "D_cam2: 5\nD_x:"))
    (tmp_path / "capture" / "images" / "cam10").rename(tmp_path / "capture" / "images" / "elsewhere")
    extri = tmp_path / "capture" / "extri.yml"
    extri.write_text(extri.read_text().replace("T_cam11:", "T_x:"))
    error = fault(tmp_path / "capture")
    assert [name for name in ("cam1", "cam2", "cam10", "cam11") if f'Camera "{name}"' in str(error)] == [
        "cam1",
        "cam2",
        "cam10",
        "cam11",
    ]


@pytest.mark.parametrize(
    "line",
    [
        ".".join("a" for _ in range(90_000)) + " = 1",
        f"[{'.'.join('a' for _ in range(95_000))}]",
        ".".join("1" for _ in range(90_000)) + " = 1",
        " . ".join('"a"' for _ in range(60_000)) + " = 1",
        f"a = {{{'.'.join('a' for _ in range(90_000))} = 1}}",
        "1.1 . " * 30_000 + "a = 1",
        "\n".join(f"[a{row}.{'.'.join('a' * 50)}]" for row in range(8_000)),
    ],
)
def test_names_of_many_parts_are_refused_before_they_are_parsed(
    tmp_path: Path, line: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Python's parser would take minutes; the file only has to lie there."""
    parsed: list[int] = []
    monkeypatch.setattr("tomllib.loads", lambda text: parsed.append(len(text)) or {})
    (tmp_path / "extra.toml").write_text(f"{line}\n")
    with pytest.raises(CaptureError) as caught:
        open_capture(tmp_path)
    assert "names of too many parts" in str(caught.value)
    assert not parsed


def test_long_lists_of_numbers_are_no_names(tmp_path: Path) -> None:
    scene = make_scene(lens="opencv5")
    written_toml.write(tmp_path, scene, has_times=False)
    path = tmp_path / "Calib_scene.toml"
    path.write_text(path.read_text() + f"\n[points]\nxyz = {[[0.5, -1.25, 1e-3, -2.5e10]] * 500}\n")
    assert open_capture(tmp_path).rig.names == scene.names


def test_cameras_without_a_pose_are_left_out(tmp_path: Path) -> None:
    """EasyMocap keeps intrinsics of a whole stage, of which some cameras were used."""
    scene = make_scene(lens="opencv5")
    written_easyvolcap.write(tmp_path, scene)
    path = tmp_path / "intri.yml"
    more = "".join(f'  - "stage{row}"\n' for row in range(20))
    path.write_text(path.read_text().replace("names:\n", f"names:\n{more}", 1))
    capture = check_reads_as(tmp_path, scene)
    assert capture.warnings[0] == (
        "Cameras of which extri.yml has no pose are left out: 'stage0', 'stage1', 'stage2' and 17 more."
    )
