"""The Session driven by commands, with training inline: no process, no wait, no window."""

import contextlib
import shutil
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from app.project.opening.project_access import open_project, read_settings
from app.session.commands import CloseQuestion, DismissNotice
from app.session.projects.project_commands import LeaveTraining, OpenCapture, OpenProject
from app.session.projects.setting_commands import SetClipLength, SetHoldout, SetPreset, SetTrainSetting
from app.session.questions import LeaveQuestion
from app.session.showing.look_commands import HomeView, LookThrough, SetCompare, SetFrame, ToggleOverlay, TogglePlay
from app.session.training.train_commands import PauseTraining, ResumeTraining, StopTraining, TrainClip, TrainNextClip
from app.status import PlanStatus
from engine.clip_files.clip_state import read_clip_state
from engine.training.presets import PRESETS
from tests.app.conftest import poll_until
from tests.app.fakes import N_STEPS, make_fake, make_slow


def train_next(session):
    index = session.training.next_clip_index
    session.dispatch(TrainNextClip())
    poll_until(session, lambda: session.training.state in ("idle", "failed"), what="the end of the training")
    return index


def test_a_fresh_session_is_empty_but_answers(make_session):
    session = make_session(is_open=False)
    assert session.capture is None
    assert session.poll() is False
    assert (session.clips, session.clip_states, session.training.state) == ((), [], "idle")
    assert session.shown_gaussians() is None
    assert session.shown_points() is None
    assert session.request_render(10, 10) is None
    for command in (
        TrainNextClip(),
        PauseTraining(),
        StopTraining(),
        SetFrame(5),
        TogglePlay(),
        HomeView(),
    ):
        session.dispatch(command)
    assert [notice.kind for notice in session.notices] == ["warn"]


def test_opening_makes_a_project_and_frames_the_rig(make_session, tmp_path):
    session = make_session()
    assert session.project.folder == tmp_path / "p"
    assert len(session.clips) == 1
    assert session.holdout == (0,)
    assert np.allclose(session.view.pivot, session.rig.focus_point())
    assert session.training.can_train_next
    assert session.training.next_clip_index == 0
    (recent,) = session.recent.entries
    assert (recent.folder, recent.capture) == (tmp_path / "p", str(session.capture.path.resolve()))


def test_what_is_not_a_capture_becomes_a_notice_and_leaves_nothing(make_session, tmp_path):
    session = make_session(is_open=False)
    (tmp_path / "empty").mkdir()
    session.dispatch(OpenCapture(tmp_path / "empty"))
    assert [job.name for job in session.jobs] == ["Opening"]
    poll_until(session, lambda: len(session.notices) > 0)
    assert session.notices[0].kind == "error"
    assert "not a capture" in session.notices[0].detail
    assert session.capture is None
    assert not (tmp_path / "p").exists()
    session.dispatch(DismissNotice(0))
    assert len(session.notices) == 0


def test_why_something_could_not_be_opened_goes_when_a_capture_opens(make_session, capture_folder, tmp_path):
    session = make_session(is_open=False)
    for name in ("empty", "x" * 5000):  # the second cannot even be looked for
        with contextlib.suppress(OSError):
            (tmp_path / name).mkdir()
        n_before = len(session.notices)
        session.dispatch(OpenCapture(tmp_path / name))
        poll_until(session, lambda n_before=n_before: len(session.notices) > n_before)
    assert ["cannot be opened" in notice.title for notice in session.notices] == [True, True]
    assert "File name too long" in session.notices[1].detail
    session.dispatch(OpenCapture(capture_folder))
    poll_until(session, lambda: session.capture is not None)
    assert len(session.notices) == 0


def test_links_outside_are_followed_when_the_user_says_so_and_then_by_the_project(
    make_session, capture_folder, tmp_path
):
    capture = tmp_path / "linked"
    shutil.copytree(capture_folder, capture)
    (capture / "ims").rename(tmp_path / "another disk")
    (capture / "ims").symlink_to(tmp_path / "another disk")
    session = make_session(is_open=False)
    session.dispatch(OpenCapture(capture))
    poll_until(session, lambda: len(session.notices) > 0)
    assert "--follow-links" in session.notices[0].hint
    session.dispatch(OpenCapture(capture, follow_links=True))
    poll_until(session, lambda: session.capture is not None)
    assert session.capture.follow_links
    session.document.settle()
    assert read_settings(session.project.folder).follow_links
    assert len(session.notices) == 0


