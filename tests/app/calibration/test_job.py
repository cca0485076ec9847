"""The job of a calibration: what it writes, what it refuses, how it is cancelled. The calibration itself is made up."""

from __future__ import annotations

import shutil
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from app.background.jobs import Jobs
from app.calibration import job
from app.calibration.job import CalibrationRequest, TimeLeft, calibration_work, run_calibration
from app.calibration.report import report_lines
from app.cli.cli import main
from engine.assets import asset_path
from engine.calibration.calibrated import CalibratedRig, Calibration, MissingCamera
from engine.calibration.pair_lines import PairCounts
from engine.calibration.videos import find_videos
from engine.camera.lens import Lens
from engine.capture.capture import open_capture
from engine.errors import CaptureError
from engine.progress import Progress
from tests.app.conftest import DEADLINE_S

NAMES = ("cam00", "cam01", "cam02", "cam03")


@pytest.fixture
def videos(tmp_path: Path) -> Path:
    """Four videos of the sample without their cameras."""
    folder = tmp_path / "my videos"
    folder.mkdir()
    for name in NAMES:
        shutil.copy(asset_path("sample") / f"{name}.mp4", folder)
    return folder


@pytest.fixture
def made_up(monkeypatch) -> Calibration:
    """In place of a calibration: the sample's cameras, one of them missing."""
    rig = open_capture(asset_path("sample")).native_rig.subset([0, 1, 2])
    lenses = (Lens("opencv", (-0.1,)),) * 3
    found = CalibratedRig(
        rig,
        lenses,
        np.zeros((5, 3)),
        np.full(5, 0.3),
        np.array([0.3, 0.4, 2.5]),
        np.array([400, 300, 12]),
        np.array([0.97, 0.62, 0.1]),
        ("", "", "only 12 points"),
        False,
        "floor",
    )
    missing = MissingCamera("cam03", "it has at most 4 matches with another camera (cam02); 30 are needed", "cam02", 4)
    calibration = Calibration(found, (missing,))

    def calibrate(folder, options, *, follow_links, report, alive):
        report(Progress("Matching", 0.5, ""))
        alive()
        return calibration

    monkeypatch.setattr(job, "calibrate", calibrate)
    return calibration


def test_capture_json_lies_with_the_videos_and_opens(videos: Path, made_up: Calibration) -> None:
    outcome = run_calibration(CalibrationRequest(videos), report=lambda _: None)
    assert outcome.capture == videos
    assert not outcome.needs_links
    capture = open_capture(videos)
    assert capture.rig.names == NAMES[:2]
    assert capture.n_frames == 30
    np.testing.assert_allclose(capture.rig.world_to_camera, made_up.found.rig.world_to_camera[:2])
    assert capture.frame(0, 3).shape == (240, 320, 3)


def test_another_folder_names_the_videos_where_they_lie(videos: Path, made_up: Calibration, tmp_path: Path) -> None:
    outcome = run_calibration(CalibrationRequest(videos, tmp_path / "out"), report=lambda _: None)
    assert outcome.needs_links
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["capture.json"]
    assert len(open_capture(tmp_path / "out", follow_links=True).rig) == 2
    with pytest.raises(CaptureError, match="not inside its folder"):
        open_capture(tmp_path / "out")


def test_links_out_of_the_folder_are_followed_only_when_allowed(
    videos: Path, made_up: Calibration, tmp_path: Path, capsys
) -> None:
    (videos / "cam01.mp4").rename(tmp_path / "elsewhere.mp4")
    (videos / "cam01.mp4").symlink_to(tmp_path / "elsewhere.mp4")
    with pytest.raises(CaptureError, match="leads out of the capture folder"):
        find_videos(videos)
    assert main(["calibrate", str(videos), "--quiet", "--follow-links"]) == 0
    assert "inspect --follow-links" in capsys.readouterr().out
    assert len(open_capture(videos, follow_links=True).rig) == 2
    with pytest.raises(CaptureError):
        open_capture(videos)


def test_images_of_a_camera_may_not_lie_elsewhere(tmp_path: Path) -> None:
    for camera in ("a", "b", "c"):
        (tmp_path / "videos" / camera).mkdir(parents=True)
        Image.new("RGB", (8, 8)).save(tmp_path / "videos" / camera / "0.png")
    Image.new("RGB", (8, 8)).save(tmp_path / "secret.png")
    (tmp_path / "videos" / "b" / "1.png").symlink_to(tmp_path / "secret.png")
    with pytest.raises(CaptureError, match="leads out of the capture folder"):
        find_videos(tmp_path / "videos")
    assert len(find_videos(tmp_path / "videos", follow_links=True)) == 3


def test_what_is_there_is_replaced_only_when_asked(videos: Path, made_up: Calibration) -> None:
    (videos / "capture.json").write_text("{}")
    with pytest.raises(CaptureError, match="already"):
        run_calibration(CalibrationRequest(videos), report=lambda _: None)
    assert (videos / "capture.json").read_text() == "{}"
    run_calibration(CalibrationRequest(videos, is_replacing=True), report=lambda _: None)
    assert len(open_capture(videos).rig) == 2


