"""The Blender add-on without Blender: its zip, and its reading of descriptions and files, good ones and bad ones."""

from __future__ import annotations

import importlib
import json
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any
from zipfile import ZipFile

import numpy as np
import pytest

from engine.assets import asset_path
from engine.errors import DiskError, ProjectError
from engine.export.blender_addon import write_addon
from engine.export.formats.table import FORMATS, FULL_PLY
from tests.engine.export.scenes import chance_splats

NAME = "blender_addon_without_bpy"
CAMERA = {
    "name": "cam",
    "image_size": [8, 6],
    "K": [[9.0, 0.0, 4.0], [0.0, 9.0, 3.0], [0.0, 0.0, 1.0]],
    "camera_to_world": np.eye(4)[:3].tolist(),
}
GOOD = {
    "schema": 1,
    "first_frame": 3,
    "last_frame": 9,
    "fps": 29.97,
    "up": [0.0, -1.0, 0.0],
    "meters_per_unit": 0.5,
    "near_plane": 0.1,
    "files": [
        {"file": "p_static.ply", "part": "static", "frame": 3},
        {"file": "p_moving_0006.ply", "part": "moving", "frame": 6},
        {"file": "p_moving_0003.ply", "part": "moving", "frame": 3},
    ],
    "cameras": [CAMERA],
}


@pytest.fixture
def addon() -> Iterator[Any]:
    """Modules of the add-on that need no bpy, by name."""
    package = ModuleType(NAME)
    package.__path__ = [str(asset_path("blender"))]
    sys.modules[NAME] = package

    class Modules:
        def __getattr__(self, name: str) -> ModuleType:
            return importlib.import_module(f"{NAME}.{name}")

    yield Modules()
    for name in [name for name in sys.modules if name.startswith(NAME)]:
        del sys.modules[name]


def described(folder: Path, **changes: Any) -> Path:
    path = folder / "p_export.json"
    path.write_text(json.dumps(GOOD | changes))
    return path


def test_the_same_files_make_the_same_zip(tmp_path: Path):
    first, second = write_addon(tmp_path / "a" / "b"), write_addon(tmp_path)
    assert first.read_bytes() == second.read_bytes()
    with ZipFile(first) as found:
        held = {name: found.read(name) for name in found.namelist()}
    assert held == {path.name: path.read_bytes() for path in asset_path("blender").iterdir() if path.is_file()}
    assert b'license = ["SPDX:MIT"]' in held["blender_manifest.toml"]
    assert all(text.startswith(b"# SPDX-License-Identifier: MIT\n") for name, text in held.items() if ".py" in name)
    with pytest.raises(DiskError):
        write_addon(first)


@pytest.mark.parametrize("is_there", [False, True])
def test_an_installation_without_the_add_on_writes_no_empty_zip(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, is_there: bool
):
    lacking = tmp_path / "blender"
    if is_there:
        lacking.mkdir()
    monkeypatch.setattr("engine.export.blender_addon.asset_path", lambda *_: lacking)
    with pytest.raises(ProjectError, match=r"not in this installation\. Install the program again") as caught:
        write_addon(tmp_path / "out")
    assert not isinstance(caught.value, DiskError)
    assert not (tmp_path / "out").exists()


def test_a_description_becomes_a_sequence(addon: Any, tmp_path: Path):
    found = addon.sidecar.read_sequence(described(tmp_path))
    assert (found.name, found.first_frame, found.last_frame, found.fps) == ("p", 3, 9, 29.97)
    assert (found.up, found.meters_per_unit) == ((0.0, -1.0, 0.0), 0.5)
    shown = [found.file_at("moving", frame).name for frame in (0, 3, 5.99, 6, 20)]
    assert shown == ["p_moving_0003.ply"] * 3 + ["p_moving_0006.ply"] * 2
    assert (found.cameras[0].size, found.cameras[0].K) == ((8, 6), CAMERA["K"])
    earlier = {name: value for name, value in GOOD.items() if name not in ("cameras", "near_plane", "meters_per_unit")}
    (tmp_path / "p_export.json").write_text(json.dumps(earlier))
    found = addon.sidecar.read_sequence(tmp_path / "p_export.json")
    assert (found.cameras, found.meters_per_unit) == ([], None)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"schema": 2}, "newer version of ClipGStream Studio: schema 2"),
        ({"schema": "1"}, "no list of files"),
        ({"files": []}, "has no files"),
        ({"files": 7}, "not the description"),
        ({"files": [{"file": "p.sog", "part": "all", "frame": 0}]}, "not plain PLY files: p.sog"),
        ({"files": [{"file": "p.compressed.ply", "part": "all", "frame": 0}]}, "not plain PLY files"),
        ({"files": [{"file": "../p.ply", "part": "all", "frame": 0}]}, "outside its folder"),
        ({"files": [{"file": "p\0.ply", "part": "all", "frame": 0}]}, "outside its folder"),
        ({"files": [{"file": "p.ply", "part": "some", "frame": 0}]}, "'some' is not known"),
        ({"files": [{"file": "p.ply", "part": "all", "frame": 1 << 80}]}, "not a whole number"),
        ({"files": [{"file": 5, "part": "all", "frame": 0}]}, "not the description"),
        ({"last_frame": 2}, "not a whole number from 3"),
        ({"fps": 0}, "not a number above 0"),
        ({"fps": float("nan")}, "numbers were expected"),
        ({"up": [0, 0, 0]}, "no length"),
        ({"up": "up"}, "numbers were expected"),
        ({"cameras": [CAMERA | {"K": [[1, 2]]}]}, "numbers were expected"),
        ({"cameras": [CAMERA | {"image_size": [0, 6]}]}, "not a whole number"),
        ({"near_plane": None}, "not the description"),
        ({"cameras": [{}]}, "is missing"),
    ],
)
def test_a_bad_description_is_a_problem_in_words(addon: Any, tmp_path: Path, changes: dict, said: str):
    path = described(tmp_path, **changes)
    with pytest.raises(addon.problem.SequenceProblem, match=said) as error:
        addon.sidecar.read_sequence(path)
    assert str(error.value).endswith(str(path))


