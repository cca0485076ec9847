"""Following the training, and training many clips at once."""

from app.session.editing.edit_commands import PutMarker
from app.session.projects.setting_commands import SetClipLength
from app.session.showing.look_commands import FollowTraining, SetFrame, TogglePlay
from app.session.training.train_commands import StopTraining, TrainClips
from tests.app.conftest import poll_until
from tests.app.fakes import make_slow


def all_trained(session) -> bool:
    return all(status.state == "trained" for status in session.clip_states)


def test_all_clips_are_trained_by_one_command_and_the_playhead_goes_along(make_session):
    session = make_session()
    session.dispatch(SetClipLength(2))
    session.dispatch(SetFrame(5))
    session.dispatch(FollowTraining())
    assert session.timeline.frame_index == 5, "nothing is trained yet"
    session.dispatch(TrainClips((2, 0, 1, 1)))
    visited = []

    def look() -> bool:
        visited.append(session.timeline.frame_index)
        return all_trained(session) and session.training.state == "idle"

    poll_until(session, look, what="the end of the training")
    assert [*dict.fromkeys(visited)] == [5, 0, 2, 4]
    assert session.timeline.is_following
    session.dispatch(SetFrame(3))
    assert not session.timeline.is_following
    session.dispatch(FollowTraining())
    assert session.timeline.frame_index == 4, "the clip that was finished last"
    session.dispatch(TogglePlay())
    assert not session.timeline.is_following
    session.dispatch(TrainClips((0, 1, 2)))
    assert [notice.title for notice in session.notices][-1] == "All of these clips are trained"
    assert session.training.state == "idle"


def test_inside_of_the_clip_that_is_followed_the_playhead_stays(make_session):
    session = make_session()
    session.dispatch(SetClipLength(3))
    session.dispatch(TrainClips((0,)))
    poll_until(session, lambda: session.clip_states[0].state == "trained")
    session.timeline.seek(2)
    session.dispatch(FollowTraining())
    assert session.timeline.frame_index == 2


def test_a_live_state_is_gone_to_as_soon_as_there_is_one(make_session):
    session = make_session(make_training=make_slow)
    session.dispatch(SetClipLength(2))
    session.dispatch(SetFrame(4))
    session.dispatch(FollowTraining())
    session.dispatch(TrainClips((0, 1, 2)))
    poll_until(session, lambda: session.timeline.frame_index == 0, what="the first live state")
    assert session.training.state == "running"
    assert session.training.queue == (1, 2)
    session.dispatch(StopTraining())


def test_clips_without_their_reference_are_trained_after_it(make_session):
    session = make_session()
    session.dispatch(SetClipLength(2))
    session.dispatch(TrainClips((77,)))
    assert session.training.state == "idle"
    session.dispatch(TrainClips((1, 2)))
    assert (session.training.clip_index, session.training.queue) == (0, (1, 2))


def test_another_clip_length_keeps_the_place_and_the_markers(make_session):
    session = make_session()
    session.dispatch(PutMarker(3, "foul"))
    session.timeline.seek(4)
    session.dispatch(SetClipLength(2))
    assert session.timeline.frame_index == 4
    assert session.timeline.markers.frames == [3]
