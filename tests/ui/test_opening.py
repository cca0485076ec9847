"""The dialogs between a folder and a project: what is reported and asked, why a folder does not open, calibration."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pyglet.window import key

from app.calibration.job import CalibrationRequest
from app.playback.modes.arrays import Picture
from app.project.opening.capture_report import CaptureReport, RefusedFolder, ReportedCamera
from app.project.opening.opening_answers import OpeningAnswers
from app.session.captures.calibration_page import CalibrationPage, CalibrationResult, VideoFacts
from app.session.captures.capture_commands import (
    ApplyOffsets,
    CalibrateVideos,
    KeepCalibration,
    LookAtVideos,
    StopCalibration,
)
from app.session.captures.synchronisation_page import OffsetRow, SynchronisationPage
from app.session.commands import CloseQuestion
from app.session.projects.project_commands import OpenCapture
from app.session.questions import OpeningPage
from app.status import JobStatus, OpeningForecast
from engine.calibration.options import CalibrationOptions, KnownDistance
from engine.doctor.finding import Finding
from tests.ui.fake_session import FakeSession, make_rig
from tests.ui.pilot import CTRL, Pilot
from ui.shell.dialogs.calibration_dialog import lines_below
from ui.shell.dialogs.opening.opening_answers_form import forecast_lines
from ui.shell.dialogs.opening.opening_map import placed, seen_from_above

pytestmark = pytest.mark.gl
NAMES = ("cam00", "50%s of 100%", "a##b", "cam03", "cam04", "cam05", "cam06", "cam07")
OFFERED = OpeningAnswers(frames=None, scale=0.5, clip_length=10, holdout=("cam03",))


def make_report() -> CaptureReport:
    rig = make_rig()
    cameras = tuple(
        ReportedCamera(name, (640, 480), "fisheye", (60.0, 45.0), center, forward, name == "cam03", has_masks=False)
        for name, center, forward in zip(NAMES, rig.centers, rig.forwards, strict=True)
    )
    return CaptureReport(
        path=Path("/captures/100% kitchen"),
        layout="capture.json",
        cameras=cameras,
        n_frames=50,
        fps=25.0,
        up=np.array([0.0, -1.0, 0.0]),
        focus_point=np.zeros(3),
        rig_extent=6.0,
        points="points.ply",
        warnings=("Cameras differ in length.",),
    )


@pytest.fixture
def asked(open_pilot: Callable[..., Pilot]) -> Pilot:
    """A window that asks about a capture."""
    session = FakeSession(has_capture=False)
    pilot = open_pilot(session)
    session.opening.found = OpeningForecast(5, (320, 240), 350, 100.0, 7300.0, 2100.0, 1530.0, 80_000.0)
    session.opening.pictures = {2: Picture(np.full((24, 32, 3), 200, np.uint8), "p")}
    session.opening.page = OpeningPage(make_report(), OFFERED, is_new_project=True, follow_links=True)
    pilot.draw(4)
    return pilot


def opened(answers: OpeningAnswers) -> list[OpenCapture]:
    path = Path("/captures/100% kitchen")
    return [OpenCapture(path, is_new_project=True, follow_links=True, answers=answers)]


def type_into(pilot: Pilot, name: str, text: str) -> None:
    pilot.click(name)
    pilot.key(key.A, modifiers=(CTRL,))
    pilot.type(text)
    pilot.key(key.RETURN)


@pytest.mark.slow
def test_enter_takes_what_is_offered_and_escape_nothing(asked: Pilot) -> None:
    asked.key(key.RETURN)
    assert asked.sent(OpenCapture) == opened(OFFERED)
    assert len(asked.session.notices) == 0
    asked.session.opening.page = OpeningPage(make_report(), OFFERED, is_new_project=True, follow_links=True)
    asked.draw(4)
    asked.key(key.ESCAPE)
    assert asked.sent(CloseQuestion) == [CloseQuestion()]


@pytest.mark.slow
def test_numbers_are_typed_and_held_to_what_there_is(asked: Pilot) -> None:
    type_into(asked, "opening.first", "10")
    type_into(asked, "opening.last", "1000")
    type_into(asked, "opening.last", "29")
    type_into(asked, "opening.scale", "25")
    type_into(asked, "opening.clip_length", "7")
    assert asked.sent(OpenCapture) == []  # Enter ended what was typed, no more
    asked.click("opening.accept")
    assert asked.sent(OpenCapture) == opened(OpeningAnswers((10, 30), 0.25, 7, ("cam03",)))
    assert asked.session.opening.asked[-1].frames == (10, 30)


@pytest.mark.slow
def test_frames_of_another_shape_are_asked_about(asked: Pilot) -> None:
    assert "opening.fit" not in asked.rects
    report = replace(make_report(), misfit_px=8.0)
    asked.session.opening.page = OpeningPage(report, OFFERED, is_new_project=True, follow_links=True)
    asked.draw(4)
    asked.click("opening.fit")
    asked.click("opening.fit.cropped_end")
    assert asked.sent(OpenCapture) == []
    asked.click("opening.accept")
    assert asked.sent(OpenCapture) == opened(replace(OFFERED, fit="cropped_end"))


@pytest.mark.slow
def test_frames_of_quite_another_shape_have_no_usual_answer(asked: Pilot) -> None:
    report = replace(make_report(), misfit_px=80.0, needs_fit=True)
    asked.session.opening.page = OpeningPage(report, OFFERED, is_new_project=True, follow_links=True)
    asked.draw(4)
    asked.click("opening.accept")
    assert asked.sent(OpenCapture) == []
    asked.click("opening.fit")
    asked.click("opening.fit.scaled")
    asked.click("opening.accept")
    assert asked.sent(OpenCapture) == opened(replace(OFFERED, fit="scaled"))


@pytest.mark.slow
def test_keys_in_a_list_choose_and_do_not_answer_the_dialog(asked: Pilot) -> None:
    report = replace(make_report(), misfit_px=8.0)
    asked.session.opening.page = OpeningPage(report, OFFERED, is_new_project=True, follow_links=True)
    asked.draw(4)
    asked.click("opening.fit")
    asked.key(key.ESCAPE)
    assert asked.sent(CloseQuestion) == []
    asked.click("opening.fit")
    asked.key(key.DOWN)
    asked.key(key.RETURN)
    asked.draw(2)
    assert asked.sent(OpenCapture) == []
    asked.click("opening.accept")
    assert asked.sent(OpenCapture) == opened(replace(OFFERED, fit="cropped_end"))


@pytest.mark.slow
def test_cameras_are_held_out_on_the_map_and_in_the_list(asked: Pilot) -> None:
    box = asked.rects["opening.map"]
    places, _ = seen_from_above(make_report())
    x, y = placed(places, box)[5]
    asked.move(x, y)
    asked.press()
    asked.release()
    asked.draw(2)
    asked.click("opening.camera0")
    asked.click("opening.camera3")
    asked.click("opening.accept")
    assert asked.sent(OpenCapture) == opened(OpeningAnswers(None, 0.5, 10, ("cam00", "cam05")))


@pytest.mark.slow
def test_by_keyboard_alone_a_camera_is_held_out_and_enter_only_accepts(asked: Pilot) -> None:
    asked.click("opening.none")
    asked.draw(2)
    for _ in range(2):
        asked.key(key.DOWN)
    asked.key(key.SPACE)
    asked.key(key.RETURN)
    (command,) = asked.sent(OpenCapture)
    assert command.answers is not None
    assert len(command.answers.holdout) == 1


@pytest.mark.slow
def test_too_few_cameras_cannot_be_accepted(asked: Pilot) -> None:
    for row in range(5):
        if NAMES[row] != "cam03":
            asked.click(f"opening.camera{row}")
    asked.session.opening.page = OpeningPage(
        make_report(), OpeningAnswers(None, 1.0, 10, NAMES[1:]), is_new_project=False, follow_links=False
    )
    asked.draw(3)
    asked.key(key.RETURN)
    asked.click("opening.accept")
    assert asked.sent(OpenCapture) == []


@pytest.mark.parametrize("up", [(0.0, -1.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)])
def test_the_map_keeps_shape_and_order_whatever_is_up(up: tuple[float, float, float]) -> None:
    report = make_report()
    turn = np.linalg.qr(np.stack([up, (0.3, 0.5, 0.2), (0.1, 0.9, 0.4)], axis=1))[0]
    turn = turn * np.sign(turn[:, 0] @ np.array(up))
    places, looks = seen_from_above(report)
    distances = np.linalg.norm(places[:-1], axis=1)
    assert np.allclose(distances, 3.0, atol=1e-6)  # the ring, seen from above
    towards = -places[:-1] / distances[:, None]
    assert (np.sum(looks * towards, axis=1) > 0.9).all()


def test_cameras_in_one_place_can_be_drawn() -> None:
    from ui.panels.state import Rect

    box = Rect(0.0, 0.0, 100.0, 100.0)
    points = placed(np.zeros((4, 2)), box)
    assert np.allclose(points, 50.0)


def test_a_forecast_says_what_is_not_known_yet() -> None:
    found = OpeningForecast(5, (320, 240), 350, None, None, None, 12.0, None)
    assert forecast_lines(found, is_final=False)[0] != forecast_lines(found, is_final=True)[0]


def test_why_a_folder_does_not_open_is_shown_and_videos_can_be_calibrated(open_pilot: Callable[..., Pilot]) -> None:
    session = FakeSession(has_capture=False)
    pilot = open_pilot(session)
    folder = Path("/videos/%d")
    session.opening.refused = RefusedFolder(folder, "Not a capture: 50%s.", "Do this.", (("a", "b"),))
    pilot.draw(4)
    assert "refused.calibrate" not in pilot.rects
    pilot.key(key.RETURN)
    assert pilot.sent(CloseQuestion) == [CloseQuestion()]
    session.opening.refused = RefusedFolder(folder, "Not a capture.", "", (), (folder / "a.mp4", folder / "b.mp4"))
    pilot.draw(4)
    pilot.key(key.RETURN)
    assert pilot.sent(LookAtVideos) == [LookAtVideos(folder)]
    assert len(session.notices) == 0


@pytest.mark.slow
def test_files_outside_are_allowed_by_a_button_only(open_pilot: Callable[..., Pilot]) -> None:
    session = FakeSession(has_capture=False)
    pilot = open_pilot(session)
    folder = Path("/videos/links")
    session.opening.refused = RefusedFolder(folder, "'a%s' is a link that leads out.", "Copy.", needs_links=True)
    pilot.draw(4)
    pilot.key(key.RETURN)
    assert pilot.sent(OpenCapture) == []
    assert pilot.sent(CloseQuestion) == [CloseQuestion()]
    session.opening.refused = RefusedFolder(folder, "'b%s' is a link that leads out.", "Copy.", needs_links=True)
    pilot.draw(4)
    pilot.click("refused.allow")
    assert pilot.sent(OpenCapture) == [OpenCapture(folder, follow_links=True, is_asking=True)]
    assert len(session.notices) == 0


def test_findings_of_the_numbers_are_shown(asked: Pilot) -> None:
    before = asked.studio.frame.ui.rects["opening.accept"]
    finding = Finding("twins", "warning", ("50%s",), (), "50%s and a##b stand\nin one place.", 0.9, "Leave out %d.")
    asked.session.opening.findings = (finding, replace(finding, severity="error"), replace(finding, severity="note"))
    asked.draw(3)
    rects = asked.studio.frame.ui.rects
    assert rects["opening.accept"] == before
    assert rects["opening.finding0"].y0 < rects["opening.finding1"].y0 < rects["opening.finding2"].y0
    assert len(asked.session.notices) == 0


VIDEOS = tuple(
    VideoFacts(name, (640, 480), n_frames, 30.0) for name, n_frames in zip("abcd", (30, 30, 31, 30), strict=True)
)


def show(pilot: Pilot, page: CalibrationPage | None, progress: JobStatus | None = None) -> None:
    pilot.session.calibrating.page, pilot.session.calibrating.progress = page, progress
    pilot.draw(4)


@pytest.mark.slow
def test_a_calibration_from_options_to_the_capture(open_pilot: Callable[..., Pilot]) -> None:
    pilot = open_pilot(FakeSession(has_capture=False))
    folder = Path("/videos/garden")
    show(pilot, CalibrationPage(folder))
    pilot.key(key.RETURN)
    assert pilot.sent(CalibrateVideos) == []  # nothing is known of the folder yet
    asking = CalibrationPage(folder, "asking", VIDEOS)
    show(pilot, asking)
    pilot.click("calibration.lens.fisheye")
    pilot.click("calibration.shared")
    pilot.click("calibration.up.cameras")
    pilot.click("calibration.distance")
    pilot.draw(2)
    type_into(pilot, "calibration.metres", "2.5")
    pilot.key(key.RETURN)
    options = CalibrationOptions("fisheye", is_lens_shared=True, distance=KnownDistance("a", "b", 2.5), up="cameras")
    assert pilot.sent(CalibrateVideos) == [CalibrateVideos(CalibrationRequest(folder, None, options))]
    show(pilot, CalibrationPage(folder, "running", VIDEOS), JobStatus("Calibrating", 0.4, "Matching 50%s"))
    pilot.key(key.ESCAPE)
    assert pilot.sent(StopCalibration) == [StopCalibration()]
    result = CalibrationResult(
        folder, True, 3, ("d",), False, "", ("3 of 4 cameras were found.", "  d: not found: dark")
    )
    show(pilot, CalibrationPage(folder, "done", VIDEOS, result=result))
    pilot.key(key.RETURN)
    assert pilot.sent(OpenCapture) == [OpenCapture(folder, follow_links=True, is_asking=True)]
    assert len(pilot.session.notices) == 0


def test_a_calibration_that_has_failed_is_kept_only_when_chosen(open_pilot: Callable[..., Pilot]) -> None:
    pilot = open_pilot(FakeSession(has_capture=False))
    folder = Path("/videos/garden")
    lines = (
        "10 of 10 cameras were found.",
        "Matches contradict 10 of 10 cameras.",
        "  a  b  154 matches,  18 % explained",
    )
    result = CalibrationResult(folder, False, 10, (), True, "Matches contradict 10 of 10 cameras.", lines)
    show(pilot, CalibrationPage(folder, "done", VIDEOS, result=result))
    assert lines_below(result) == [lines[0], lines[2]]
    assert "calibration.open" not in pilot.rects
    pilot.click("calibration.keep")
    assert pilot.sent(KeepCalibration) == [KeepCalibration()]
    pilot.key(key.RETURN)
    assert pilot.sent(OpenCapture) == []
    assert pilot.sent(CloseQuestion) == [CloseQuestion()]


@pytest.mark.slow
def test_a_calibration_that_is_there_is_replaced_only_where_that_is_said(open_pilot: Callable[..., Pilot]) -> None:
    pilot = open_pilot(FakeSession(has_capture=False))
    folder = Path("/videos/garden")
    failure = RefusedFolder(folder, "Too little in common.", "Move closer.")
    show(pilot, CalibrationPage(folder, "asking", VIDEOS, has_capture_json=True, failure=failure))
    pilot.key(key.RETURN)
    assert pilot.sent(CalibrateVideos) == []
    pilot.click("calibration.replace")
    pilot.key(key.RETURN)
    (command,) = pilot.sent(CalibrateVideos)
    assert command.request.is_replacing
    pilot.key(key.ESCAPE)
    assert pilot.sent(CloseQuestion) == [CloseQuestion()]


@pytest.mark.slow
def test_the_first_screen_leads_to_calibration(
    open_pilot: Callable[..., Pilot], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("ui.shell.dialogs.dialogs.has_native_dialog", lambda: False)
    pilot = open_pilot(FakeSession(has_capture=False))
    pilot.click("welcome.calibrate")
    pilot.draw(3)
    pilot.key(key.A, modifiers=(CTRL,))
    pilot.type(str(tmp_path))
    pilot.key(key.RETURN)
    assert pilot.sent(LookAtVideos) == [LookAtVideos(tmp_path)]
    assert pilot.sent(OpenCapture) == []


@pytest.mark.slow
def test_offsets_are_shown_and_corrected_by_keyboard(pilot: Pilot) -> None:
    folder = Path("/captures/100% kitchen")
    sure = OffsetRow("50%s", 2.0, 0.05, 0.97, "audio", is_sure=True)
    unknown = OffsetRow("b##c", None, np.inf, 0.0, "", is_sure=False)
    page = SynchronisationPage(folder, target=folder)
    pilot.session.synchronising.page, pilot.session.synchronising.progress = page, JobStatus("Synchronising", 0.2, "so")
    pilot.draw(4)
    pilot.key(key.RETURN)
    assert pilot.sent(CloseQuestion) == []
    pilot.session.synchronising.page = replace(
        page, state="done", rows=(sure, unknown), notes=("audio: 100%",), disagreements=("They differ.",)
    )
    pilot.draw(3)
    pilot.key(key.RETURN)
    assert pilot.sent(ApplyOffsets) == [ApplyOffsets(folder)]
    pilot.session.synchronising.page = replace(page, state="written", rows=(sure,), written=folder)
    pilot.draw(3)
    pilot.key(key.RETURN)
    assert pilot.sent(OpenCapture) == [OpenCapture(folder, is_asking=True)]
    pilot.session.synchronising.page = replace(page, state="done", rows=(replace(sure, is_sure=False),))
    pilot.draw(3)
    assert "synchronisation.apply" not in pilot.rects
    pilot.key(key.ESCAPE)
    assert pilot.sent(CloseQuestion) == [CloseQuestion()]
    assert len(pilot.session.notices) == 0