def test_reference_then_next_clip(make_session):
    session = make_session()
    session.dispatch(SetClipLength(3))
    assert [state.state for state in session.clip_states] == ["untrained", "untrained"]
    assert train_next(session) == 0
    assert session.clip_states[0].state == "trained"
    assert session.clip_states[0].held_out_psnr == 20.0 + N_STEPS
    assert train_next(session) == 1
    assert [state.state for state in session.clip_states] == ["trained", "trained"]
    assert session.training.next_clip_index is None
    assert not session.training.can_train_next
    assert not list(session.project.live_dir.glob("*"))
    assert not list((session.project.folder / "checkpoints").glob("*.safetensors"))
    source = read_clip_state(session.project.clip_path(1))
    assert source.header.reference_fingerprint == read_clip_state(session.project.clip_path(0)).header.fingerprint


def test_a_source_clip_waits_for_its_reference(make_session):
    session = make_session()
    session.dispatch(SetClipLength(3))
    session.dispatch(TrainClip(1))
    assert "reference clip 0" in session.notices[0].detail
    assert session.training.state == "idle"
    session.dispatch(TrainClip(0))
    session.dispatch(TrainClip(1))  # now it is on its way
    assert session.clip_states[1].state == "queued"
    poll_until(session, lambda: all(state.state == "trained" for state in session.clip_states))


@pytest.mark.slow
def test_stopping_keeps_what_was_learned_and_training_goes_on_there(make_session):
    session = make_session(make_training=make_slow)
    session.dispatch(TrainNextClip())
    poll_until(session, lambda: session.training.step >= 3)
    session.dispatch(StopTraining())
    assert session.training.state == "stopping"
    poll_until(session, lambda: session.training.state == "idle")
    kept = session.project.checkpoint_path(0)
    step, value = read_clip_state(kept).header.step, float(read_clip_state(kept).arrays["value"][0])
    assert step >= 3
    assert (session.clip_states[0].state, session.clip_states[0].resume_step) == ("stopped", step)
    assert (session.training.next_clip_index, session.training.resume_step) == (0, step)
    n_left = 10_000_000 - step
    assert planned(session).summary.startswith(f"resumes at step {step:,}, {n_left:,} of 10,000,000 steps left, ")

    folder = session.project.folder
    session.close()
    again = make_session(make_training=partial(_until, n_steps=step + 2), name=folder.name)
    assert again.clip_states[0].state == "stopped"
    train_next(again)
    trained = read_clip_state(again.project.clip_path(0))
    assert trained.header.step == step + 2
    expected = (value * 0.5 + step + 1) * 0.5 + step + 2  # the fake's recurrence, uninterrupted
    assert float(trained.arrays["value"][0]) == pytest.approx(expected, rel=1e-6)


def _until(job, store, report, *, n_steps):
    training = make_fake(job, store, report)
    training.n_steps = n_steps
    return training


def test_pausing_holds_the_steps_and_resuming_goes_on(make_session):
    session = make_session(make_training=make_slow)
    session.dispatch(TrainNextClip())
    poll_until(session, lambda: session.training.state == "running")
    session.dispatch(PauseTraining())
    assert session.training.state == "paused"
    for _ in range(3):
        session.poll()
    held = session.project.checkpoint_path(0)
    step = read_clip_state(held).header.step
    for _ in range(20):
        session.poll()
    assert read_clip_state(held).header.step == step
    assert session.training.state == "paused"
    session.dispatch(ResumeTraining())
    poll_until(session, lambda: session.training.step > step, what="steps after the pause")


def test_closing_keeps_a_running_training(make_session, tmp_path):
    session = make_session(make_training=make_slow)
    session.dispatch(TrainNextClip())
    poll_until(session, lambda: session.training.step >= 2)
    session.close()
    project = open_project(tmp_path / "p")  # also shows that the lock was given back
    assert read_clip_state(project.checkpoint_path(0)).header.step >= 2
    project.close()


