"""Camera paths of a document: found by name, and refused where they could not be told apart."""

from pathlib import Path

import numpy as np
import pytest

from app.document.camera_paths import camera_path_named, check_paths, stored_path, to_path
from app.lab.synthetic.rigs import make_rig
from engine.camera.camera_path import CameraPath
from engine.camera.path_presets import fly_through, turntable
from engine.errors import ProjectError

TURN = turntable(np.zeros(3), np.array([0.0, 0.0, 1.0]), 2.0, 0.3, (0, 29), name='<b>100 %s ##1\n"é"</b>')
FLIGHT = fly_through(make_rig(5, (80, 60)), (0.5, 29))
EMPTY = CameraPath("empty")


def same(one: CameraPath, other: CameraPath) -> bool:
    return (one.name, one.is_closed, len(one.keys)) == (other.name, other.is_closed, len(other.keys)) and all(
        a.frame == b.frame and a.fov_y_rad == b.fov_y_rad and np.array_equal(a.world_to_camera, b.world_to_camera)
        for a, b in zip(one.keys, other.keys, strict=True)
    )


def test_what_is_stored_comes_back_to_the_last_digit():
    read = [to_path(path) for path in map(stored_path, [TURN, FLIGHT, EMPTY])]
    assert all(same(one, other) for one, other in zip(read, (TURN, FLIGHT, EMPTY), strict=True))


def test_a_path_is_found_by_its_name_and_what_is_missing_is_said():
    with pytest.raises(ProjectError, match="no camera paths; make one in the window"):
        camera_path_named((), "a", Path("p"))
    paths = [TURN, FLIGHT, EMPTY]
    assert camera_path_named(paths, TURN.name, Path("p")) is TURN
    with pytest.raises(ProjectError, match="Fly-through"):
        camera_path_named(paths, "fly-through", Path("p"))
    with pytest.raises(ProjectError, match="has no keys"):
        camera_path_named(paths, "empty", Path("p"))


@pytest.mark.parametrize(
    ("paths", "expected"),
    [
        ((TURN, TURN), "two camera paths"),
        ((CameraPath("x" * 500),), "500 characters"),
        ((CameraPath("\ud800"),), "not Unicode"),
        (tuple(CameraPath(str(i)) for i in range(1001)), "1001 camera paths"),
    ],
)
def test_what_could_not_be_told_apart_is_refused(paths, expected):
    with pytest.raises(ProjectError, match=expected):
        check_paths(paths)
