"""Opening scenes of other programs, and refusing in words what is none."""

from __future__ import annotations

import gzip
import os
import struct
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from engine.capture.formats.imported import ScenePlace
from engine.errors import ProjectError
from engine.export.formats.ply import COLUMNS
from engine.export.formats.table import FORMATS, FULL_PLY
from engine.export.sequences.sequence import MovingSplats, SequenceStretch, SequenceTiming
from engine.export.sequences.table import SEQUENCES
from engine.export.splats import Splats
from engine.importing.scene_source import is_scene, open_scene
from engine.importing.suffixes import SEQUENCE_SUFFIXES
from tests.engine.export.scenes import chance_splats, order_of
from tests.engine.importing.frames import moving_frames


def write_frames(folder: Path, kind: str, frames: list[Splats], *, numbers: range | None = None) -> Path:
    folder.mkdir(exist_ok=True)
    for number, splats in zip(numbers or range(len(frames)), frames, strict=True):
        with (folder / f"frame_{number}{FORMATS[kind].suffix}").open("wb") as file:
            FORMATS[kind].write(splats, file)
    return folder


def refused(path: Path) -> str:
    with pytest.raises(ProjectError) as error:
        open_scene(path).splats(0)
    return str(error.value)


@pytest.mark.parametrize("kind", ["ply", "compressed-ply", "spz", "splat", "sog"])
def test_a_folder_of_files_is_read_in_natural_order(tmp_path: Path, kind: str):
    frames = moving_frames(11)
    (tmp_path / "scene").mkdir()
    (tmp_path / "scene" / "notes.txt").write_text("not a frame")
    folder = write_frames(tmp_path / "scene", kind, frames)
    assert is_scene(folder)
    scene = open_scene(folder)
    assert (scene.n_frames, scene.notes) == (11, ())
    for frame in (2, 10):
        found, splats = scene.splats(frame), frames[frame]
        np.testing.assert_allclose(found.means, splats.means[order_of(found, splats)], atol=0.01)


def test_a_file_of_another_program_is_read_whatever_its_columns(tmp_path: Path):
    splats = chance_splats(7)
    path = tmp_path / "point_cloud.ply"
    with path.open("wb") as file:
        FULL_PLY.write(splats, file)
    assert open_scene(path).notes == ()
    names = ["opacity", *(name for name in COLUMNS if name != "opacity"), *(f"f_rest_{i}" for i in range(9)), "red"]
    kinds = [(name, "u1" if name == "red" else "<f8" if name == "x" else "<f4") for name in names]
    rows = np.zeros(7, kinds)
    with path.open("rb") as file:
        known = FORMATS["ply"].read(file)
    rows["x"], rows["y"], rows["z"] = known.means.T
    for i in range(3):
        rows[f"f_dc_{i}"], rows[f"scale_{i}"] = known.f_dc[:, i], np.log(known.scales[:, i])
    for i in range(4):
        rows[f"rot_{i}"] = known.quats[:, i]
    rows["opacity"], rows["f_rest_3"] = known.opacity_logits, 0.5
    types = {"u1": "uchar", "<f8": "double", "<f4": "float"}
    lines = ["ply", "format binary_little_endian 1.0", "obj_info made elsewhere", "element vertex 7"]
    lines += [f"property {types[kind]} {name}" for name, kind in kinds]
    path.write_bytes("\r\n".join([*lines, "end_header", ""]).encode() + rows.tobytes())
    scene = open_scene(path)
    np.testing.assert_array_equal(scene.splats(0).means, known.means)
    assert "degree 1" in scene.notes[0]