@pytest.mark.parametrize("content", [b"", b"{", b"[" * 200_000, b"[]", b"\xff\xfe{}", b'{"schema": 1}'])
def test_what_is_not_a_description_is_a_problem_in_words(addon: Any, tmp_path: Path, content: bytes):
    (tmp_path / "p_export.json").write_bytes(content)
    with pytest.raises(addon.problem.SequenceProblem, match="not the description"):
        addon.sidecar.read_sequence(tmp_path / "p_export.json")
    with pytest.raises(addon.problem.SequenceProblem, match=r"cannot be read: No such file.*Relink"):
        addon.sidecar.read_sequence(tmp_path / "gone_export.json")


@pytest.mark.parametrize("kind", [FORMATS["ply"], FULL_PLY])
def test_a_file_becomes_the_gaussians_that_were_written(addon: Any, tmp_path: Path, kind: Any):
    splats = chance_splats(300)
    with (tmp_path / "p.ply").open("wb") as file:
        kind.write(splats, file)
    cloud = addon.ply.read_cloud(tmp_path / "p.ply")
    for name in ("means", "quats", "scales", "opacities", "colors"):
        np.testing.assert_allclose(getattr(cloud, name), getattr(splats, name), atol=1e-5, err_msg=name)
    few = cloud.largest(20)
    rows = [int(np.flatnonzero((cloud.means == mean).all(1))[0]) for mean in few.means]
    sides = np.sort(splats.scales, axis=1)
    covered = splats.opacities * sides[:, 1] * sides[:, 2]
    assert rows == sorted(np.argsort(-covered)[:20].tolist())


def test_bad_files_are_problems_in_words_and_take_no_memory(addon: Any, tmp_path: Path):
    path = tmp_path / "p.ply"
    with path.open("wb") as file:
        FORMATS["ply"].write(chance_splats(9), file)
    good = path.read_bytes()
    for content, said in (
        (b"", "not a PLY file"),
        (good[:-1], "ends too early, after 503 of 504 bytes"),
        (good.replace(b"vertex 9\n", b"vertex 99999999999\n"), "ends too early"),
        (good.replace(b"vertex 9\n", b"vertex -9\n"), "head"),
        (good.replace(b"vertex 9\n", b"vertex 999999999999999999999\n"), "head"),
        (good.replace(b"binary_little", b"binary_big"), "head"),
        (good.replace(b"float opacity", b"float haze"), "head"),
        (b"ply\n" + b"comment \n" * 100_000, "head"),
    ):
        path.write_bytes(content)
        with pytest.raises(addon.problem.SequenceProblem, match=said):
            addon.ply.read_cloud(path)
    path.unlink()
    with pytest.raises(addon.problem.SequenceProblem, match="cannot be read"):
        addon.ply.read_cloud(path)
    with pytest.raises(addon.problem.SequenceProblem, match="cannot be read"):
        addon.clouds.stamp_of(path)


def test_files_are_read_once_and_again_when_they_change_in_bounded_memory(addon: Any, tmp_path: Path):
    paths = [tmp_path / f"{n}.ply" for n in range(4)]
    for n, path in enumerate(paths):
        with path.open("wb") as file:
            FORMATS["ply"].write(chance_splats(100, seed=n), file)
    cache = addon.clouds.CloudCache(2 * 56 * 100)

    def read(path: Path) -> Any:
        return cache.read(path, addon.clouds.stamp_of(path))

    first = read(paths[0])
    assert read(paths[0]) is first
    read(paths[1])
    assert read(paths[0]) is first, "used last"
    read(paths[2])
    assert read(paths[0]) is first
    read(paths[3])
    read(paths[1])
    assert read(paths[0]) is not first, "no room for it any more"
    with paths[0].open("wb") as file:
        FORMATS["ply"].write(chance_splats(50), file)
    assert len(read(paths[0])) == 50
