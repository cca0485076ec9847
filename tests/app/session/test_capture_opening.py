"""Opening a capture that has no project: what it is, what is asked, and what becomes of the answers."""

from __future__ import annotations

import shutil

import pytest

from app.project.opening.opening_answers import LastAnswers, OpeningAnswers
from app.project.opening.project_access import read_settings
from app.session.commands import CloseQuestion
from app.session.projects.project_commands import OpenCapture, OpenProject
from app.session.projects.settings import Settings
from app.session.training.train_commands import TrainNextClip
from tests.app.conftest import inline, poll_until
from tests.app.fakes import make_fake


def ask(session, folder):
    session.dispatch(OpenCapture(folder, is_asking=True))
    poll_until(session, lambda: session.opening.page is not None, what="the report")
    return session.opening.page


def test_a_capture_is_reported_and_nothing_is_made_before_the_answer(make_session, capture_folder, tmp_path):
    session = make_session(is_open=False)
    page = ask(session, capture_folder)
    assert len(page.report.cameras) == 4
    assert page.answers.holdout == ("0",)
    assert session.capture is None
    assert not (tmp_path / "p").exists()
    poll_until(session, lambda: len(session.opening.pictures) == 4, what="pictures of all cameras")
    assert session.opening.pictures[2].image.shape == (24, 32, 3)
    assert "hold out" not in [finding.kind for finding in session.opening.findings]  # that is asked beside it
    session.dispatch(CloseQuestion())
    assert session.opening.page is None
    assert session.opening.pictures == {}
    assert not (tmp_path / "p").exists()


def test_answers_make_the_project_and_are_offered_the_next_time(make_session, capture_folder, tmp_path):
    session = make_session(is_open=False)
    ask(session, capture_folder)
    answers = OpeningAnswers(frames=(1, 5), scale=0.5, clip_length=2, holdout=("2", "3"))
    session.dispatch(OpenCapture(capture_folder, answers=answers))
    assert session.opening.page is None
    poll_until(session, lambda: session.capture is not None, what="the capture")
    settings = read_settings(tmp_path / "p")
    assert (settings.frames, settings.scale, settings.clip_length) == ((1, 5), 0.5, 2)
    assert settings.holdout == ("2", "3")
    assert session.capture.n_frames == session.timeline.n_frames == 4
    assert len(session.clips) == 2
    assert tuple(session.rig.image_sizes[0]) == (16, 12)
    assert Settings(tmp_path / "settings.json").last_answers == LastAnswers(16, 2, is_holding_out=True)


@pytest.mark.slow
def test_frames_that_were_chosen_are_those_that_are_trained(make_session, capture_folder, tmp_path):
    jobs = []

    def launch(job, project):
        jobs.append(job)
        return inline(job, project, make_training=make_fake)

    session = make_session(is_open=False, launch=launch)
    session.dispatch(OpenCapture(capture_folder, answers=OpeningAnswers((2, 6), 1.0, 4, ("0",))))
    poll_until(session, lambda: session.capture is not None)
    session.dispatch(TrainNextClip())
    poll_until(session, lambda: session.clip_states[0].state == "trained")
    assert [job.frames for job in jobs] == [(2, 6)]
    session.close()
    again = make_session(is_open=False)
    again.dispatch(OpenProject(tmp_path / "p"))
    poll_until(again, lambda: again.capture is not None)
    assert again.capture.frames == (2, 6)


def test_a_capture_with_a_project_opens_without_a_question(make_session, capture_folder):
    make_session().close()
    session = make_session(is_open=False)
    session.dispatch(OpenCapture(capture_folder, is_asking=True))
    poll_until(session, lambda: session.capture is not None)
    assert session.opening.page is None


def test_why_a_folder_does_not_open_is_shown_instead_of_a_notice(make_session, tmp_path):
    session = make_session(is_open=False)
    (tmp_path / "empty").mkdir()
    session.dispatch(OpenCapture(tmp_path / "empty", is_asking=True))
    poll_until(session, lambda: session.opening.refused is not None)
    assert "not a capture" in session.opening.refused.message
    assert len(session.notices) == 0
    session.dispatch(CloseQuestion())
    assert session.opening.refused is None


def test_the_forecast_follows_the_answers_and_says_when_it_is_final(make_session, capture_folder):
    session = make_session(is_open=False)
    page = ask(session, capture_folder)
    poll_until(session, lambda: session.opening.forecast(page.answers)[1])
    found = session.opening.forecast(page.answers)[0]
    assert found.n_clips == 1
    other = OpeningAnswers((0, 4), 1.0, 2, ())
    poll_until(session, lambda: session.opening.forecast(other)[1])
    assert session.opening.forecast(other)[0].n_clips == 2


def test_what_was_asked_for_last_is_shown(make_session, capture_folder, tmp_path):
    second = shutil.copytree(capture_folder, tmp_path / "second")
    session = make_session(is_open=False)
    session.dispatch(OpenCapture(capture_folder, is_asking=True))
    session.dispatch(OpenCapture(second, is_asking=True))
    poll_until(session, lambda: session.opening.page is not None and not session.jobs)
    assert session.opening.page.report.path == second


def test_answers_that_are_not_possible_are_told_and_nothing_is_made(make_session, capture_folder, tmp_path):
    session = make_session(is_open=False)
    page = ask(session, capture_folder)
    answers = OpeningAnswers(None, 1.0, 6, ("0", "1", "2"))
    assert "Fewer than two" in session.opening.problem(answers)
    assert session.opening.problem(page.answers) == ""
    session.dispatch(OpenCapture(capture_folder, answers=answers))
    poll_until(session, lambda: len(session.notices) > 0)
    assert "leaves 1 for training" in session.notices[0].detail
    assert not (tmp_path / "p").exists()


def test_links_that_lead_outside_are_followed_once_they_are_allowed(make_session, capture_folder, tmp_path):
    session = make_session(is_open=False)
    folder = tmp_path / "linked"
    shutil.copytree(capture_folder, folder)
    (folder / "ims").rename(tmp_path / "another disk")
    (folder / "ims").symlink_to(tmp_path / "another disk")
    session.dispatch(OpenCapture(folder, is_asking=True))
    poll_until(session, lambda: session.opening.refused is not None)
    assert session.opening.refused.needs_links
    session.dispatch(OpenCapture(folder, follow_links=True, is_asking=True))
    poll_until(session, lambda: session.opening.page is not None)
    assert session.opening.refused is None
    assert session.opening.page.follow_links
