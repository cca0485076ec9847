"""The panel of the capture doctor: what it says and draws, and what its buttons do."""

from __future__ import annotations

import numpy as np
import pytest

from app.session.captures.capture_commands import (
    CorrectCapture,
    ExamineCapture,
    LookAtVideos,
    StopExamining,
    SynchroniseCameras,
)
from app.session.captures.doctor_status import DoctorStatus
from app.session.questions import CorrectionQuestion
from app.session.showing.look_commands import LookThrough, SetFrame
from app.status import JobStatus
from engine.capture.writers.capture_json import Corrections
from engine.cloud.background.exposure_survey import ExposureSurvey
from engine.doctor.doctor import Diagnosis
from engine.doctor.finding import Finding, PairEvidence, PictureEvidence
from tests.ui.fake_session import make_rig
from tests.ui.pilot import Pilot
from ui.panels.doctor.camera_map import camera_plan
from ui.panels.doctor.evidence import picture_width
from ui.panels.doctor.words import SEVERITY_ICONS, certainty_text, fix_words, summary_text
from ui.panels.state import DOCTOR
from ui.shell.dialogs.questions import correction_texts


def findings(names: tuple[str, ...]) -> tuple[Finding, ...]:
    place, line = ((0.2, 0.3), (0.7, 0.6)), (((0.0, 0.2), (1.0, 0.4)),) * 2
    pair = PairEvidence(names[1], names[2], 3, "2 features miss by 4.0 px", place, place, line, (4.0, 4.0))
    excluded = Corrections(is_excluded={names[1]: True})
    holdout = Corrections(holdout=(names[4], names[6]))
    text = f"{names[1]} is turned by 100 %d degrees"  # a name may hold anything
    return (
        Finding("pose", "error", (names[1],), (), text, 0.97, "Calibrate again.", excluded, (pair,)),
        Finding(
            "frozen", "warning", (names[3],), (5,), "It stands still.", 0.7, "", None, (PictureEvidence(names[3], 5),)
        ),
        Finding("hold out", "note", (names[4], names[6]), (), "Good to hold out.", 0.8, "", holdout),
    )


def open_panel(pilot: Pilot, status: DoctorStatus) -> None:
    pilot.session.doctor_status = status
    pilot.studio.frame.ui.wanted_panel = DOCTOR
    pilot.draw(8)


def diagnosis(names: tuple[str, ...]) -> Diagnosis:
    px = np.linspace(0.1, 4.0, len(names))
    px[-1] = np.nan
    survey = ExposureSurvey((0,), {}, len(names), {})
    return Diagnosis(findings(names), px, (), np.zeros(len(names), np.int64), survey, 240, 12.0)


@pytest.mark.gl
def test_a_capture_is_examined_from_the_panel_and_stopped(pilot: Pilot) -> None:
    open_panel(pilot, DoctorStatus())
    pilot.click("doctor.examine")
    assert pilot.session.commands[-1] == ExamineCapture()
    open_panel(
        pilot, DoctorStatus("running", (), None, JobStatus("Doctor", 0.4, "looking at pictures of 100 %s", 1.0), 2)
    )
    pilot.click("doctor.stop")
    assert pilot.session.commands[-1] == StopExamining()
    assert not [notice for notice in pilot.session.notices if notice.kind == "error"]


@pytest.mark.slow
@pytest.mark.gl
def test_findings_offer_what_corrects_them(pilot: Pilot) -> None:
    found = diagnosis(pilot.session.rig.names)
    open_panel(pilot, DoctorStatus("done", found.findings, found, revision=3))
    rects = pilot.studio.frame.ui.rects
    assert {"doctor.finding0", "doctor.picture0", "doctor.picture1", "doctor.map", "doctor.bars"} <= rects.keys()
    pilot.click("doctor.fix")
    asked = pilot.session.commands[-1]
    assert isinstance(asked, CorrectCapture)
    assert not asked.is_confirmed
    assert asked.corrections == found.findings[0].fix
    pilot.click("doctor.calibrate")
    assert pilot.session.commands[-1] == LookAtVideos(pilot.session.capture.path)
    assert "doctor.synchronise" not in rects
    pilot.click("doctor.picture1")
    assert pilot.session.commands[-2:] == [SetFrame(3), LookThrough(2)]
    pilot.click("doctor.finding1")
    pilot.draw(3)
    assert "doctor.fix" not in pilot.studio.frame.ui.rects
    assert not [notice for notice in pilot.session.notices if notice.kind == "error"]


@pytest.mark.gl
def test_cameras_out_of_step_lead_to_the_dialog_that_measures_them(pilot: Pilot) -> None:
    name = pilot.session.rig.names[2]
    late = Finding("synchronisation", "warning", (name,), (), f"{name} is late.", 0.9, "Shift it.", None)
    open_panel(pilot, DoctorStatus("done", (late,), None, revision=4))
    pilot.click("doctor.synchronise")
    assert pilot.session.commands[-1] == SynchroniseCameras()
    assert "doctor.calibrate" not in pilot.studio.frame.ui.rects


def test_words_of_findings_do_not_depend_on_colours() -> None:
    names = make_rig(8).names
    found = findings(names)
    assert len({SEVERITY_ICONS[finding.severity] for finding in found}) == 3
    assert [word for word in ("error", "warning", "note") if word not in summary_text(found)] == []
    assert "97 %" in certainty_text(found[0])
    fixes = (Corrections(is_excluded={"a": True}), Corrections(holdout=("a", "b")), Corrections(masks={"a": "m/*.png"}))
    assert len({fix_words(fix) for fix in fixes}) == len(fixes)
    assert "-2" in fix_words(Corrections(offset_frames={"a": -2.0}))[1]


def test_the_question_says_what_becomes_of_the_open_project() -> None:
    asked = CorrectionQuestion("/captures/dance", "Exclude a", Corrections(), "/projects/dance", True)
    said = " ".join(correction_texts(asked))
    assert "capture.json" in said
    assert "/projects/dance" in said


def test_the_map_keeps_a_ring_round_and_pictures_side_by_side() -> None:
    plan = camera_plan(make_rig(12))
    radii = np.linalg.norm(plan.places - 0.5, axis=1)
    assert np.ptp(radii) < 0.02
    towards = ((0.5 - plan.places) * plan.directions).sum(1)
    assert (towards > 0).all()
    assert picture_width(600.0, 400.0, 4 / 3, 2) * 2 < 600.0
    assert picture_width(300.0, 2000.0, 4 / 3, 1) == 300.0
