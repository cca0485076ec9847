"""Backgrounds that are damaged, or do not fit the cameras, count as missing: they are made again."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from engine.storage.array_files import write_arrays
from engine.training.preparation.cloud_preparation import (
    BACKGROUNDS_FILE,
    Backgrounds,
    read_backgrounds,
    write_backgrounds,
)

KEY: dict[str, Any] = {"capture": "none", "cameras": ["a", "b"], "size": [13, 6], "frames": 5, "is_corrected": True}


def backgrounds() -> Backgrounds:
    rng = np.random.default_rng(3)
    return Backgrounds(rng.integers(0, 255, (2, 6, 13, 3)).astype(np.uint8), rng.random((2, 6, 13)) > 0.5)


def test_backgrounds_come_back_for_their_key_only(tmp_path: Path) -> None:
    write_backgrounds(tmp_path, backgrounds(), KEY)
    found = read_backgrounds(tmp_path, KEY)
    assert found is not None
    assert found.equals(backgrounds())
    assert read_backgrounds(tmp_path, KEY | {"frames": 6}) is None
    assert read_backgrounds(tmp_path / "none", KEY) is None


def test_backgrounds_with_one_changed_bit_are_made_again(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    write_backgrounds(tmp_path, backgrounds(), KEY)
    path = tmp_path / BACKGROUNDS_FILE
    data = bytearray(path.read_bytes())
    data[-1] ^= 1
    path.write_bytes(data)
    assert read_backgrounds(tmp_path, KEY) is None
    assert str(path) in caplog.text


@pytest.mark.parametrize(
    ("images", "packed"),
    [
        (np.zeros((2, 13, 6, 3), np.uint8), np.zeros((2, 13, 1), np.uint8)),  # height and width exchanged
        (np.zeros((3, 6, 13, 3), np.uint8), np.zeros((3, 6, 2), np.uint8)),
        (np.zeros((2, 6, 13), np.uint8), np.zeros((2, 6, 2), np.uint8)),
        (np.zeros((2, 6, 13, 3), np.float32), np.zeros((2, 6, 2), np.uint8)),
        (np.zeros((2, 6, 13, 3), np.uint8), np.zeros((2, 6, 1), np.uint8)),
    ],
)
def test_backgrounds_that_do_not_fit_the_cameras_are_made_again(tmp_path: Path, images, packed) -> None:
    texts = {"key": json.dumps(KEY, sort_keys=True)}
    write_arrays(tmp_path / BACKGROUNDS_FILE, {"images": images, "is_stable": packed}, texts, what="It")
    assert read_backgrounds(tmp_path, KEY) is None