def test_the_report_says_what_is_missing_why_and_what_helps(made_up: Calibration) -> None:
    lines = report_lines(made_up)
    assert lines[0].startswith("3 of 4 cameras were found, from 5 points")
    text = "\n".join(lines)
    assert "cam03: not found: it has at most 4 matches" in text
    assert "What helps:" in text
    assert "10 % of its matches explained - fits badly and doubtful: only 12 points" in text
    assert text.count("doubtful") == 1
    assert "one unit is not one metre" in text


def test_doubtful_cameras_are_written_as_excluded_and_listed(videos: Path, made_up: Calibration) -> None:
    outcome = run_calibration(CalibrationRequest(videos), report=lambda _: None)
    assert open_capture(videos).rig.names == NAMES[:2]
    assert outcome.lines[-1].endswith("written as excluded: cam02.")
    kept = CalibrationRequest(videos, is_replacing=True, keeps_doubtful=True)
    outcome = run_calibration(kept, report=lambda _: None)
    assert open_capture(videos).rig.names == NAMES[:3]
    assert outcome.lines[-1].endswith("check them before training: cam02.")


def test_a_calibration_that_matches_contradict_writes_nothing_and_ends_with_1(
    videos: Path, made_up: Calibration, monkeypatch, capsys
) -> None:
    pairs = (PairCounts("cam00", "cam01", 154, 27), PairCounts("cam00", "cam02", 12, 12))
    doubts = ("no camera agrees",) * 3
    failed = Calibration(replace(made_up.found, doubts=doubts), failure="Matches contradict 3 of 3.", pairs=pairs)
    monkeypatch.setattr(job, "calibrate", lambda *_, **__: failed)
    assert main(["calibrate", str(videos), "--quiet"]) == 1
    said = capsys.readouterr().out
    assert not (videos / "capture.json").exists()
    assert "  cam00  cam01     154 matches,  18 % explained" in said
    assert "1 of 2 pairs have 30 matches or more" in said
    assert "Caliscope" in said
    assert "--keep-doubtful" in said
    assert main(["calibrate", str(videos), "--quiet", "--keep-doubtful"]) == 0
    assert open_capture(videos).rig.names == NAMES[:3]


def test_a_job_hands_over_its_outcome_and_tells_how_far_it_is(videos: Path, made_up: Calibration) -> None:
    jobs, done, errors = Jobs(), [], []
    started = jobs.start("Calibrating", calibration_work(CalibrationRequest(videos)), done.append, errors.append)
    started.join(DEADLINE_S)
    assert started.context.status.done == 0.5
    assert started.context.status.message.startswith("Matching")
    jobs.poll()
    assert not errors
    assert done[0].capture == videos


def test_a_cancelled_job_writes_nothing(videos: Path, monkeypatch) -> None:
    def calibrate(folder, options, *, follow_links, report, alive):
        while True:
            alive()
            time.sleep(0.005)

    monkeypatch.setattr(job, "calibrate", calibrate)
    jobs, done, errors = Jobs(), [], []
    started = jobs.start("Calibrating", calibration_work(CalibrationRequest(videos)), done.append, errors.append)
    started.context.cancel()
    started.join(DEADLINE_S)
    jobs.poll()
    assert not started.is_running
    assert not done
    assert not errors
    assert not (videos / "capture.json").exists()


def test_time_left_follows_from_the_share_that_is_done() -> None:
    now = [0.0]
    left = TimeLeft(lambda: now[0])
    now[0] = 30.0
    assert left.text(0.01) == "0:30"
    assert left.text(0.25) == "0:30, about 1:30 left"
    assert left.text(1.0) == "0:30"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--distance", "cam00", "cam99", "2"], "Camera 'cam99' does not exist"),
        (["--distance", "cam00", "cam00", "2"], "from cam00 to cam00 is 2 m"),
        (["--distance", "cam00", "cam01", "far"], "not a number of metres"),
        (["--distance", "cam00", "cam01", "-1"], "is -1 m"),
        (["--lens", "round"], "invalid choice"),
    ],
)
def test_bad_input_ends_with_2_and_one_line(videos: Path, capsys, arguments: list[str], said: str) -> None:
    assert main(["calibrate", str(videos), *arguments]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1


def test_folders_that_are_none_or_have_too_few_videos_are_refused(tmp_path: Path, capsys) -> None:
    assert main(["calibrate", str(tmp_path / "gone")]) == 2
    assert "no such folder" in capsys.readouterr().err
    shutil.copy(asset_path("sample") / "cam00.mp4", tmp_path / "cam00.mp4")
    assert main(["calibrate", str(tmp_path)]) == 2
    assert "1 camera was found; at least 3 are needed" in capsys.readouterr().err
    (tmp_path / "cam01.mp4").write_bytes(b"no video")
    assert main(["calibrate", str(tmp_path)]) == 2
    assert "cam01.mp4" in capsys.readouterr().err


def test_the_command_says_what_was_found_and_where(videos: Path, made_up: Calibration, capsys) -> None:
    assert main(["calibrate", str(videos), "--quiet"]) == 0
    said = capsys.readouterr().out
    assert "3 of 4 cameras were found" in said
    assert "The capture is" in said
