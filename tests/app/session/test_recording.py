"""The window follows a recording: its timeline grows, and clips train without anything being interrupted."""

from __future__ import annotations

import shutil
import time
from pathlib import Path

from app.session.captures.capture_commands import FollowRecording
from app.session.editing.edit_commands import Undo
from app.session.projects.project_commands import OpenCapture
from app.session.projects.setting_commands import SetClipLength
from app.session.training.train_commands import StopTraining
from app.training.recording.intake import Intake, TakenIn
from engine.capture.capture import open_capture
from engine.capture.growing.watch import END_FILE
from tests.app.conftest import poll_until
from tests.app.fakes import make_slow, write_capture
from tests.faults.record import Recorder


def record(folder: Path, n_before: int) -> Recorder:
    recorder = Recorder(open_capture(write_capture(folder / "source", n_frames=11)), folder / "c")
    for tick in range(n_before):
        recorder.write(tick)
    return recorder


def test_a_followed_recording_grows_in_the_window(make_session, tmp_path: Path) -> None:
    recorder, session = record(tmp_path, 4), make_session(is_open=False)
    session.dispatch(OpenCapture(tmp_path / "c"))
    poll_until(session, lambda: session.capture is not None)
    session.dispatch(SetClipLength(3))
    session.dispatch(FollowRecording())
    poll_until(session, lambda: session.recording_status.is_followed)
    assert session.project.settings.is_growing
    assert session.project.settings.config().backgrounds == "clip"
    assert [clip.n_frames for clip in session.clips] == [3], "a clip needs more than frame 3"
    poll_until(session, lambda: session.clip_states[0].state == "trained", what="the reference clip")
    for tick in range(4, 11):
        recorder.write(tick)
    poll_until(session, lambda: len(session.clips) == 3 and session.clip_states[2].state == "trained")
    assert session.timeline.n_frames == session.capture.n_frames == 9
    words = "waiting for frames 9 to 11: 11 are complete on all cameras"
    poll_until(session, lambda: session.recording_status.words == words)  # the last ones may come with a later look
    (tmp_path / "c" / END_FILE).touch()
    poll_until(session, lambda: not session.recording_status.is_followed)
    poll_until(session, lambda: len(session.clip_states) == 4 and session.clip_states[3].state == "trained")
    assert session.clips[3].n_frames == 2
    assert "The recording has ended" in [notice.title for notice in session.notices]
    assert [step.name for step in session.project.history.past] == ["change the clip length", "follow the recording"]
    session.close()

    again = make_session(is_open=False)
    again.dispatch(OpenCapture(tmp_path / "p"))
    poll_until(again, lambda: again.capture is not None)
    assert (again.capture.n_frames, len(again.clips)) == (11, 4)
    assert all(status.state == "trained" for status in again.clip_states)
    (tmp_path / "c" / END_FILE).unlink()
    longer = Recorder(open_capture(write_capture(tmp_path / "longer", n_frames=13)), tmp_path / "c")
    for tick in (11, 12):
        longer.write(tick)
    again.dispatch(FollowRecording())
    poll_until(again, lambda: not again.recording_status.is_followed)
    assert "seemed to have ended at frame 11, and clip 3 was trained" in str(list(again.notices)[-1])
    assert again.project.settings.frames == (0, 11)


def test_growing_interrupts_no_training_and_undo_takes_no_frames(make_session, tmp_path: Path) -> None:
    recorder, session = record(tmp_path, 3), make_session(is_open=False, make_training=make_slow)
    session.dispatch(OpenCapture(tmp_path / "c"))
    poll_until(session, lambda: session.capture is not None)
    session.dispatch(SetClipLength(3))
    session.dispatch(FollowRecording())
    poll_until(session, lambda: session.training.step > 0, what="a training")
    run = session.live_training.service.leading
    for tick in range(3, 7):
        recorder.write(tick)
    poll_until(session, lambda: len(session.clips) == 2)
    assert session.live_training.service.leading is run
    assert list(session.live_training.service.queue) == [1]
    session.dispatch(FollowRecording(is_wanted=False))
    assert not session.recording_status.is_followed
    session.dispatch(StopTraining())
    poll_until(session, lambda: not session.live_training.is_busy)
    session.dispatch(Undo())
    assert "cannot count as complete" in list(session.notices)[-1].detail
    assert session.project.settings.frames == (0, 6)


def test_nothing_is_lost_where_the_disk_is_slower_than_looks_are_wanted(make_session, tmp_path: Path, monkeypatch):
    take = Intake.take

    def slow(intake: Intake) -> TakenIn | None:
        time.sleep(0.02)
        return take(intake)

    monkeypatch.setattr(Intake, "take", slow)
    monkeypatch.setattr("app.session.captures.recording_follower.LOOK_EVERY_S", 0.0)
    monkeypatch.setattr("app.training.recording.intake.LOOK_EVERY_S", 0.0)
    recorder, session = record(tmp_path, 3), make_session(is_open=False)
    session.dispatch(OpenCapture(tmp_path / "c"))
    poll_until(session, lambda: session.capture is not None)
    session.dispatch(SetClipLength(3))
    session.dispatch(FollowRecording())
    poll_until(session, lambda: session.recording_status.is_followed)
    for tick in range(3, 11):
        recorder.write(tick)
    (tmp_path / "c" / END_FILE).touch()
    poll_until(session, lambda: not session.recording_status.is_followed)
    assert [clip.n_frames for clip in session.clips] == [3, 3, 3, 2]


def test_a_capture_that_is_gone_or_trained_otherwise_is_not_followed(make_session, tmp_path: Path) -> None:
    session = make_session(is_open=False)
    session.dispatch(FollowRecording())
    assert "No capture is open" in list(session.notices)[-1].detail
    record(tmp_path, 3)
    session.dispatch(OpenCapture(tmp_path / "c"))
    poll_until(session, lambda: session.capture is not None)
    shutil.rmtree(tmp_path / "c")
    session.dispatch(FollowRecording())
    poll_until(session, lambda: any("There is no such folder" in str(notice) for notice in session.notices))
    assert not session.recording_status.is_followed
    assert not session.project.settings.is_growing
