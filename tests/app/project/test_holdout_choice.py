"""Which cameras are offered to be held out where a capture names none."""

from __future__ import annotations

import numpy as np
import pytest

from engine.camera.rig import CameraRig
from engine.capture.holdout_choice import suggested_holdout
from tests.app.fakes import look_at, ring


def rig_of(poses: list[np.ndarray]) -> CameraRig:
    n = len(poses)
    K = np.array([[30.0, 0.0, 16.0], [0.0, 30.0, 12.0], [0.0, 0.0, 1.0]])
    names = tuple(f"c{row}" for row in range(n))
    return CameraRig(names, np.stack(poses), np.stack([K] * n), np.tile(np.array([[32, 24]]), (n, 1)))


@pytest.mark.slow
@pytest.mark.parametrize(("n_cameras", "n_held_out"), [(2, 0), (5, 0), (6, 1), (12, 1), (13, 2), (36, 3)])
def test_so_many_as_a_rig_can_spare(n_cameras: int, n_held_out: int) -> None:
    found = suggested_holdout(rig_of(ring(n_cameras)))
    assert len(set(found)) == n_held_out


def test_a_camera_in_the_midst_of_others_is_taken_and_none_at_the_edge() -> None:
    up = np.array([0.0, 1.0, 0.0])
    eyes = [np.array([x, y, -4.0]) for y in (-1.0, 0.0, 1.0) for x in (-1.0, 0.0, 1.0)]
    assert suggested_holdout(rig_of([look_at(eye, eye + np.array([0.0, 0.0, 4.0]), up) for eye in eyes])) == ("c4",)


def test_several_stand_apart() -> None:
    found = [int(name[1:]) for name in suggested_holdout(rig_of(ring(36)))]
    gaps = [min((a - b) % 36, (b - a) % 36) for a in found for b in found if a != b]
    assert min(gaps) >= 3


def test_cameras_in_one_place_do_not_matter() -> None:
    poses = [look_at(np.zeros(3), np.array([np.cos(a), np.sin(a), 0.0]), np.array([0.0, 0, 1.0])) for a in range(7)]
    assert len(suggested_holdout(rig_of(poses))) == 1
