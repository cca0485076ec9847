"""Exports in the window: what the dialog asks and tells, and what the panel lists and its buttons do."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import msgspec
import pytest
from pyglet.window import key

from app.export.export_choices import ExportChoices, ExportContext
from app.export.export_plan import ExportPlan
from app.export.export_progress import ExportProgress, ExportResult
from app.export.jobs.answers import Answers
from app.export.jobs.video import Turntable
from app.export.queue.export_status import ExportStatus
from app.session.commands import CloseQuestion
from app.session.export_commands import (
    AskExport,
    CancelExport,
    ClearExports,
    MoveExport,
    RemoveExport,
    RetryExport,
    ShowExport,
    StartExport,
)
from app.session.exporting import ExportPage
from tests.ui.pilot import CTRL, Pilot
from ui.panels.exports import bytes_text, ending_text, files_text, progress_text
from ui.panels.state import EXPORTS

ODD = "50 %s of it##x\n%n"
"""A name that formats, ends a label and breaks a line, if it is let."""
CONTEXT = ExportContext(
    name=ODD,
    n_frames=30,
    clips=((0, 10), (10, 20), (20, 30)),
    trained=(0, 1),
    frame_index=4,
    in_frame=0,
    out_frame=29,
    cameras=(ODD, *(f"cam{i:02d}" for i in range(8))),
    picture_size=(320, 240),
    fps=30.0,
    paths=(f"path {ODD}",),
)
CONTEXT_WITH_EDITS = msgspec.structs.replace(CONTEXT, has_edits=True)
STATUS = ExportStatus(1, "Gaussians, PLY", Path("/out") / ODD)


@pytest.mark.slow
def test_edits_go_along_or_are_left_out(open_pilot) -> None:
    pilot = open_pilot()
    for kind, takes_edits in (("gaussians", True), ("video", True), ("player", True), ("cameras", False)):
        ask(pilot, ExportChoices(kind=kind), CONTEXT_WITH_EDITS)
        assert ("export.has_edits.false" in pilot.rects) is takes_edits
        if takes_edits:
            pilot.click("export.has_edits.false")
            pilot.click("export.start")
            [started] = pilot.sent(StartExport)[-1:]
            assert Answers(CONTEXT_WITH_EDITS, started.choices)["has_edits"] == "false"
        pilot.session.exporting.page = None
        pilot.draw(4)
    ask(pilot, ExportChoices(kind="gaussians"))
    assert "export.has_edits.false" not in pilot.rects, "the project has none"


def errors(pilot: Pilot) -> list[str]:
    return [notice.title for notice in pilot.session.notices if notice.kind == "error"]


def replace_context(**changes: object) -> ExportContext:
    """The context with other facts."""
    return msgspec.structs.replace(CONTEXT, **changes)


def ask(pilot: Pilot, choices: ExportChoices, context: ExportContext = CONTEXT, **plan: object) -> None:
    """Open the dialog."""
    exporting = pilot.session.exporting
    exporting.page = ExportPage(context, choices)
    exporting.found = ExportPlan(choices, 3, 5_000_000, 10**10, **plan)  # type: ignore[arg-type]
    pilot.draw(6)
    assert "export.start" in pilot.rects


def asked(pilot: Pilot) -> ExportChoices:
    return pilot.session.exporting.asked[-1]


@pytest.mark.slow
@pytest.mark.gl
def test_ctrl_e_asks_and_enter_exports(pilot: Pilot) -> None:
    pilot.key(key.E, modifiers=(CTRL,))
    assert pilot.session.commands[-1] == AskExport()
    ask(pilot, ExportChoices(out="/out/g"))
    pilot.key(key.ENTER)
    assert pilot.session.commands[-1] == StartExport(ExportChoices(out="/out/g"))
    pilot.session.exporting.page = None
    pilot.draw(4)
    assert pilot.studio.frame.ui.rects.get("exports.ask") is not None  # the panel has come to the front
    assert not errors(pilot)


@pytest.mark.slow
@pytest.mark.gl
def test_escape_closes_and_problems_hold_it_back(pilot: Pilot) -> None:
    ask(pilot, ExportChoices(out="/out/g"), problems=(f"The disk of {ODD} is full.",))
    assert "export.problem" in pilot.rects
    pilot.key(key.ENTER)
    pilot.click("export.start")
    assert not [one for one in pilot.session.commands if isinstance(one, StartExport)]
    pilot.key(key.ESCAPE)
    assert pilot.session.commands[-1] == CloseQuestion()
    assert not errors(pilot)


@pytest.mark.slow
@pytest.mark.gl
def test_while_it_is_looked_at_nothing_can_be_exported(pilot: Pilot) -> None:
    ask(pilot, ExportChoices(out="/out/g"))
    pilot.session.exporting.found = None
    pilot.draw(2)
    pilot.key(key.ENTER)
    assert not [one for one in pilot.session.commands if isinstance(one, StartExport)]


@pytest.mark.slow
@pytest.mark.gl
def test_every_kind_is_asked_for_and_gets_a_name_unless_one_was_typed(pilot: Pilot) -> None:
    ask(pilot, ExportChoices(out="/out/g"))
    for kind in ("video", "metrics", "cameras", "gaussians"):
        pilot.click(f"export.kind.{kind}")
        pilot.draw(2)
        assert (asked(pilot).kind, asked(pilot).out) == (kind, f"/out/{kind}")
    pilot.click("export.out")
    pilot.key(key.A, modifiers=(CTRL,))
    pilot.type("/mine")
    pilot.key(key.ENTER)  # it ends the text and nothing else
    pilot.click("export.kind.metrics")
    pilot.click("export.format.json")
    pilot.click("export.frames.range")
    pilot.draw(2)
    assert asked(pilot) == ExportChoices("metrics", (("metrics.format", "json"),), "range", "/mine")
    assert not [one for one in pilot.session.commands if isinstance(one, StartExport)]
    assert not errors(pilot)


@pytest.mark.slow
@pytest.mark.gl
def test_names_of_cameras_and_paths_are_shown_as_they_are(pilot: Pilot) -> None:
    ask(pilot, ExportChoices(kind="video", out="/out/v"))
    assert dict(asked(pilot).answers) == {}
    pilot.click("export.from")
    pilot.draw(3)
    assert f"export.from.path:path {ODD}" in pilot.rects
    pilot.click(f"export.from.camera:{ODD}")
    pilot.draw(3)
    assert asked(pilot).answer("from") == f"camera:{ODD}"
    pilot.click("export.shows.compare")
    pilot.draw(3)
    assert asked(pilot).answer("shows") == "compare"
    assert "export.size." not in pilot.rects  # pictures have the camera's size
    assert not errors(pilot)


@pytest.mark.slow
@pytest.mark.gl
def test_names_are_shown_as_they_are_where_they_are_few(pilot: Pilot) -> None:
    ask(pilot, ExportChoices(kind="video", out="/out/v"), context=replace_context(cameras=("a##b", "a"), paths=()))
    assert "export.from.camera:a##b" not in pilot.rects  # not among radio buttons, whose labels end at "##"
    pilot.click("export.from")
    pilot.draw(3)
    pilot.click("export.from.camera:a##b")
    pilot.draw(3)
    assert asked(pilot).answer("from") == "camera:a##b"
    assert not errors(pilot)


@pytest.mark.slow
@pytest.mark.gl
def test_a_turntable_has_turns(pilot: Pilot) -> None:
    ask(pilot, ExportChoices(kind="video", out="/out/v").with_answer("from", "turntable"))
    pilot.click("export.n_turns.2")
    pilot.draw(2)
    assert asked(pilot).answer("n_turns") == "2"
    job = Answers(CONTEXT, asked(pilot)).make_job()
    assert job.turntable == Turntable(2.0)  # type: ignore[attr-defined]


@pytest.mark.slow
@pytest.mark.gl
def test_nothing_is_exported_before_there_is_a_name(pilot: Pilot) -> None:
    exporting = pilot.session.exporting
    exporting.is_looking = True
    ask(pilot, ExportChoices())
    pilot.key(key.ENTER)
    assert exporting.asked == []
    assert not [one for one in pilot.session.commands if isinstance(one, StartExport)]
    exporting.is_looking = False
    pilot.draw(2)
    assert asked(pilot).out == "/out/gaussians"
    pilot.key(key.ENTER)
    assert pilot.session.commands[-1] == StartExport(ExportChoices(out="/out/gaussians"))


@pytest.mark.slow
@pytest.mark.gl
def test_a_box_of_answers_takes_enter_and_escape_for_itself(pilot: Pilot) -> None:
    ask(pilot, ExportChoices(kind="video", out="/out/v"))
    pilot.click("export.from")
    pilot.draw(3)
    for _ in range(3):
        pilot.key(key.DOWN)
    pilot.key(key.ENTER)
    pilot.draw(2)
    assert asked(pilot).answer("from").startswith("camera:")
    pilot.click("export.from")
    pilot.draw(3)
    pilot.key(key.ESCAPE)
    pilot.draw(2)
    assert not [one for one in pilot.session.commands if isinstance(one, StartExport | CloseQuestion)]
    pilot.key(key.ENTER)
    assert [one for one in pilot.session.commands if isinstance(one, StartExport)]


@pytest.mark.slow
@pytest.mark.gl
def test_the_panel_lists_exports_and_its_buttons_act(pilot: Pilot) -> None:
    result = ExportResult(Path("/out"), 2, 10, 41.5, (f"As {ODD}.",))
    pilot.session.exporting.statuses = (
        replace(STATUS, state="running", progress=ExportProgress(3, 12)),
        replace(STATUS, export_id=2),
        replace(STATUS, export_id=3),
        replace(STATUS, export_id=4, state="done", result=result),
        replace(STATUS, export_id=5, state="failed", message=f"It is {ODD}.", hint="Try again."),
    )
    pilot.studio.frame.ui.wanted_panel = EXPORTS
    pilot.draw(8)
    for button, command in (
        ("cancel1", CancelExport(1)),
        ("down2", MoveExport(2, 1)),
        ("up3", MoveExport(3, 0)),
    ):
        pilot.click(f"exports.{button}")
        assert pilot.session.commands[-1] == command
    pilot.session.exporting.statuses = pilot.session.exporting.statuses[3:]
    pilot.draw(4)
    for button, command in (
        ("show4", ShowExport(4)),
        ("remove4", RemoveExport(4)),
        ("retry5", RetryExport(5)),
        ("clear", ClearExports()),
        ("ask", AskExport()),
    ):
        pilot.click(f"exports.{button}")
        assert pilot.session.commands[-1] == command
    assert not errors(pilot)


@pytest.mark.slow
@pytest.mark.gl
def test_the_panel_is_reached_and_used_by_keyboard(pilot: Pilot) -> None:
    pilot.session.exporting.statuses = (replace(STATUS, state="failed", message="x"),)
    pilot.studio.frame.ui.wanted_panel = EXPORTS
    pilot.draw(3)
    for _ in range(20):
        if pilot.studio.frame.ui.keyed_panel == EXPORTS:
            break
        pilot.key(key.F6)
    pilot.draw(6)
    assert pilot.studio.frame.ui.keyed_panel == EXPORTS
    for _ in range(6):
        pilot.key(key.DOWN)
        pilot.key(key.ENTER)
        if pilot.session.commands and pilot.session.commands[-1] == RetryExport(1):
            break
    assert RetryExport(1) in pilot.session.commands


def test_progress_has_counts_and_time_left() -> None:
    far = replace(STATUS, state="running", progress=ExportProgress(1200, 3000), per_s=3.14, eta_s=573.0)
    assert [part for part in ("1,200", "3,000", "3.1", "9:33") if part not in progress_text(far)] == []
    assert "1,200" not in progress_text(replace(far, state="stopping"))


def test_endings_have_what_was_written_or_why_not() -> None:
    done = replace(STATUS, state="done", seconds=12.0, result=ExportResult(Path("/o"), 1, 1234, 41.52))
    assert [part for part in ("1 kB", "0:12", "41.5 dB") if part not in ending_text(done)] == []
    assert ending_text(replace(STATUS, state="failed", message="No.", hint="Do.")) == "No. Do."


@pytest.mark.parametrize(
    ("n_bytes", "text"),
    [(0, "0 bytes"), (999, "999 bytes"), (1234, "1 kB"), (99_000, "99 kB"), (3e6, "3.0 MB"), (7.4e10, "74.0 GB")],
)
def test_amounts_of_data(n_bytes, text) -> None:
    assert bytes_text(n_bytes) == text
    assert files_text(1200, n_bytes) == f"1,200 files, {text}"
