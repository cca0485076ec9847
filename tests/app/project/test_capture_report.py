"""What a user hears about a folder while no project exists yet."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from app.project.opening.capture_report import refusal_of, report_of
from engine.capture.capture import open_capture
from engine.children.messages import Refusal, decoded, encoded
from engine.errors import CaptureError, OutsideError
from tests.app.fakes import write_capture


def refused(path: Path) -> CaptureError:
    with pytest.raises(CaptureError) as caught:
        open_capture(path)
    return caught.value


def test_a_report_says_what_there_is(capture_folder):
    report = report_of(open_capture(capture_folder))
    rows = dict(report.rows)
    assert rows["Cameras"] == "4 cameras, 32 x 24"
    assert rows["Frames"] == "6 at 30 per second (0.2 s)"
    assert rows["Lenses"] == "no distortion; 56 degrees wide"
    assert rows["Extras"] == "no masks, no point cloud; neither is needed"
    assert [camera.is_default_holdout for camera in report.cameras] == [True, False, False, False]
    assert report.up == pytest.approx([0, 0, 1], abs=1e-6)
    assert all(camera.center @ camera.forward < 0 for camera in report.cameras)
    for words in (*rows.values(), *report.warnings, *(camera.name for camera in report.cameras)):
        assert words in report.text


def test_several_problems_are_all_listed_and_no_calibration_is_offered(tmp_path):
    folder = write_capture(tmp_path / "bad")
    meta = json.loads((folder / "train_meta.json").read_text())
    for camera in range(2):
        for frame in meta["k"]:
            frame[camera][0][0] = -1.0
    (folder / "train_meta.json").write_text(json.dumps(meta))
    error = refused(folder)
    found = refusal_of(folder, error)
    assert len(found.problems) == len(error.problems) > 1
    assert found.message in found.text
    assert all(message in found.text for message, _ in found.problems)
    assert found.videos == ()


def test_plain_videos_may_be_calibrated_and_are_named_in_natural_order(tmp_path):
    for name in ("cam10.mp4", "cam2.MP4", "notes.txt", "cam1.mov"):
        (tmp_path / name).write_bytes(b"")
    found = refusal_of(tmp_path, refused(tmp_path))
    assert [video.name for video in found.videos] == ["cam1.mov", "cam2.MP4", "cam10.mp4"]
    assert str(tmp_path) not in found.message  # it is shown beside it
    (tmp_path / "cam1.mov").unlink()
    (tmp_path / "cam2.MP4").unlink()
    assert refusal_of(tmp_path, refused(tmp_path)).videos == ()


def test_a_folder_that_is_not_there(tmp_path):
    found = refusal_of(tmp_path / "gone", refused(tmp_path / "gone"))
    assert found.message == "There is no such folder."
    assert found.videos == ()


def test_what_lies_outside_may_be_allowed_unless_more_is_wrong(tmp_path):
    outside = OutsideError("'a' is a link.", hint="Use --follow-links.", path=tmp_path / "a")
    assert refusal_of(tmp_path, outside).needs_links
    both = CaptureError("2 problems.", path=tmp_path, problems=(outside, outside))
    found = refusal_of(tmp_path, decoded(encoded(Refusal.of(both)), Refusal).error())
    assert found.needs_links
    assert "--follow-links" not in found.text
    assert [message for message, _ in found.problems] == ["'a' is a link."] * 2
    mixed = CaptureError("2 problems.", path=tmp_path, problems=(outside, CaptureError("The file is missing.")))
    assert not refusal_of(tmp_path, mixed).needs_links
