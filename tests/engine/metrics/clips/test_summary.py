"""Rows brought together: means, curves, worst frames, and what is missing."""

import json

import pytest

from engine.metrics.clips.summary import (
    N_WORST,
    EvalRow,
    by_camera,
    by_frame,
    by_group,
    columns_of,
    mean_of,
    means,
    worst,
    worst_by_group,
)
from engine.metrics.columns import COLUMNS


def row(frame: int, camera: str, **figures: float | None) -> EvalRow:
    known = {name: figures.get(name) for name in COLUMNS}
    missing = {name: "no reason" for name, value in known.items() if value is None}
    return EvalRow(frame // 2, frame, camera, camera == "b", known, missing)


ROWS = [
    row(frame, camera, psnr=20.0 + frame + (5.0 if camera == "b" else 0.0), flip=0.1 * frame if camera == "a" else None)
    for camera in "ab"
    for frame in range(4)
]


def test_a_mean_leaves_out_what_is_not_there():
    found = means(ROWS)
    assert found["psnr"] == pytest.approx(24.0)
    assert found["flip"] == pytest.approx(0.15)  # of camera a alone
    assert found["ssim"] is None
    assert list(found) == list(COLUMNS)
    assert means([]) == {}
    assert mean_of([None, 2.0, None]) == 2.0
    assert mean_of([None]) is None


def test_groups_and_cameras():
    assert by_group(ROWS)["held_out"]["psnr"] == pytest.approx(26.5)
    assert by_group(ROWS)["trained_on"]["psnr"] == pytest.approx(21.5)
    assert by_group(ROWS[:4])["held_out"] == {}
    cameras = by_camera(ROWS)
    assert list(cameras) == ["a", "b"]
    assert cameras["b"]["is_held_out"] is True
    assert cameras["a"]["psnr"] == pytest.approx(21.5)


def test_curves_have_one_entry_per_frame():
    curves = by_frame(ROWS[::-1])
    assert curves["frame_index"] == [0, 1, 2, 3]
    assert curves["clip_index"] == [0, 0, 1, 1]
    assert curves["held_out"]["psnr"] == [25.0, 26.0, 27.0, 28.0]
    assert curves["held_out"]["flip"] == [None] * 4
    assert curves["trained_on"]["flip"] == pytest.approx([0.0, 0.1, 0.2, 0.3])
    assert by_frame(ROWS[:4])["held_out"] == {}
    gap = [r for r in ROWS if (r.camera, r.frame_index) != ("b", 2)]
    assert by_frame(gap)["held_out"]["psnr"] == [25.0, 26.0, None, 28.0]
    json.dumps(curves, allow_nan=False)


def test_the_worst_come_first_in_either_direction():
    assert [(r["camera"], r["frame_index"]) for r in worst(ROWS, "psnr", n_worst=2)] == [("a", 0), ("a", 1)]
    assert [r["frame_index"] for r in worst(ROWS, "flip", n_worst=2)] == [3, 2]
    assert worst(ROWS, "flip")[0]["flip"] == pytest.approx(0.3)
    assert len(worst(ROWS * 5, "psnr")) == N_WORST
    listed = worst_by_group(ROWS)
    assert listed["held_out"]["flip"] == []
    assert listed["held_out"]["psnr"][0]["frame_index"] == 0


def test_columns_count_their_gaps():
    found = columns_of(ROWS)
    assert (found["psnr"]["n_rows"], found["psnr"]["n_missing"], found["psnr"]["why_missing"]) == (8, 0, {})
    assert (found["flip"]["n_rows"], found["flip"]["n_missing"]) == (4, 4)
    assert found["flip"]["why_missing"] == {"no reason": 4}
    assert found["flip"]["is_higher_better"] is False
    assert found["psnr"]["unit"] == "dB"
    assert found["moving_share"]["is_higher_better"] is None  # of the capture, neither good nor bad


def test_a_row_is_flat_in_a_file():
    flat = ROWS[0].as_dict()
    assert flat["psnr"] == 20.0
    assert flat["flip"] == 0.0
    assert flat["ssim"] is None
    assert "missing" not in flat
    assert set(flat) == {"clip_index", "frame_index", "camera", "is_held_out", *COLUMNS}
