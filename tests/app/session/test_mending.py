"""Mending through the session: asked, run, compared, kept or taken back. What it computes is made up here."""

from __future__ import annotations

import threading
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace as with_entries

from app.background.jobs import JobCancelled, JobContext
from app.mending.mend_project import MendOutcome
from app.mending.request import MendRequest
from app.project.mends.in_place import put_in_place
from app.project.mends.record import MendedClip, MendRecord
from app.project.project import Project
from app.session.clips.clip_commands import SplitClip
from app.session.editing.edit_commands import AddEdit
from app.session.files.file_commands import SaveProjectAs
from app.session.mending import mending
from app.session.mending.mend_commands import AskMend, CloseMend, CompareMended, RevertMend, StartMend, StopMend
from app.session.mending.mend_page import MendPage
from app.session.projects.setting_commands import SetClipLength
from app.session.session import Session
from app.session.training.train_commands import TrainAll
from engine.clip_files.clip_state import ClipState, read_clip_state, write_clip_state
from engine.editing.actions import Hide
from engine.editing.edit import Picked, PickedRows
from engine.editing.picks import pack_rows
from engine.errors import ProjectError
from engine.mending.figures import StretchFigures
from tests.app.conftest import DEADLINE_S, poll_until

Make = Callable[..., Session]
BEFORE = StretchFigures(excess=0.4, worst=0.5, elsewhere=0.2, psnr={"0": 30.0, "1": 29.0})
AFTER = StretchFigures(excess=0.1, worst=0.2, elsewhere=0.2, psnr={"0": 30.0, "1": 29.5})


def made_up(project: Project, request: MendRequest) -> Callable[[JobContext], MendOutcome]:
    """Clip 1 with another number in it."""

    def work(context: JobContext) -> MendOutcome:
        context.report(0.5, "Fading")
        state = read_clip_state(project.clip_path(1))
        arrays = state.arrays | {"value": np.array([7.0], np.float32)}
        changed = ClipState(arrays, with_entries(state.header, rows_of=state.header.origin)).stamped()
        draft = project.folder / "draft.safetensors"
        write_clip_state(draft, changed)
        clip = MendedClip(1, state.header.fingerprint, changed.header.fingerprint)
        record = MendRecord("the seam at frame 3", 2, 4, (clip,), BEFORE, AFTER, (), "It jumps.", "", 1.0)
        return MendOutcome(record, put_in_place(project, record, {1: draft}))

    return work


@pytest.fixture
def session(make_session: Make, monkeypatch: pytest.MonkeyPatch) -> Session:
    """Two clips of three frames, both trained."""
    monkeypatch.setattr(mending, "mend_work", made_up)
    made = make_session()
    made.dispatch(SetClipLength(3))
    made.dispatch(TrainAll())
    poll_until(made, lambda: [clip.state for clip in made.clip_states] == ["trained", "trained"], what="the training")
    return made


def page_of(session: Session) -> MendPage:
    assert session.mending.page is not None
    return session.mending.page


def mend(session: Session) -> MendPage:
    session.dispatch(AskMend(after=1))
    session.dispatch(StartMend())
    poll_until(session, lambda: page_of(session).state != "running", what="the end of the mending")
    return page_of(session)


def fingerprint(session: Session, clip_index: int = 1) -> str:
    assert session.project is not None
    return read_clip_state(session.project.clip_path(clip_index)).header.fingerprint


def test_a_seam_is_asked_about_before_anything_happens(session: Session) -> None:
    before = fingerprint(session)
    session.dispatch(AskMend(after=1))
    page = page_of(session)
    assert (page.state, page.words, page.frame, page.clip_indices) == ("asking", "the seam at frame 3", 3, (0, 1))
    assert not page.why_not
    session.dispatch(CloseMend())
    assert session.mending.page is None
    assert fingerprint(session) == before


@pytest.mark.slow
def test_a_mended_clip_is_shown_compared_and_taken_back(session: Session) -> None:
    before = fingerprint(session)
    page = mend(session)
    assert (page.state, page.number, page.record.has_helped if page.record else None) == ("done", 1, True)
    after = fingerprint(session)
    assert after != before
    assert session.live_training.service is not None
    assert session.live_training.service.catalog[1].revision == f"trained-{after}", "it is shown at once"
    session.timeline.seek(0)
    session.dispatch(CompareMended())
    assert (session.overlays.compare, session.overlays.compare_with) == ("side", "version 1")
    assert session.timeline.frame_index == 3, "the clip that changed is looked at"
    session.dispatch(CompareMended())
    assert session.overlays.compare == "off"
    session.dispatch(CompareMended())
    session.dispatch(RevertMend())
    poll_until(session, lambda: page_of(session).state == "reverted", what="the way back")
    assert session.overlays.compare == "off"
    assert fingerprint(session) == before
    assert session.live_training.service.catalog[1].revision == f"trained-{before}"
    session.dispatch(RevertMend())  # once is enough
    assert page_of(session).state == "reverted"


@pytest.mark.slow
def test_what_was_picked_in_a_clip_is_not_lost_by_mending_it(session: Session) -> None:
    picked = Picked((PickedRows(1, fingerprint(session), "residual", pack_rows(np.arange(2))),))
    session.dispatch(AddEdit(Hide(), picked))
    before = fingerprint(session)
    mend(session)
    assert fingerprint(session) != before
    session.poll()
    assert (len(session.edits.edits), session.edits.lost) == (1, ())
    session.dispatch(RevertMend())
    poll_until(session, lambda: page_of(session).state == "reverted", what="the way back")
    assert session.edits.lost == ()


