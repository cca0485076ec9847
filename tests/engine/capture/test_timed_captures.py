"""Captures whose cameras differ in length, rate or start, through capture.json."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from engine.capture.cameras import described_camera
from engine.capture.capture import open_capture
from engine.doctor.checks.frame_counts import check_frame_counts
from engine.errors import CaptureError
from tests.engine.capture.made_videos import SIZE, number_of, write_video_of_kind


def described(folder: Path, **entries: dict[str, object]) -> None:
    """capture.json with one camera per entry, each with a video of its name."""
    cameras = []
    for row, (name, entry) in enumerate(entries.items()):
        pose = np.eye(4)
        pose[0, 3] = row
        camera = {"name": name, "width": SIZE[0], "height": SIZE[1], "video": f"{name}.mp4"}
        camera |= {"K": [[60, 0, SIZE[0] / 2], [0, 60, SIZE[1] / 2], [0, 0, 1]], "world_to_camera": pose.tolist()}
        cameras.append(camera | entry)
    (folder / "capture.json").write_text(json.dumps({"schema": 1, "cameras": cameras}))


def numbers(folder: Path, *frame_indices: int) -> list[list[int]]:
    """Which own frame each camera shows at these frames of the capture."""
    capture = open_capture(folder)
    return [[number_of(capture.frame(row, frame)) for frame in frame_indices] for row in range(len(capture.rig))]


def test_offsets_and_unequal_lengths(tmp_path):
    write_video_of_kind(tmp_path / "a.mp4", n_frames=20)
    write_video_of_kind(tmp_path / "b.mp4", n_frames=15, options={"g": "50"})
    described(tmp_path, a={}, b={"offset_frames": -3})
    capture = open_capture(tmp_path)
    assert capture.n_frames == 15
    assert any("differ in length" in warning for warning in capture.warnings)
    assert numbers(tmp_path, 0, 5, 14) == [[3, 8, 17], [0, 5, 14]]


def test_parts_of_frames_are_rounded_and_stated(tmp_path):
    for name in "ab":
        write_video_of_kind(tmp_path / f"{name}.mp4", n_frames=10, options={"g": "5" if name == "a" else "50"})
    described(tmp_path, a={}, b={"offset_frames": 1.4})
    assert numbers(tmp_path, 0, 8) == [[0, 8], [1, 9]]
    assert any("16.0 ms at worst" in warning for warning in open_capture(tmp_path).warnings)


def test_cameras_of_two_rates_meet_on_the_slower_clock(tmp_path):
    write_video_of_kind(tmp_path / "a.mp4", n_frames=20)
    write_video_of_kind(tmp_path / "b.mp4", n_frames=40, times_ms=[20 * index for index in range(40)])
    described(tmp_path, a={}, b={})
    capture = open_capture(tmp_path)
    assert (capture.n_frames, capture.fps) == (20, pytest.approx(25, rel=1e-3))
    assert numbers(tmp_path, 0, 7, 19) == [[0, 7, 19], [0, 14, 38]]
    assert any("nearest frame of each" in warning for warning in capture.warnings)


@pytest.mark.parametrize(("n_frames", "is_short"), [(24, False), (12, True)])
def test_a_camera_of_another_rate_is_not_short_of_frames(tmp_path, n_frames, is_short):
    """One at 24 per second among others at 30; and one at 24 that stops half-way, which is."""
    times_ms = [1000 * row // 30 for row in range(30)]
    for name in "bcd":
        write_video_of_kind(tmp_path / f"{name}.mp4", n_frames=30, times_ms=times_ms, metadata={"title": name})
    write_video_of_kind(tmp_path / "a.mp4", n_frames=n_frames, times_ms=[1000 * row // 24 for row in range(n_frames)])
    described(tmp_path, a={}, b={}, c={}, d={})
    found = check_frame_counts(open_capture(tmp_path))
    assert [finding.cameras for finding in found if finding.severity == "warning"] == [("a",)] * is_short


def test_a_video_of_many_cameras_is_looked_at_once(tmp_path, monkeypatch):
    looked: list[Path] = []
    look = described_camera.read_video_header
    monkeypatch.setattr(
        described_camera, "read_video_header", lambda path, **options: looked.append(path) or look(path, **options)
    )
    write_video_of_kind(tmp_path / "a.mp4", n_frames=3)
    same: dict[str, dict[str, object]] = {f"x{row}": {"video": "a.mp4"} for row in range(50)}
    described(tmp_path, **same)
    with pytest.raises(CaptureError, match='Cameras "x0" and "x1" and 48 more use the same file'):
        open_capture(tmp_path)
    assert len(looked) == 1


def test_uneven_videos_meet_at_equal_times(tmp_path):
    times_ms = [40 * index for index in range(20) if index not in (5, 6, 12)]
    write_video_of_kind(tmp_path / "a.mp4", n_frames=20)
    write_video_of_kind(tmp_path / "b.mp4", n_frames=len(times_ms), times_ms=times_ms)
    described(tmp_path, a={}, b={})
    capture = open_capture(tmp_path)
    assert capture.n_frames == 20
    assert numbers(tmp_path, 4, 7, 13, 19) == [[4, 7, 13, 19], [4, 5, 10, 16]]


def test_offsets_of_uneven_videos_count_too(tmp_path):
    times_ms = [40 * index for index in range(20) if index != 3]
    write_video_of_kind(tmp_path / "a.mp4", n_frames=20)
    write_video_of_kind(tmp_path / "b.mp4", n_frames=len(times_ms), times_ms=times_ms)
    described(tmp_path, a={}, b={"offset_frames": 5})
    assert numbers(tmp_path, 0, 10) == [[0, 10], [4, 14]]


@pytest.mark.parametrize(("size", "is_warned"), [((SIZE[1] * 2, SIZE[0] * 2), False), (SIZE, True)])
def test_the_calibration_says_which_way_is_up(tmp_path, size, is_warned):
    write_video_of_kind(tmp_path / "a.mp4", n_frames=2, rotation_deg=90)
    K = [[60, 0, size[0] / 2], [0, 60, size[1] / 2], [0, 0, 1]]
    described(tmp_path, a={"width": size[0], "height": size[1], "K": K})
    capture = open_capture(tmp_path)
    assert capture.frame(0, 0).shape[:2] == (SIZE[1], SIZE[0]) if is_warned else (SIZE[0], SIZE[1])
    assert any("Not rotated" in warning for warning in capture.warnings) == is_warned
