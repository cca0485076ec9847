"""Clips of an open project: split and merged with undo, what is asked before, stale ones, damage, room on the disk."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from app.project.clips.clip_versions import DAMAGED, version_path
from app.project.project import Project
from app.session.clips.clip_commands import (
    AskFreeSpace,
    CompareVersion,
    FreeSpace,
    MergeClips,
    SetReferenceClip,
    SplitClip,
)
from app.session.clips.clip_questions import CutQuestion, DamagedQuestion, RoomQuestion
from app.session.commands import CloseQuestion
from app.session.editing.edit_commands import Redo, Undo
from app.session.exclusions.exclusion_commands import ExcludeCameras, ExcludeFrames
from app.session.projects.setting_commands import SetClipLength
from app.session.session import Session
from app.session.showing.look_commands import SetCompare, SetFrame
from app.session.training.train_commands import RestoreVersion, TrainAll, TrainClip, TrainStale
from app.status import CAPTURED
from tests.app.conftest import poll_until
from tests.app.fakes import make_slow

Make = Callable[..., Session]


@pytest.fixture
def session(make_session: Make) -> Session:
    """Three clips of two frames, all trained."""
    made = make_session()
    made.dispatch(SetClipLength(2))
    train_all(made)
    return made


def train_all(session: Session) -> None:
    session.dispatch(TrainAll())
    poll_until(session, lambda: session.training.state in ("idle", "failed"), what="the end of the training")


def project_of(session: Session) -> Project:
    assert session.project is not None
    return session.project


def states(session: Session) -> list[str]:
    return [status.state for status in session.clip_states]


def titles(session: Session) -> list[str]:
    return [notice.title for notice in session.notices]


def test_frames_that_were_ready_under_other_cuts_do_no_harm(session: Session) -> None:
    session.dispatch(SplitClip(3, is_confirmed=True))
    session.dispatch(SetFrame(5))
    poll_until(session, lambda: 5 in [i for run in session.cached_frames() for i in range(*run)], what="frame 5")
    session.dispatch(Undo())
    session.poll()
    assert session.live_training.state_of(3) is None
    assert all(stop <= 6 for _, stop in session.cached_frames())


@pytest.mark.slow
def test_a_split_asks_and_undo_brings_the_trained_clip_back(session: Session) -> None:
    path = project_of(session).clip_path(1)
    before = path.read_bytes()
    session.dispatch(SplitClip(3))
    question = session.question
    assert isinstance(question, CutQuestion)
    assert (question.words, question.n_unused, question.outdated) == ("Split clip 1 at frame 3", 1, ())
    assert states(session) == ["trained"] * 3, "nothing was done yet"
    session.dispatch(SplitClip(3, is_confirmed=True))
    assert session.question is None
    assert [(clip.start, clip.stop) for clip in session.clips] == [(0, 2), (2, 3), (3, 4), (4, 6)]
    assert states(session) == ["trained", "untrained", "untrained", "trained"]
    assert session.timeline.clip_of(4) == session.clips[3]
    assert session.history.undo == "split clip 1 at frame 3"
    train_all(session)
    assert states(session) == ["trained"] * 4
    session.dispatch(Undo())
    assert states(session) == ["trained"] * 3
    assert project_of(session).clip_path(1).read_bytes() == before
    session.dispatch(Redo())
    assert states(session) == ["trained"] * 4, "what was trained of the halves is there again, too"


def test_a_merge_of_clips_that_are_not_trained_asks_nothing(make_session: Make) -> None:
    session = make_session()
    session.dispatch(SetClipLength(3))
    session.dispatch(MergeClips(0))
    assert session.question is None
    assert [clip.n_frames for clip in session.clips] == [6]
    session.dispatch(MergeClips(0))
    assert titles(session) == ["The clips cannot be changed"]


@pytest.mark.slow
def test_another_reference_makes_everything_stale_and_one_command_trains_it(session: Session) -> None:
    session.dispatch(SetReferenceClip(2))
    question = session.question
    assert isinstance(question, CutQuestion)
    assert (question.n_unused, question.outdated) == (0, (0, 1, 2))
    session.dispatch(SetReferenceClip(2, is_confirmed=True))
    assert (states(session), session.reference_index) == (["stale"] * 3, 2)
    poll_until(session, lambda: session.queue.stale is not None and session.queue.stale.n_steps > 0)
    assert session.queue.stale is not None
    assert session.queue.stale.n_clips == 3
    session.dispatch(TrainStale())
    poll_until(session, lambda: session.training.state == "idle")
    assert (states(session), session.queue.stale) == (["trained"] * 3, None)
    assert session.clip_dependencies(2).needed_by == (0, 1)
    assert session.clip_dependencies(2).trained_on_it == (0, 1)
    assert session.clip_dependencies(0).needs == (2,)


def test_clips_are_not_cut_while_one_trains(make_session: Make) -> None:
    session = make_session(make_training=make_slow)
    session.dispatch(SetClipLength(3))
    session.dispatch(TrainClip(0))
    session.dispatch(SplitClip(1, is_confirmed=True))
    assert [clip.start for clip in session.clips] == [0, 3]
    assert titles(session)[-1] == "The clips cannot be changed"


@pytest.mark.slow
def test_a_damaged_clip_is_offered_with_the_version_before_it(session: Session) -> None:
    project = project_of(session)
    session.dispatch(TrainClip(0, is_confirmed=True, settings=(("joint_steps", 9),)))
    poll_until(session, lambda: session.training.state in ("idle", "failed"))
    assert version_path(project, 0, 1).is_file(), titles(session)
    path = project.clip_path(0)
    path.unlink()  # whoever reads the file has it mapped, and would die of a shorter one
    path.write_bytes(b"damaged")
    assert session.live_training.service is not None
    session.live_training.service.catalog.update(0)
    poll_until(session, lambda: session.question is not None, what="the question")
    question = session.question
    assert isinstance(question, DamagedQuestion)
    assert (question.clip_index, question.version) == (0, 1)
    session.dispatch(CloseQuestion())
    session.poll()
    assert session.question is None, "it is asked once"
    session.dispatch(RestoreVersion(0, 1))
    poll_until(session, lambda: states(session)[0] == "trained")
    assert [found.read_bytes() for found in (project.folder / DAMAGED).iterdir()] == [b"damaged"]


@pytest.mark.slow
def test_room_is_asked_about_with_its_figure_and_then_made(session: Session) -> None:
    project = project_of(session)
    session.dispatch(TrainClip(0, is_confirmed=True, settings=(("joint_steps", 9),)))
    poll_until(session, lambda: session.training.state in ("idle", "failed"))
    poll_until(session, lambda: session.disk_use() is not None and session.disk_use().n_versions == 1)  # type: ignore[union-attr]
    session.dispatch(AskFreeSpace("versions"))
    poll_until(session, lambda: session.question is not None, what="the question")
    question = session.question
    assert isinstance(question, RoomQuestion)
    assert question.n_bytes >= version_path(project, 0, 1).stat().st_size
    session.dispatch(CloseQuestion())
    session.dispatch(FreeSpace("versions"))
    poll_until(session, lambda: not version_path(project, 0, 1).exists())
    poll_until(session, lambda: any("free now" in title for title in titles(session)))
    session.dispatch(AskFreeSpace("versions"))
    poll_until(session, lambda: "Nothing to free" in titles(session))


def test_a_version_is_put_beside_the_clip_at_the_same_frame(session: Session) -> None:
    session.dispatch(SetFrame(0))
    session.dispatch(CompareVersion(1, 7))
    overlays = session.overlays
    assert (session.timeline.frame_index, overlays.compare, overlays.compare_with) == (2, "side", "version 7")
    session.dispatch(SetCompare("blink"))
    session.dispatch(CompareVersion(1, 6))
    assert (overlays.compare, overlays.compare_with) == ("blink", "version 6")
    session.dispatch(CompareVersion(1, None))
    assert (overlays.compare, overlays.compare_with) == ("off", CAPTURED)


def test_exclusions_are_noted_at_trained_clips_and_taken_back(session: Session) -> None:
    session.dispatch(ExcludeFrames(2, 3, camera_index=1))
    notes = [status.reason for status in session.clip_states]
    assert (bool(notes[0]), "other pictures" in notes[1], states(session)) == (False, True, ["trained"] * 3)
    assert session.residual_status.n_all == 6 * 4 - 1
    session.dispatch(ExcludeCameras((2, 3)))
    assert titles(session)[-1] == "The exclusion cannot be changed", "too few would be left"
    session.dispatch(Undo())
    assert [status.reason for status in session.clip_states] == [""] * 3