@pytest.mark.slow
def test_what_cannot_be_mended_says_why(session: Session, make_session: Make) -> None:
    session.dispatch(AskMend(after=2))
    assert "Clip 2 has no boundary" in list(session.notices)[-1].detail
    session.dispatch(AskMend(frames=(0, 3)))
    assert "reference clip" in page_of(session).why_not
    session.dispatch(StartMend())
    assert page_of(session).state == "asking"
    other = make_session(name="untrained")
    other.dispatch(SetClipLength(3))
    other.dispatch(AskMend(after=1))
    assert page_of(other).why_not == "Clip 0 is not trained, or out of date. Train it first."


def test_without_a_capture_there_is_nothing_to_mend(make_session: Make) -> None:
    session = make_session(is_open=False)
    for command in (AskMend(after=1), StartMend(), RevertMend(), CompareMended()):
        session.dispatch(command)
    assert {notice.title for notice in session.notices} == {"Mending cannot start"}
    session.dispatch(CloseMend())
    assert session.mending.page is None


def test_a_failure_is_told_in_its_place(session: Session, monkeypatch: pytest.MonkeyPatch) -> None:
    def failing(project: Project, request: MendRequest) -> Callable[[JobContext], MendOutcome]:
        def work(context: JobContext) -> MendOutcome:
            raise ProjectError("The disk is full.", hint="Make room.")

        return work

    monkeypatch.setattr(mending, "mend_work", failing)
    before = fingerprint(session)
    page = mend(session)
    assert (page.state, page.failure, page.hint) == ("asking", "The disk is full.", "Make room.")
    assert fingerprint(session) == before


def test_stopping_leaves_the_clips_as_they_were(session: Session, monkeypatch: pytest.MonkeyPatch) -> None:
    has_ended = threading.Event()

    def endless(project: Project, request: MendRequest) -> Callable[[JobContext], MendOutcome]:
        def work(context: JobContext) -> MendOutcome:
            try:
                while True:
                    context.report(0.5, "Fading")
                    has_ended.wait(0.001)
            except JobCancelled:
                has_ended.set()
                raise

        return work

    monkeypatch.setattr(mending, "mend_work", endless)
    before = fingerprint(session)
    session.dispatch(AskMend(after=1))
    session.dispatch(StartMend())
    assert page_of(session).state == "running"
    session.dispatch(AskMend(after=1))  # one at a time
    assert page_of(session).state == "running"
    session.dispatch(StopMend())
    assert page_of(session).state == "asking"
    assert has_ended.wait(DEADLINE_S)
    poll_until(session, lambda: session.mending.progress is None)
    assert fingerprint(session) == before


def test_stopping_too_late_shows_what_was_put_in_place(session: Session, monkeypatch: pytest.MonkeyPatch) -> None:
    may_go_on = threading.Event()

    def slow(project: Project, request: MendRequest) -> Callable[[JobContext], MendOutcome]:
        mended = made_up(project, request)

        def work(context: JobContext) -> MendOutcome:
            outcome = mended(context)
            may_go_on.wait(DEADLINE_S)
            return outcome

        return work

    monkeypatch.setattr(mending, "mend_work", slow)
    before = fingerprint(session)
    session.dispatch(AskMend(after=1))
    session.dispatch(StartMend())
    poll_until(session, lambda: fingerprint(session) != before, what="the mended clip")
    session.dispatch(StopMend())
    may_go_on.set()
    service = session.live_training.service
    assert service is not None
    revision = f"trained-{fingerprint(session)}"
    poll_until(session, lambda: service.catalog[1].revision == revision, what="the clip as it is now")


def test_clips_are_not_cut_or_copied_while_they_are_mended(
    session: Session, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    may_go_on = threading.Event()

    def slow(project: Project, request: MendRequest) -> Callable[[JobContext], MendOutcome]:
        def work(context: JobContext) -> MendOutcome:
            may_go_on.wait(DEADLINE_S)
            raise JobCancelled

        return work

    monkeypatch.setattr(mending, "mend_work", slow)
    session.dispatch(AskMend(after=1))
    session.dispatch(StartMend())
    session.dispatch(SplitClip(1, is_confirmed=True))
    assert len(session.clips) == 2
    assert "being mended" in list(session.notices)[-1].detail
    session.dispatch(SaveProjectAs(tmp_path / "copy"))
    assert "being mended" in list(session.notices)[-1].detail
    session.dispatch(StopMend())
    may_go_on.set()
    session.dispatch(SplitClip(1, is_confirmed=True))
    assert len(session.clips) == 3
    assert session.mending.page is None, "boundaries have other numbers now"


def test_nothing_is_mended_while_a_clip_trains(session: Session, monkeypatch: pytest.MonkeyPatch) -> None:
    session.dispatch(AskMend(after=1))
    monkeypatch.setattr(type(session.live_training), "is_busy", property(lambda live: True))
    session.dispatch(StartMend())
    assert (page_of(session).state, bool(page_of(session).why_not)) == ("asking", True)
