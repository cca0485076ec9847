"""camera_paths.json: what is written comes back, and what is damaged is said and costs nothing else."""

from __future__ import annotations

import json

import numpy as np
import pytest

from app.document.camera_paths import (
    CAMERA_PATHS_FILE,
    MAX_NAME_CHARACTERS,
    camera_path_named,
    read_camera_paths,
    write_camera_paths,
)
from engine.camera.camera_path import CameraPath
from engine.camera.path_presets import fly_through, turntable
from engine.errors import ProjectError
from engine.synthetic.rigs import make_rig

TURN = turntable(np.zeros(3), np.array([0.0, 0.0, 1.0]), 2.0, 0.3, (0, 29), name='<b>100 %s ##1\n"é"</b>')
FLIGHT = fly_through(make_rig(5, (80, 60)), (0.5, 29))
EMPTY = CameraPath("empty")


def same(one: CameraPath, other: CameraPath) -> bool:
    return (one.name, one.is_closed, len(one.keys)) == (other.name, other.is_closed, len(other.keys)) and all(
        a.frame == b.frame and a.fov_y_rad == b.fov_y_rad and np.array_equal(a.world_to_camera, b.world_to_camera)
        for a, b in zip(one.keys, other.keys, strict=True)
    )


def test_what_is_written_comes_back_to_the_last_digit(tmp_path):
    assert read_camera_paths(tmp_path) == ()
    write_camera_paths(tmp_path, [TURN, FLIGHT, EMPTY])
    read = read_camera_paths(tmp_path)
    assert all(same(one, other) for one, other in zip(read, (TURN, FLIGHT, EMPTY), strict=True))
    assert [path.name for path in tmp_path.iterdir()] == [CAMERA_PATHS_FILE], "something half-written was left"


def test_a_path_is_found_by_its_name_and_what_is_missing_is_said(tmp_path):
    with pytest.raises(ProjectError, match="no camera paths; make one in the window"):
        camera_path_named(tmp_path, "a")
    write_camera_paths(tmp_path, [TURN, FLIGHT, EMPTY])
    assert same(camera_path_named(tmp_path, TURN.name), TURN)
    with pytest.raises(ProjectError, match="Fly-through"):
        camera_path_named(tmp_path, "fly-through")
    with pytest.raises(ProjectError, match="has no keys"):
        camera_path_named(tmp_path, "empty")


def _at(document, place):
    for step in place[:-1]:
        document = document[step]
    return document


@pytest.mark.parametrize(
    ("place", "value", "expected"),
    [
        (("schema",), 2, "schema 2"),
        (("schema",), True, "schema True"),
        (("colour",), 1, "'colour', which is not known"),
        (("paths",), {}, "not a list"),
        (("paths", 0, "name"), "", "name"),
        (("paths", 0, "name"), "   ", "no name"),
        (("paths", 0, "name"), "x" * (MAX_NAME_CHARACTERS + 1), "name"),
        (("paths", 1, "name"), TURN.name, "two camera paths called"),
        (("paths", 0, "speed"), 3, "speed"),
        (("paths", 0, "is_closed"), 1, "not true or false"),
        (("paths", 0, "keys", 0, "frame"), "0", "not a number"),
        (("paths", 0, "keys", 0, "frame"), 1e12, "the frame of a key"),
        (("paths", 0, "keys", 0, "frame"), 29.0, "not in order"),
        (("paths", 0, "keys", 0, "fov_y_rad"), -0.1, "field of view"),
        (("paths", 0, "keys", 0, "world_to_camera", 0, 0), 2.0, "rotation"),
        (("paths", 0, "keys", 0, "world_to_camera", 0), [1, 0, 0], "world_to_camera"),
        (("paths", 0, "keys", 0, "world_to_camera"), [], "world_to_camera"),
    ],
)
def test_an_entry_that_makes_no_sense_is_named(tmp_path, place, value, expected):
    write_camera_paths(tmp_path, [TURN, FLIGHT])
    path = tmp_path / CAMERA_PATHS_FILE
    document = json.loads(path.read_text())
    del document["checksum"]  # as who edits it by hand does
    _at(document, place)[place[-1]] = value
    path.write_text(json.dumps(document))
    with pytest.raises(ProjectError) as raised:
        read_camera_paths(tmp_path)
    assert expected in str(raised.value)
    assert raised.value.path == path
    assert raised.value.hint


@pytest.mark.parametrize("n_bytes", [0, 1, 100, -2])
def test_a_file_that_was_cut_off_is_damaged(tmp_path, n_bytes):
    write_camera_paths(tmp_path, [TURN])
    path = tmp_path / CAMERA_PATHS_FILE
    path.write_bytes(path.read_bytes()[:n_bytes])
    with pytest.raises(ProjectError, match="cannot be read"):
        read_camera_paths(tmp_path)


def test_a_changed_digit_is_noticed(tmp_path):
    write_camera_paths(tmp_path, [FLIGHT])
    path = tmp_path / CAMERA_PATHS_FILE
    text = path.read_text()
    path.write_text(text.replace('"frame": 0.5', '"frame": 0.6'))
    with pytest.raises(ProjectError, match="checksum"):
        read_camera_paths(tmp_path)


@pytest.mark.parametrize(
    ("paths", "expected"),
    [
        ((TURN, TURN), "two camera paths"),
        ((CameraPath("x" * 500),), "500 characters"),
        ((CameraPath("\ud800"),), "not Unicode"),
        (tuple(CameraPath(str(i)) for i in range(1001)), "1001 camera paths"),
    ],
)
def test_what_could_not_be_read_again_is_not_written(tmp_path, paths, expected):
    write_camera_paths(tmp_path, [FLIGHT])
    with pytest.raises(ProjectError, match=expected):
        write_camera_paths(tmp_path, paths)
    assert same(read_camera_paths(tmp_path)[0], FLIGHT)