def test_an_older_spz_file_is_read(tmp_path: Path):
    head = struct.pack("<IIIBBBB", 0x5053474E, 2, 1, 1, 12, 0, 0)
    position = np.array([4096, -8192, 0], "<i4").view(np.uint8).reshape(3, 4)[:, :3].tobytes()
    planes = position + bytes([255]) + bytes([128] * 3) + bytes([160] * 3) + bytes([255, 127, 127]) + bytes(27)
    path = tmp_path / "a.spz"
    path.write_bytes(gzip.compress(head + planes))
    scene = open_scene(path)
    splats = scene.splats(0)
    np.testing.assert_allclose(splats.means, [[1.0, -2.0, 0.0]])
    np.testing.assert_allclose(splats.quats, [[0.0, 1.0, 0.0, 0.0]], atol=0.01)
    np.testing.assert_allclose(splats.scales, 1.0)
    assert "degree 1" in scene.notes[0]


def test_an_export_of_our_own_says_rate_and_up(tmp_path: Path):
    folder = write_frames(tmp_path / "s", "ply", moving_frames(2))
    (folder / "p_export.json").write_text('{"fps": 24, "up": [0, 0, 1], "files": [{"part": "all"}]}')
    scene = open_scene(folder)
    assert (scene.fps, scene.up) == (24.0, (0.0, 0.0, 1.0))
    (folder / "p_export.json").write_text('{"fps": 24, "up": [0, 0, 1], "files": [{"part": "moving"}]}')
    assert "parts of a scene" in refused(folder)
    (folder / "p_export.json").write_text('{"fps": "x"}')
    assert "description of the export is damaged" in refused(folder)


@pytest.mark.parametrize(
    ("quat", "scale", "cause"),
    [("[2, 0, 0, 0]", "1", "length 2"), ("[1, 0, 0]", "1", "quat"), ("[1, 0, 0, 0]", "0", "scale is 0")],
)
def test_a_place_that_is_not_possible_is_refused(tmp_path: Path, quat: str, scale: str, cause: str):
    folder = write_frames(tmp_path / "s", "ply", moving_frames(2))
    said = '{"fps": 24, "up": [0, 0, 1], "files": [{"part": "all"}], '
    (folder / "p_export.json").write_text(f'{said}"quat": [1, 0, 0, 0], "scale": 2}}')
    assert open_scene(folder).place == ScenePlace((1.0, 0.0, 0.0, 0.0), 2.0)
    (folder / "p_export.json").write_text(f'{said}"quat": {quat}, "scale": {scale}}}')
    assert cause in refused(folder)


def test_missing_numbers_are_said(tmp_path: Path):
    folder = write_frames(tmp_path / "s", "ply", moving_frames(4), numbers=range(0, 8, 2))
    assert "(1, 3, 5)" in open_scene(folder).notes[0]


def test_an_export_of_every_so_many_frames_plays_as_fast_as_it_was(tmp_path: Path):
    folder = write_frames(tmp_path / "s", "ply", moving_frames(3), numbers=range(3, 9, 2))
    (folder / "p_export.json").write_text('{"fps": 24, "up": [0, 0, 1], "files": [{"part": "all"}]}')
    assert (open_scene(folder).fps, open_scene(folder).notes) == (12.0, ())
    write_frames(folder, "ply", moving_frames(1), numbers=range(8, 9))
    assert open_scene(folder).fps == 24.0
    assert "(4, 6)" in open_scene(folder).notes[0]


def test_what_is_no_scene_is_refused_in_words(tmp_path: Path):
    empty = tmp_path / "empty"
    empty.mkdir()
    assert "No frame" in refused(empty)
    assert not is_scene(empty)
    assert "no such file" in refused(tmp_path / "none")
    other = tmp_path / "a.txt"
    other.write_text("")
    assert "not a scene" in refused(other)
    for suffix in (".usda", ".usdc"):  # it may name any other file
        other = other.with_suffix(suffix)
        other.write_text("#usda 1.0")
        assert "not a scene" in refused(other)
    mixed = write_frames(write_frames(tmp_path / "mixed", "ply", moving_frames(2)), "spz", moving_frames(1))
    assert "2 .ply and 1 .spz" in refused(mixed)


