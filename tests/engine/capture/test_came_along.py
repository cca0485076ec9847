"""Masks and points of a capture as a key: other contents are another key, other times of files are not."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from app.lab.synthetic.writing import write_video
from engine.capture.came_along import came_along
from engine.capture.capture import open_capture
from engine.capture.clip import Clip
from engine.capture.exclusions import ExcludedFrames, Exclusions
from engine.capture.layout.format_result import Layout
from engine.training.config import TrainConfig
from engine.training.preparation.cloud_preparation import key_of_corrected

MakeCapture = Callable[..., Path]
CLIP = Clip(0, 0, 3, 3)


@pytest.fixture
def folder(make_sample: MakeCapture) -> Path:
    folder = make_sample(n_cameras=3, n_frames=7)
    (folder / "masks" / "cam01").mkdir(parents=True)
    for frame in range(7):
        mask = np.full(open_capture(folder).picture_size[::-1], 255 * (frame % 2), np.uint8)
        Image.fromarray(mask).save(folder / "masks" / "cam01" / f"{frame}.png")
    return folder


def layout_of(folder: Path) -> Layout:
    return open_capture(folder).layout


def test_nothing_came_along(make_sample: MakeCapture) -> None:
    assert came_along(layout_of(make_sample(n_cameras=3, n_frames=4))) == {}


def test_another_mask_is_another_key(folder: Path, tmp_path: Path) -> None:
    key = came_along(layout_of(folder))
    assert list(key["masks"]) == ["cam01"]
    copied = tmp_path / "copied"
    shutil.copytree(folder, copied)
    os.utime(copied / "masks" / "cam01" / "0.png", (5, 5))
    assert came_along(layout_of(copied)) == key
    size = open_capture(folder).picture_size
    Image.new("L", size, 77).save(copied / "masks" / "cam01" / "6.png")
    assert came_along(layout_of(copied)) != key
    shutil.rmtree(copied / "masks")
    assert came_along(layout_of(copied)) == {}
    width, height = size
    write_video(copied / "masks" / "cam01.mp4", [np.zeros((height, width, 3), np.uint8)] * 7, fps=30.0)
    video = came_along(layout_of(copied))
    assert video["masks"] != key["masks"]
    write_video(copied / "masks" / "cam01.mp4", [np.full((height, width, 3), 255, np.uint8)] * 7, fps=30.0)
    assert came_along(layout_of(copied)) != video


def test_kept_backgrounds_belong_to_masks_and_points(folder: Path, tmp_path: Path) -> None:
    capture = open_capture(folder)
    points = tmp_path / "points.ply"
    points.write_bytes(b"p" * 1_000_000)
    with_points = replace(capture, layout=replace(capture.layout, points=points))
    keys = [key_of_corrected(one, CLIP, [0, 1], TrainConfig()) for one in (capture, with_points)]
    points.write_bytes(b"p" * 500_000 + b"q" + b"p" * 499_999)
    keys.append(key_of_corrected(with_points, CLIP, [0, 1], TrainConfig()))
    moved = replace(with_points, layout=replace(with_points.layout, points_to_world=np.diag([2.0, 2.0, 2.0, 1.0])))
    keys.append(key_of_corrected(moved, CLIP, [0, 1], TrainConfig()))
    points.unlink()
    keys.append(key_of_corrected(with_points, CLIP, [0, 1], TrainConfig()))
    assert all(first != second for row, first in enumerate(keys) for second in keys[:row])


def test_kept_backgrounds_of_a_clip_belong_to_it(folder: Path) -> None:
    capture, other = open_capture(folder), Clip(1, 3, 3, 3)
    of_clip, of_capture = TrainConfig(backgrounds="clip"), TrainConfig()
    assert key_of_corrected(capture, CLIP, [0, 1], of_clip) != key_of_corrected(capture, other, [0, 1], of_clip)
    assert key_of_corrected(capture, CLIP, [0, 1], of_capture) == key_of_corrected(capture, other, [0, 1], of_capture)


def test_backgrounds_of_a_clip_outlive_the_growth_of_the_capture(folder: Path) -> None:
    of_clip, excluded = TrainConfig(backgrounds="clip"), Exclusions(frames=(ExcludedFrames("cam00", 5, 6),))
    short, whole = (open_capture(folder, frames=frames) for frames in ((0, 3), None))
    later = whole.without(excluded)
    keys = [key_of_corrected(one, CLIP, [0, 1], of_clip) for one in (short, whole, later)]
    assert keys[0] == keys[1] == keys[2]
    assert key_of_corrected(open_capture(folder, frames=(1, 7)), CLIP, [0, 1], of_clip) != keys[0]
