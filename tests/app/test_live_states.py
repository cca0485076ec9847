"""States of a running training as the window shows them: real snapshots, read, decoded and given back."""

import logging

import numpy as np
import pytest
from msgspec import to_builtins

from app.session.projects.setting_commands import SetClipLength
from app.session.showing.look_commands import SetFrame
from app.session.training.train_commands import TrainClip, TrainNextClip
from app.training.worker import keeper
from engine.backends.table import backend_called
from engine.clip_files.clip_state import read_clip_state
from engine.model.reading import load_clip_model
from tests.app.conftest import poll_until
from tests.app.fakes import DECODER, HEADS, N_ANCHORS, make_slow


@pytest.fixture
def live_session(make_session, monkeypatch):
    """A session whose reference clip trains for as long as anybody looks, with snapshots as often as they are read."""
    monkeypatch.setattr(keeper, "SNAPSHOT_EVERY_S", 0.0)
    monkeypatch.setattr(keeper, "SNAPSHOT_SHARE", 1.0)
    session = make_session(make_training=make_slow)
    session.dispatch(TrainNextClip())
    return session


def revision_of(session) -> str:
    shown = session.live_training.service.shown_state(0)
    return "" if shown is None else shown.revision


@pytest.mark.slow
def test_the_states_of_the_fake_training_are_those_of_a_clip(make_session):
    from engine.model import decoder

    assert decoder.HEADS == HEADS
    session = make_session()
    session.dispatch(SetClipLength(3))
    for index in (0, 1):
        session.dispatch(TrainClip(index))
    poll_until(session, lambda: all(state.state == "trained" for state in session.clip_states))
    reference, source = (read_clip_state(session.project.clip_path(i)) for i in (0, 1))
    assert to_builtins(reference.header.decoder) == DECODER
    for state, n_anchors in ((reference, N_ANCHORS), (source, 2 * N_ANCHORS)):
        gaussians = load_clip_model(state, reference, backend=backend_called("cpu")).decode(0.0)
        assert len(gaussians.means) == n_anchors
        assert all(bool(tensor.isfinite().all()) for tensor in gaussians.tensors())


def test_a_live_state_is_shown_and_given_back(live_session, caplog):
    session = live_session
    caplog.set_level(logging.INFO, logger="app.session.training.live_training")
    shown = []

    def is_another_shown() -> bool:
        found = session.shown_gaussians()
        if found is not None and found.key not in shown:
            shown.append(found.key)
        return len(shown) >= 3

    poll_until(session, is_another_shown, what="three live states")
    assert len(session.shown_gaussians().means) == N_ANCHORS
    assert np.isfinite(session.shown_gaussians().means).all()
    # the worker writes the next one only when the last was given back, and removes what came before it
    poll_until(session, lambda: revision_of(session) not in ("", "live-1-1", "live-1-2"))
    names = sorted(path.name for path in session.project.live_dir.iterdir())
    assert len(names) <= 2
    assert "clip-0000-r0001.safetensors" not in names
    assert "could not be read" not in caplog.text
    assert len(session.notices) == 0


def test_live_states_are_written_while_somebody_looks_at_the_clip(make_session, monkeypatch):
    monkeypatch.setattr(keeper, "SNAPSHOT_EVERY_S", 0.0)
    session = make_session(make_training=make_slow)
    session.dispatch(SetClipLength(3))
    session.dispatch(SetFrame(4))
    session.dispatch(TrainNextClip())
    poll_until(session, lambda: session.training.step > 5, what="steps")
    assert revision_of(session) in ("", "live-1-1"), "but for the first one, with which a training shows that it can"
    assert session.playback.decoder.worker.newest is None
    session.dispatch(SetFrame(0))
    poll_until(session, lambda: revision_of(session) == "live-1-3", what="snapshots")


def test_a_live_state_that_is_gone_costs_no_notice_and_the_next_one_is_shown(live_session, monkeypatch):
    session = live_session
    poll_until(session, lambda: revision_of(session) != "")
    poll_until(session, lambda: session.shown_gaussians() is not None, what="the first live state")
    session.playback.decoder.clear()  # so that the snapshot is read from its file again
    snapshot = session.live_training.service.shown_state(0).file
    snapshot.unlink()
    poll_until(session, lambda: session.live_training.service.shown_state(0).file != snapshot, what="the next snapshot")
    poll_until(session, lambda: session.wanted_frame().is_loaded, what="a live state after that")
    assert len(session.notices) == 0


def test_a_trained_state_that_is_gone_is_told(make_session):
    session = make_session()
    session.dispatch(TrainNextClip())
    poll_until(session, lambda: session.clip_states[0].state == "trained")
    session.playback.decoder.clear()
    session.project.clip_path(0).unlink()
    session.shown_gaussians()
    poll_until(session, lambda: any(notice.kind == "error" for notice in session.notices))
    assert session.notices[-1].kind == "error"


def test_states_of_a_clip_that_is_trained_again_have_names_of_their_own(make_session):
    """Each worker counts its snapshots from one; the picture of an old state must not pass for the new one."""
    session = make_session()
    session.dispatch(SetClipLength(3))
    names: list[set[str]] = []
    for _ in range(2):
        session.dispatch(TrainClip(0, is_confirmed=True))
        seen: set[str] = set()

        def is_done(seen: set[str] = seen) -> bool:
            seen.add(revision_of(session))
            return session.training.state == "idle"

        poll_until(session, is_done)
        names.append({name for name in seen if name.startswith("live-")})
    assert names[0]
    assert names[1]
    assert names[0].isdisjoint(names[1])
