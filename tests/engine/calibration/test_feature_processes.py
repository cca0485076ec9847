"""Key points are the same in a process of its own, and progress moves while it looks."""

from __future__ import annotations

import numpy as np
import pytest

from engine.calibration.matching import feature_processes
from engine.calibration.matching.matching import KeyPoints
from engine.calibration.matching.pictures import CameraPictures, MovingPart
from engine.errors import PreparationError
from engine.features.child import ChildFailed


def pictures() -> CameraPictures:
    rng = np.random.default_rng(4)
    wall = np.kron(rng.uniform(20, 235, (20, 26, 3)), np.ones((8, 8, 1))).astype(np.uint8)
    is_moving = np.zeros((80, 90), dtype=bool)
    is_moving[10:70, 10:70] = True
    part = MovingPart(3, np.ascontiguousarray(wall[20:100, 30:120]), (30, 20), is_moving)
    return CameraPictures(wall, (part,))


@pytest.mark.slow
def test_a_process_finds_key_points_of_background_and_moments() -> None:
    shares: list[float] = []
    found = feature_processes.key_points(pictures(), "cam0", shares.append)
    assert isinstance(found, KeyPoints)
    assert set(found.moments.tolist()) == {0, 3}
    assert found.descriptors.shape == (len(found), 128)
    moving = found.pixels[found.moments == 3]
    assert ((moving >= (38, 28)) & (moving <= (102, 92))).all()
    assert len(shares) >= 2
    assert sum(shares) == pytest.approx(1.0)
    again = feature_processes.key_points(pictures(), "cam0")
    assert np.array_equal(found.pixels, again.pixels)
    assert np.array_equal(found.descriptors, again.descriptors)


def test_a_process_that_fails_names_the_camera(monkeypatch: pytest.MonkeyPatch) -> None:
    def failing(module: str, arrays: object, **others: object) -> dict[str, np.ndarray]:
        raise ChildFailed("the process that finds key points was killed", is_final=False)

    monkeypatch.setattr(feature_processes, "work_on_arrays", failing)
    with pytest.raises(PreparationError, match="Key points of cam0 could not be found: the process"):
        feature_processes.key_points(pictures(), "cam0")