def test_a_failed_training_is_told_and_can_be_tried_again(make_session):
    session = make_session()
    session.project.update(replace(session.project.settings, overrides={"static_steps": 4}))  # the fake fails there
    train_next(session)
    assert session.training.state == "failed"
    assert "nan at step 5" in session.notices[-1].detail
    assert session.notices[-1].hint == "Lower the rates."
    assert session.clip_states[0].state == "failed"
    assert read_clip_state(session.project.checkpoint_path(0)).header.step == 4
    session.project.update(replace(session.project.settings, overrides={}))
    assert session.training.can_train_next
    train_next(session)
    assert session.clip_states[0].state == "trained"


def test_training_the_reference_again_makes_source_clips_stale(make_session):
    session = make_session()
    session.dispatch(SetClipLength(3))
    train_next(session)
    train_next(session)
    session.project.update(replace(session.project.settings, overrides={"joint_steps": 9}))  # another result
    session.dispatch(TrainClip(0, is_confirmed=True))
    poll_until(session, lambda: session.training.state == "idle")
    assert [state.state for state in session.clip_states] == ["trained", "stale"]
    assert session.training.next_clip_index == 1


@pytest.mark.slow
@pytest.mark.parametrize("goes_on", [True, False])
def test_training_a_clip_again_makes_those_stale_that_went_on_from_it(make_session, goes_on):
    session = make_session()
    session.dispatch(SetClipLength(2))
    overrides: dict[str, object] = {"field": "continue"} if goes_on else {}
    session.document.settle()
    session.project.update(replace(session.project.settings, overrides=overrides))
    n_clips = len(session.clip_states)
    assert n_clips >= 3
    for _ in range(n_clips):
        train_next(session)
    assert {state.state for state in session.clip_states} == {"trained"}
    session.project.update(replace(session.project.settings, overrides=overrides | {"joint_steps": 9}))
    session.dispatch(TrainClip(1, is_confirmed=True))
    poll_until(session, lambda: session.training.state == "idle")
    later = "stale" if goes_on else "trained"
    assert [state.state for state in session.clip_states] == ["trained", "trained"] + [later] * (n_clips - 2)


@pytest.mark.slow
@pytest.mark.parametrize("ends_by", ["stopping", "failing"])
def test_training_again_leaves_the_finished_clip_and_its_curves_until_it_is_finished(make_session, ends_by):
    session = make_session()
    train_next(session)
    kept = {path: path.read_bytes() for path in (session.project.clip_path(0), session.project.metrics_path(0))}
    psnr, history = session.clip_states[0].held_out_psnr, list(session.training.psnr_history)
    folder = session.project.folder
    session.close()
    slow = make_slow if ends_by == "stopping" else partial(_fails_at, step=3)
    session = make_session(make_training=slow, name=folder.name)
    poll_until(session, lambda: session.training.psnr_history == history, what="the curve on disk")
    session.dispatch(TrainClip(0, is_confirmed=True))
    assert session.training.psnr_history == history  # the picture is that of the finished clip as well
    assert session.clip_states[0].held_out_psnr == psnr
    if ends_by == "stopping":
        poll_until(session, lambda: session.training.step >= 3)
        assert session.training.psnr_history != history
        session.dispatch(StopTraining())
    poll_until(session, lambda: session.training.state in ("idle", "failed"))
    assert {path: path.read_bytes() for path in kept} == kept
    status = session.clip_states[0]
    assert (status.state, status.held_out_psnr) == ("trained", psnr)
    assert status.resume_step is not None
    poll_until(session, lambda: session.training.psnr_history == history, what="the curve of the finished clip")
    session.close()
    session = make_session(make_training=partial(_until, n_steps=status.resume_step + 2), name=folder.name)
    session.dispatch(TrainClip(0, is_confirmed=True))
    poll_until(session, lambda: session.training.state == "idle")
    assert session.clip_states[0].resume_step is None
    steps = [step for step, _ in session.training.psnr_history]
    assert steps == sorted(steps)
    assert steps[-1] == status.resume_step + 2  # one curve, from before the stop to the end
    assert not session.project.unfinished_metrics_path(0).exists()


def _fails_at(job, store, report, *, step):
    training = make_fake(job, store, report)
    training.fails_at = step
    return training