def test_damaged_frames_are_refused_and_named(tmp_path: Path):
    folder = write_frames(tmp_path / "s", "ply", moving_frames(1))
    (path,) = folder.iterdir()
    whole = path.read_bytes()
    path.write_bytes(whole[:-5])
    assert "ends too early" in refused(folder)
    assert str(path) in refused(folder)
    path.write_bytes(whole.replace(b"vertex 60", b"vertex 900000000000000000"))  # no memory is taken for it
    assert "ends too early" in refused(folder)
    path.write_bytes(whole.replace(b"little", b"big"))
    assert "binary_big_endian" in refused(folder)
    path.write_bytes(whole.replace(b"rot_3", b"other"))
    assert "no column rot_3" in refused(folder)
    path.write_bytes(whole.replace(b"property float x\n", b"property float x\n" * 2))  # rows would be shorter
    assert "head is not complete" in refused(folder)
    path.write_bytes(b"ply\n")
    assert "head is not complete" in refused(folder)


def test_a_compressed_frame_that_announces_too_much_takes_no_memory(tmp_path: Path):
    folder = write_frames(tmp_path / "s", "compressed-ply", moving_frames(1))
    (path,) = folder.iterdir()
    data = path.read_bytes().replace(b"element chunk 1\n", b"element chunk 9999999999999\n")
    path.write_bytes(data.replace(b"element vertex 60\n", b"element vertex 2559999999999744\n"))
    assert "ends too early" in refused(folder)


@pytest.mark.parametrize(
    "document",
    ['{"count": 1e999}', "[" * 100_000, '{"count": 60, "shN": [1]}', '{"count": 1}' + " " * (5 << 20)],
    ids=["infinite", "deep", "list", "long"],
)
def test_a_hostile_document_of_a_sog_is_refused(tmp_path: Path, document: str):
    folder = write_frames(tmp_path / "s", "sog", moving_frames(1))
    (path,) = folder.iterdir()
    with zipfile.ZipFile(path) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in members.items():
            archive.writestr(name, document if name == "meta.json" else data)
    assert "not a SOG file" in refused(folder)


def test_every_format_over_time_is_known_by_its_name():
    assert {row.suffix for name, row in SEQUENCES.items() if not name.startswith("usd")} == set(SEQUENCE_SUFFIXES)


def test_a_file_over_time_is_read_like_any_scene(tmp_path: Path):
    frames = [replace(splats, up=(0.0, 0.0, 1.0)) for splats in moving_frames(4)]
    path, none, timing = tmp_path / "s.4dgs", chance_splats(0), SequenceTiming(4, 25.0)
    stretch = SequenceStretch(0, 4, none, lambda frame: MovingSplats(frames[frame], np.arange(60)))
    SEQUENCES["4dgs"].write([stretch], timing, path)
    scene = open_scene(path)
    try:
        assert (scene.n_frames, scene.fps, scene.up, scene.notes) == (4, 25.0, (0.0, 0.0, 1.0), ())
        found = scene.splats(3)
        np.testing.assert_allclose(found.means, frames[3].means[order_of(found, frames[3])], atol=0.02)
    finally:
        scene.close()
    path.write_bytes(path.read_bytes()[:200])
    assert "4dgs" in refused(path)


def test_videos_with_points_are_no_scene(tmp_path: Path):
    folder = write_frames(tmp_path / "s", "ply", moving_frames(1))
    assert is_scene(folder)
    (folder / "cam0.mp4").touch()
    assert not is_scene(folder)


def test_links_and_pipes_are_refused(tmp_path: Path):
    elsewhere = write_frames(tmp_path / "elsewhere", "ply", moving_frames(1))
    folder = tmp_path / "s"
    folder.mkdir()
    (folder / "a.ply").symlink_to(elsewhere / "frame_0.ply")
    assert "link that leads out" in refused(folder)
    (folder / "a.ply").unlink()
    os.mkfifo(folder / "a.ply")
    assert "cannot be read" in refused(folder)
