"""The queue, versions, settings of one clip, forecast and live view through the session's commands."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from app.plan.forecasts import at_once, clip_forecast, together
from app.project.clips.clip_catalog import ClipRecord
from app.project.clips.clip_versions import version_path
from app.project.project import Project
from app.session.projects.setting_commands import SetClipLength
from app.session.projects.settings import Settings
from app.session.questions import RetrainQuestion, SettingsQuestion
from app.session.session import Session
from app.session.training.train_commands import (
    AskTrainSettings,
    MoveInQueue,
    RemoveFromQueue,
    RemoveVersion,
    RestoreVersion,
    SetLiveView,
    StopAfterClip,
    StopTraining,
    TrainAll,
    TrainClip,
    TrainClips,
    TrainNextClip,
)
from app.status import SequenceForecast
from app.training.service import TrainingService
from engine.clip_files.clip_state import read_clip_state
from engine.training.plan.plan import TrainingPlan
from tests.app.conftest import poll_until
from tests.app.fakes import N_STEPS, make_fake, make_slow

Make = Callable[..., Session]


@pytest.fixture
def session(make_session: Make) -> Session:
    """Six clips of one frame, nothing trained."""
    made = make_session()
    made.dispatch(SetClipLength(1))
    return made


def project_of(session: Session) -> Project:
    assert session.project is not None
    return session.project


def wait_idle(session: Session) -> None:
    poll_until(session, lambda: session.training.state in ("idle", "failed"), what="the end of the training")


def titles(session: Session) -> list[str]:
    return [notice.title for notice in session.notices]


def test_without_a_capture_every_command_is_told_that_there_is_nothing(make_session: Make) -> None:
    session = make_session(is_open=False)
    for command in (TrainAll(), TrainClips((0,)), MoveInQueue(0, 1), RestoreVersion(0, 1)):
        session.dispatch(command)
    assert set(titles(session)) == {"Nothing to train yet"}
    assert (session.queue.waiting, session.queue.everything) == ((), None)
    assert session.version_state(0, 1) is None
    assert session.clip_versions(0) == ()
    assert session.clip_curves(0) is None


@pytest.mark.slow
def test_all_clips_are_trained_with_a_forecast_for_the_whole_of_it(session: Session) -> None:
    poll_until(session, lambda: session.queue.everything is not None and session.queue.everything.n_steps > 0)
    everything = session.queue.everything
    assert everything is not None
    assert everything.n_clips == 6
    assert session.queue.queued is None
    session.dispatch(TrainAll())
    assert [clip.clip_index for clip in session.queue.waiting] == [1, 2, 3, 4, 5]
    assert session.queue.queued is not None
    assert session.queue.queued.n_clips == 6
    shares = [session.queue.progress]

    def is_done() -> bool:
        shares.append(session.queue.progress)
        return session.training.state == "idle"

    poll_until(session, is_done)
    assert session.queue.progress == 1.0
    assert session.queue.n_done == 6
    assert (session.queue.queued, session.queue.everything) == (None, None)
    assert {state.state for state in session.clip_states} == {"trained"}
    session.dispatch(TrainAll())
    assert titles(session)[-1] == "All of these clips are trained"


def test_the_forecast_goes_by_what_trained_clips_took(session: Session) -> None:
    session.dispatch(TrainClips((0, 1)))
    wait_idle(session)
    poll_until(session, lambda: session.queue.everything is not None and session.queue.everything.disk_mb is not None)
    everything = session.queue.everything
    assert everything is not None
    assert everything.n_clips == 4
    assert everything.seconds is not None
    size_mb = project_of(session).clip_path(1).stat().st_size / 1e6
    assert everything.disk_mb == pytest.approx(4 * size_mb, rel=0.2)
    assert session.queue.free_mb is not None


def test_a_stopped_clip_counts_with_what_is_left_of_it() -> None:
    plan = TrainingPlan(1, 0, 1, "source", 100, (), 5.0, 40.0, 1.0, 2.0)
    assert clip_forecast(plan, ClipRecord()) == SequenceForecast(1, 100, 45.0, 2.0)
    stopped = ClipRecord("stopped", resume_step=150, resume_n_steps=200)
    assert clip_forecast(plan, stopped) == SequenceForecast(1, 50, 10.0, 2.0)
    assert clip_forecast(plan, stopped, begins_afresh=True) == SequenceForecast(1, 100, 45.0, 2.0)
    unknown = clip_forecast(replace(plan, training_s=None), ClipRecord())
    assert unknown == SequenceForecast(1, 100, None, 2.0)
    parts = [SequenceForecast(1, 100, 45.0, 2.0), unknown, SequenceForecast(1, 50, 5.0, 1.0)]
    assert together(parts) == SequenceForecast(3, 250, None, 5.0)
    assert together([together([]), parts[0]]) == parts[0]


def test_clips_side_by_side_take_as_long_as_their_speeds_say() -> None:
    alone_s, rest_s = {1: 50.0, 2: 50.0}, {index: 100.0 for index in range(3, 7)}
    needs = {index: (0,) for index in (1, 2, *rest_s)}
    assert at_once({1: 80.0, 2: 70.0}, alone_s, rest_s, needs, 2) == 80.0 + 2 * 150.0, "half as long again as alone"
    assert at_once({1: None, 2: None}, alone_s, rest_s, needs, 2) == 500.0, "not known yet: as one after the other"
    assert at_once({1: 80.0}, {1: 50.0}, rest_s, needs, 1) == 480.0
    assert at_once({1: 80.0, 2: 70.0}, alone_s, {}, needs, 2) == 80.0, "the last one ends it"
    assert at_once({}, {}, rest_s, needs, 1) == 400.0
    assert at_once({0: 30.0}, {0: 20.0}, rest_s, needs, 2) == 430.0, "the reference clip comes alone"
    assert at_once({1: 80.0}, alone_s, rest_s | {7: None}, needs, 1) is None


def test_waiting_clips_are_reordered_taken_out_and_held(session: Session) -> None:
    session.dispatch(TrainAll())
    session.dispatch(MoveInQueue(5, 0))
    session.dispatch(RemoveFromQueue(2))
    assert [clip.clip_index for clip in session.queue.waiting] == [5, 1, 3, 4]
    session.dispatch(StopAfterClip())
    assert session.queue.is_ending_after
    wait_idle(session)
    assert session.queue.is_held
    assert session.training.next_clip_index == 5
    session.dispatch(TrainNextClip())
    assert session.training.clip_index == 5
    session.dispatch(StopTraining())
    wait_idle(session)
    assert session.queue.waiting == ()


def test_a_clip_moved_before_what_it_needs_waits_no_more(session: Session) -> None:
    session.document.settle()
    project_of(session).update(replace(project_of(session).settings, overrides={"field": "continue"}))
    session.dispatch(TrainAll())
    session.dispatch(RemoveFromQueue(2))
    assert [clip.clip_index for clip in session.queue.waiting] == [1]
    assert titles(session)[-1] == "Clips 3, 4, 5 left the queue: they need a clip that is not trained"


@pytest.mark.slow
def test_a_failed_clip_shows_its_reason_and_the_others_go_on(make_session: Make) -> None:
    def fails(job, store, report):
        training = make_fake(job, store, report)
        training.fails_at = 1 if job.clip_index == 1 else None
        return training

    session = make_session(make_training=fails)
    session.dispatch(SetClipLength(2))
    session.dispatch(TrainAll())
    wait_idle(session)
    assert [state.state for state in session.clip_states] == ["trained", "failed", "trained"]
    ((index, reason),) = session.queue.failed
    assert index == 1
    assert "nan at step 2" in reason
    assert "Training failed" in titles(session)


@pytest.mark.slow
def test_training_a_clip_with_other_settings_asks_what_has_to_be_known(session: Session) -> None:
    session.dispatch(TrainAll())
    wait_idle(session)
    session.dispatch(AskTrainSettings(0))
    question = session.question
    assert isinstance(question, SettingsQuestion)
    assert question.retrain is not None
    assert question.retrain.outdated == (1, 2, 3, 4, 5)
    values = {setting.name: setting.value for setting in question.settings}
    assert values["joint_steps"] == project_of(session).settings.config().n_joint_steps(3)
    session.dispatch(TrainClip(0, settings=(("joint_steps", 9),)))
    unconfirmed = session.question
    assert isinstance(unconfirmed, RetrainQuestion)
    assert unconfirmed.settings == (("joint_steps", 9),)
    session.dispatch(TrainClip(0, is_confirmed=True, settings=(("joint_steps", 9),)))
    assert session.question is None
    wait_idle(session)
    assert read_clip_state(project_of(session).clip_path(0)).header.step == 9
    assert {state.state for state in session.clip_states[1:]} == {"stale"}
    session.dispatch(TrainClip(1, settings=(("gate", "off"),)))
    assert "share gate" in session.notices[-1].detail
    session.dispatch(AskTrainSettings(99))
    assert "There is no clip 99" in session.notices[-1].detail


@pytest.mark.slow
def test_a_version_comes_back_and_dependants_are_out_of_date_as_after_training(session: Session) -> None:
    session.dispatch(TrainClips((0, 1)))
    wait_idle(session)
    assert session.clip_versions(0) == ()
    session.dispatch(TrainClip(0, is_confirmed=True, settings=(("joint_steps", 9),)))
    wait_idle(session)
    poll_until(session, lambda: len(session.clip_versions(0)) == 1, what="the versions")
    (version,) = session.clip_versions(0)
    assert (version.number, version.step, version.held_out_psnr) == (1, N_STEPS, 20.0 + N_STEPS)
    assert version.why_not == ""
    assert session.clip_states[1].state == "stale"
    shown = session.version_state(0, 1)
    assert shown is not None
    assert (shown.file, shown.reference_file) == (version_path(project_of(session), 0, 1), None)
    assert shown.revision.startswith("version-")
    session.dispatch(RestoreVersion(0, 1))
    session.dispatch(RestoreVersion(0, 1))  # a second click
    poll_until(session, lambda: not session.jobs, what="the version")
    assert titles(session)[-1] == "Clip 0 is restored"
    assert [state.state for state in session.clip_states[:2]] == ["trained", "trained"]
    assert read_clip_state(project_of(session).clip_path(0)).header.step == N_STEPS
    poll_until(session, lambda: [one.step for one in session.clip_versions(0)] == [9], what="the other version")
    session.dispatch(RestoreVersion(0, session.clip_versions(0)[0].number))
    poll_until(session, lambda: not session.jobs)
    assert "1 clip was trained on another version of it" in session.notices[-1].detail
    poll_until(session, lambda: [one.step for one in session.clip_versions(0)] == [N_STEPS])
    session.dispatch(RemoveVersion(0, session.clip_versions(0)[0].number))
    poll_until(session, lambda: not session.jobs and session.clip_versions(0) == ())


@pytest.mark.slow
def test_the_reference_does_not_change_under_a_clip_that_trains(make_session: Make) -> None:
    def slow_later(job, store, report):
        return make_fake(job, store, report) if job.clip_index == 0 else make_slow(job, store, report)

    session = make_session(make_training=slow_later)
    session.dispatch(SetClipLength(3))
    session.dispatch(TrainNextClip())
    wait_idle(session)
    session.dispatch(TrainClip(0, is_confirmed=True, settings=(("joint_steps", 9),)))
    wait_idle(session)
    session.dispatch(TrainClip(1))
    session.dispatch(RestoreVersion(0, 1))
    assert "Clip 1" in session.notices[-1].detail


def test_a_damaged_version_is_a_notice_and_the_clip_stays(session: Session) -> None:
    session.dispatch(TrainClip(0))
    wait_idle(session)
    session.dispatch(TrainClip(0, is_confirmed=True, settings=(("joint_steps", 9),)))
    wait_idle(session)
    path = version_path(project_of(session), 0, 1)
    path.unlink()
    path.write_bytes(b"\xff" * 50)
    poll_until(session, lambda: len(session.clip_versions(0)) == 1)
    assert "damaged" in session.clip_versions(0)[0].why_not
    assert session.version_state(0, 1) is None
    session.dispatch(RestoreVersion(0, 1))
    poll_until(session, lambda: not session.jobs)
    assert "could not be restored" in titles(session)[-1]
    assert session.clip_states[0].state == "trained"


def test_the_live_view_is_kept_for_the_next_time(session: Session, tmp_path) -> None:
    assert session.queue.live_view == "live"
    session.dispatch(SetLiveView("low"))
    assert session.queue.live_view == "low"
    assert Settings(tmp_path / "settings.json").live_view == "low"
    with pytest.raises(ValueError, match="off, low, live"):
        session.dispatch(SetLiveView("sometimes"))
    (tmp_path / "settings.json").write_text("not JSON")
    assert Settings(tmp_path / "settings.json").live_view == "live"


def test_the_log_holds_what_program_and_training_said(session: Session) -> None:
    path = project_of(session).log_path(0)
    path.parent.mkdir(exist_ok=True)
    path.write_text("2026-01-02 03:04:05,678 WARNING app.training.worker.run: the disk is full\n  more of it\n")
    poll_until(session, lambda: any(line.source == "clip 0" for line in session.log_lines()))
    lines = [line for line in session.log_lines() if line.source == "clip 0"]
    assert [(line.level, line.text) for line in lines] == [
        ("WARNING", "app.training.worker.run: the disk is full"),
        ("WARNING", "  more of it"),
    ]


def test_a_thousand_waiting_clips_are_queued_and_reordered_at_once(tmp_path, monkeypatch) -> None:
    from app.project.clips.clip_catalog import ClipCatalog
    from engine.capture.clip import split_clips
    from tests.app.made_projects import make_project

    project = make_project(tmp_path, overrides={"field": "continue"})
    service = TrainingService(project, split_clips(1000, 1), holdout=(), catalog=ClipCatalog(project, 1000))
    monkeypatch.setattr(service, "_start_waiting", lambda: None)
    calls = []
    config = type(project.settings).config
    monkeypatch.setattr(type(project.settings), "config", lambda settings: calls.append(1) or config(settings))
    assert service.enqueue_all(range(1000)) == []
    assert list(service.queue) == list(range(1000))
    service.queue.move(999, 0)
    assert service.drop_hopeless() == [999]
    assert len(calls) < 10, "settings are read once, and not for every clip"


def test_curves_of_several_clips_are_read(session: Session) -> None:
    session.dispatch(TrainClips((0, 1)))
    wait_idle(session)
    for index in (0, 1):
        poll_until(session, lambda index=index: session.clip_curves(index) not in (None, ([], [])))
    found = session.clip_curves(1)
    assert found is not None
    loss, psnr = found
    assert loss[-1][0] == N_STEPS
    assert psnr[-1] == (N_STEPS, 20.0 + N_STEPS)


def test_closing_ends_the_clip_that_trains_and_starts_no_other(make_session: Make) -> None:
    session = make_session(make_training=make_slow)
    session.dispatch(SetClipLength(1))
    session.dispatch(TrainAll())
    session.poll()
    session.close()
    assert session.live_training.service is not None
    assert not session.live_training.is_busy
    assert [path.name for path in project_of(session).folder.glob("checkpoints/*")] == ["0000.safetensors"]