def test_what_was_learned_fixes_clip_length_and_hold_out(make_session):
    session = make_session()
    session.dispatch(SetHoldout((1,)))
    assert session.holdout == (1,)
    session.document.settle()
    assert read_settings(session.project.folder).holdout == ("1",)
    session.dispatch(SetHoldout((0, 1, 2)))
    assert "leaves 1 for training" in session.notices[-1].detail
    assert session.holdout == (1,)
    train_next(session)
    session.dispatch(SetClipLength(2))
    assert "fixed once one is finished; there is 1 trained clip" in session.notices[-1].detail
    assert session.project.settings.clip_length == 6


def planned(session) -> PlanStatus:
    """The plan with its figures, which a thread makes."""
    poll_until(session, lambda: session.plan is not None and session.plan.summary != "", what="the plan")
    return session.plan


def test_the_next_clip_has_a_plan_that_follows_the_settings(make_session):
    session = make_session()
    session.dispatch(SetClipLength(3))
    before = planned(session)
    assert (before.clip_index, before.preset, before.can_edit) == (0, "small", True)
    assert before.summary.startswith("1,500 steps, ")
    assert {setting.name: setting.value for setting in before.settings}["joint_steps"] == 1200
    session.dispatch(SetTrainSetting("joint_steps", 50))
    assert session.plan.summary == ""  # the old figures would be wrong
    after = planned(session)
    assert after.summary.startswith("350 steps, ")
    (changed,) = [setting for setting in after.settings if setting.is_set]
    assert (changed.name, changed.value) == ("joint_steps", 50)
    session.document.settle()
    assert read_settings(session.project.folder).overrides == {"joint_steps": 50}
    session.dispatch(SetTrainSetting("joint_steps", 0))  # derived again
    session.document.settle()
    assert read_settings(session.project.folder).overrides == {}
    assert planned(session) == before


@pytest.mark.parametrize("name", list(PRESETS))
def test_a_preset_takes_the_place_of_what_was_set(make_session, name):
    session = make_session()
    session.dispatch(SetTrainSetting("joint_steps", 50))
    session.dispatch(SetPreset(name))
    assert session.project.settings.overrides == PRESETS[name]
    assert session.plan.preset == name


@pytest.mark.parametrize(
    ("command", "expected"),
    [
        (SetTrainSetting("joint_steps", -1), "joint_steps is -1"),
        (SetTrainSetting("speed", 3), "no training setting called speed"),
        (SetPreset("huge"), "no preset called 'huge'"),
    ],
)
def test_a_setting_that_cannot_be_is_told_and_changes_nothing(make_session, command, expected):
    session = make_session()
    session.dispatch(command)
    assert expected in session.notices[-1].detail
    assert session.project.settings.overrides == {}


def test_what_was_learned_fixes_the_training_settings(make_session):
    session = make_session()
    session.dispatch(SetClipLength(3))
    session.dispatch(TrainNextClip())
    assert session.plan is None  # something trains
    poll_until(session, lambda: session.clip_states[0].state == "trained", what="the clip")
    found = planned(session)
    assert (found.clip_index, found.can_edit) == (1, False)
    assert any(name == "source steps" for name, _ in found.lines)
    session.dispatch(SetPreset("toy"))
    assert "fixed" in session.notices[-1].detail
    assert session.project.settings.overrides == {}


def test_a_damaged_checkpoint_is_told_and_training_starts_over(make_session):
    session = make_session()
    path = session.project.checkpoint_path(0)
    path.parent.mkdir()
    path.write_bytes(b"not a checkpoint")
    train_next(session)
    assert session.clip_states[0].state == "trained"
    assert any("from the beginning" in notice.title for notice in session.notices)


def test_curves_come_back_after_a_restart(make_session):
    session = make_session()
    train_next(session)
    history = list(session.training.psnr_history)
    assert history[-1] == (N_STEPS, 20.0 + N_STEPS)
    session.close()
    again = make_session()
    assert again.clip_states[0].held_out_psnr == history[-1][1]
    assert again.clip_states[0].state == "trained"


def test_pictures_of_the_cameras_arrive(make_session):
    session = make_session()
    poll_until(session, lambda: session.ground_truth(1, 2, 16) is not None)
    assert session.ground_truth(1, 2, 16).image.shape == (12, 16, 3)
    poll_until(session, lambda: session.ground_truth(1, 2, 640) is not None)
    picture = session.ground_truth(1, 2, 640)
    assert np.array_equal(picture.image, session.capture.frame(1, 2))
    assert not picture.is_stale
    stale = session.ground_truth(1, 3, 640)
    assert stale.is_stale
    assert stale.key == picture.key


def test_there_is_something_to_see_before_and_after_training(make_session):
    session = make_session()
    poll_until(session, lambda: session.shown_points() is not None)
    points, colors, _ = session.shown_points()
    assert points.shape == colors.shape
    assert session.shown_points().is_hint
    session.dispatch(LookThrough(1))
    assert session.shown_points() is None  # the captured picture says more
    session.dispatch(LookThrough(None))
    session.dispatch(SetClipLength(3))
    train_next(session)
    session.dispatch(SetFrame(5))
    poll_until(session, lambda: session.shown_points() is not None and not session.shown_points().is_hint)
    assert len(session.shown_points().points) == 12


def test_the_hint_lies_where_the_cameras_see_it(make_session):
    session = make_session()
    poll_until(session, lambda: session.shown_points() is not None)
    points, colors, _ = session.shown_points()
    rig, n = session.rig, len(points) // len(session.rig)
    for camera in range(len(rig)):
        own = points[camera * n : (camera + 1) * n]
        p_camera = own @ rig.world_to_camera[camera, :3, :3].T + rig.world_to_camera[camera, :3, 3]
        pixels = p_camera @ rig.Ks[camera].T
        pixels = (pixels[:, :2] / pixels[:, 2:]).astype(int)  # the pictures are not downsized here: one point a pixel
        truth = session.capture.frame(camera, 0)[pixels[:, 1], pixels[:, 0]] / 255
        assert np.abs(truth - colors[camera * n : (camera + 1) * n]).max() < 1e-6


def test_a_project_that_another_program_writes_to_opens_for_reading(make_session, capture_folder):
    first = make_session()
    second = make_session()
    assert first.training.can_train_next
    assert not second.training.can_train_next
    assert "read-only" in second.notices[0].title
    second.dispatch(TrainNextClip())
    assert "read-only" in second.notices[-1].detail
    assert second.training.state == "idle"


def test_a_project_folder_opens_by_itself(make_session, tmp_path):
    first = make_session()
    train_next(first)
    first.close()
    session = make_session(is_open=False)
    session.dispatch(OpenProject(tmp_path / "p"))
    poll_until(session, lambda: session.capture is not None)
    assert session.clip_states[0].state == "trained"


def test_opening_another_capture_keeps_a_running_training(make_session, tmp_path, capture_folder):
    session = make_session(make_training=make_slow)
    session.dispatch(TrainNextClip())
    poll_until(session, lambda: session.training.step >= 2)
    first = session.project
    session.projects.opener.project_dir = tmp_path / "q"
    session.dispatch(OpenCapture(capture_folder))
    poll_until(session, lambda: session.question is not None, what="the question")
    assert isinstance(session.question, LeaveQuestion)
    assert (session.question.name, session.question.clip_index, session.question.step >= 2) == ("q", 0, True)
    session.dispatch(CloseQuestion())
    assert session.training.state == "running"
    assert session.project is first
    assert not (tmp_path / "q").exists()  # the project that was made for it is gone
    session.dispatch(OpenCapture(capture_folder))
    poll_until(session, lambda: session.question is not None, what="the question")
    session.dispatch(LeaveTraining())
    poll_until(session, lambda: session.project.folder.name == "q" and not session.jobs)
    assert session.clip_states[0].state == "untrained"
    assert read_clip_state(first.checkpoint_path(0)).header.step >= 2
    assert not first.is_writable


def test_compare_overlays_and_views_follow_commands(make_session):
    session = make_session()
    session.dispatch(SetCompare("wipe"))
    session.dispatch(ToggleOverlay("show_points"))
    session.dispatch(LookThrough(2))
    session.dispatch(SetFrame(99))
    assert session.overlays.compare == "wipe"
    assert session.overlays.show_points is False
    assert np.array_equal(session.view.world_to_camera(), session.rig.world_to_camera[2])
    assert session.timeline.frame_index == 5
    with pytest.raises(ValueError, match="compare is one of"):
        session.dispatch(SetCompare("flip"))
    with pytest.raises(TypeError, match="not a command"):
        session.dispatch("SetFrame")
