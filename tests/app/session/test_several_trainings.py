"""Several trainings of one session, some on another computer: their statuses, commands for one or all, and live states
for the clip that is looked at alone."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import pytest

from app.project.claims import claims
from app.project.claims.asks import take_ask
from app.project.claims.claim_files import CLAIMS, ClaimFile, holder_path, make_claim
from app.project.claims.holder_record import ClipProgress, HolderRecord, MachineLoad, machine_name, write_holder
from app.project.lock import this_process
from app.project.opening.opened_project import OpenedProject
from app.project.project import Project
from app.session.clips.clip_commands import ApplyDeletions
from app.session.projects.setting_commands import SetClipLength
from app.session.session import Session
from app.session.showing.look_commands import SetFrame
from app.session.training import places
from app.session.training.train_commands import (
    JoinCluster,
    LeaveCluster,
    PauseTraining,
    RestoreVersion,
    ResumeTraining,
    SetLiveView,
    SetWorkers,
    StopTraining,
    TrainClips,
    TrainNextClip,
)
from app.training import service as training_service
from app.training.messages import LoadReported, SetSnapshots, SnapshotNow, TrainJob
from app.training.process import Worker
from app.training.training_status import machines, running_clips
from app.training.worker import keeper
from engine.errors import ProjectError
from tests.app.conftest import DEADLINE_S, inline, poll_until
from tests.app.fakes import make_fake, make_slow, write_trained

Make = Callable[..., Session]


def slow_sources(job, store, report):
    return make_fake(job, store, report) if job.reference is None else make_slow(job, store, report)


@pytest.fixture
def session(make_session: Make, monkeypatch: pytest.MonkeyPatch) -> Session:
    """Six clips of one frame; the reference is trained, clips 1 and 2 train, and 3 waits. The playhead is in clip 1."""
    monkeypatch.setattr(places, "n_cores", lambda: 4)
    monkeypatch.setattr(keeper, "SNAPSHOT_EVERY_S", 0.0)
    monkeypatch.setattr(keeper, "SNAPSHOT_SHARE", 1.0)
    made = make_session(make_training=slow_sources)
    made.dispatch(SetClipLength(1))
    made.dispatch(TrainNextClip())
    poll_until(made, lambda: made.training.state == "idle" and made.clip_states[0].state == "trained")
    made.dispatch(SetFrame(1))
    made.dispatch(SetWorkers(2))
    made.dispatch(TrainClips((1, 2, 3)))
    poll_until(made, lambda: all(one.state == "running" for one in made.training.trainings))
    return made


def states(session: Session) -> dict[int, str]:
    return {one.clip_index: one.state for one in session.training.trainings}


def test_each_has_its_status_and_the_one_at_the_playhead_leads(session: Session) -> None:
    first, second = session.training.trainings
    assert (first.clip_index, second.clip_index, session.training.n_running) == (1, 2, 2)
    assert {first.worker, second.worker} == {1, 2}
    assert first.machine == second.machine != ""
    assert [status.state for status in session.clip_states[1:4]] == ["training", "training", "queued"]
    assert (session.training.clip_index, session.training.curve_clip_index) == (1, 1)
    session.dispatch(SetFrame(2))
    assert (session.training.clip_index, session.training.curve_clip_index) == (2, 2)
    session.dispatch(SetFrame(5))
    assert session.training.clip_index == 1, "the one that began first"


def test_one_or_all_are_paused_and_stopped(session: Session) -> None:
    session.dispatch(PauseTraining(2))
    assert states(session) == {1: "running", 2: "paused"}
    assert not session.training.is_paused
    session.dispatch(PauseTraining())
    assert session.training.is_paused
    session.dispatch(ResumeTraining(1))
    assert states(session) == {1: "running", 2: "paused"}
    session.dispatch(StopTraining(2))
    poll_until(session, lambda: 3 in states(session))
    assert session.clip_states[2].state == "stopped"
    session.dispatch(StopTraining())
    poll_until(session, lambda: not session.training.is_going)
    assert (session.training.trainings, session.training.queue) == ((), ())


def test_one_more_begins_at_once_and_none_is_ended_for_fewer(session: Session) -> None:
    session.dispatch(SetWorkers(3))
    assert sorted(states(session)) == [1, 2, 3]
    session.dispatch(SetWorkers(1))
    assert sorted(states(session)) == [1, 2, 3]
    session.dispatch(SetWorkers(1000))
    assert session.training.n_workers == 4, "a core each"


def test_as_many_train_as_memory_suffices_for(session: Session, monkeypatch: pytest.MonkeyPatch) -> None:
    poll_until(session, lambda: session.queue.everything is not None and session.queue.everything.n_steps > 0)
    monkeypatch.setattr(places, "free_memory_bytes", lambda: 0)
    session.dispatch(SetWorkers(4))
    assert session.training.n_workers == 2, "those that train have theirs"
    assert "4 clips side by side need" in session.training.why_fewer
    session.dispatch(SetWorkers(1))
    assert (session.training.n_workers, session.training.why_fewer) == (1, "")


def test_only_the_clip_at_the_playhead_is_shown_live(session: Session, monkeypatch: pytest.MonkeyPatch) -> None:
    live, service = session.live_training, session.live_training.service
    assert service is not None

    def shown(clip_index: int) -> str | None:
        state = live.state_of(clip_index)
        return None if state is None else state.revision

    poll_until(session, lambda: shown(1) is not None)
    for _ in range(50):
        session.poll()
    assert shown(2) is None, "nobody looks at it"
    sent: list[tuple[int, object]] = []
    for index, run in service.runs.items():
        send = run.worker.send
        monkeypatch.setattr(run.worker, "send", lambda c, i=index, s=send: (sent.append((i, c)), s(c))[1])
    session.dispatch(SetFrame(2))
    session.poll()
    asked = [(index, command) for index, command in sent if isinstance(command, SetSnapshots | SnapshotNow)]
    assert asked == [(1, SetSnapshots("off")), (2, SetSnapshots("live")), (2, SnapshotNow())]
    poll_until(session, lambda: shown(2) is not None)
    before = shown(1)
    for _ in range(50):
        session.poll()
    assert shown(1) == before
    sent.clear()
    session.dispatch(SetLiveView("low"))
    assert sent == [(2, SetSnapshots("low"))]


def test_while_it_plays_clips_that_pass_by_ask_for_nothing(session: Session) -> None:
    service = session.live_training.service
    assert service is not None
    session.poll()
    session.timeline.is_playing = True
    session.timeline.frame_index = 2
    session.poll()
    assert [run.live_view for run in service.runs.values()] == ["live", "off"]


def test_who_follows_the_training_sees_the_one_that_leads(session: Session) -> None:
    session.dispatch(SetFrame(5))
    session.timeline.is_following = True
    poll_until(session, lambda: session.timeline.frame_index == 1)
    service = session.live_training.service
    assert service is not None
    assert session.timeline.is_following
    assert service.running_clip == 1
    assert service.runs[1].live_view == "live", "what is followed is shown"


@pytest.fixture
def shared(make_session: Make, monkeypatch: pytest.MonkeyPatch) -> Session:
    """Six clips, the reference is trained. Nothing trains here, and clip 1 on another computer."""
    monkeypatch.setattr(claims, "LOOK_EVERY_S", 0.02)
    monkeypatch.setattr(claims, "DEAD_AFTER_S", float("inf"))  # nobody speaks for that computer again
    made = make_session()
    made.dispatch(SetClipLength(1))
    made.dispatch(TrainNextClip())
    poll_until(made, lambda: made.training.state == "idle" and made.clip_states[0].state == "trained")
    tell_of(made, ClipProgress(1, "running", "render-7", step=30, n_steps=60, steps_per_s=3.0, eta_s=10.0))
    poll_until(made, lambda: made.clip_states[1].state == "training")
    return made


def tell_of(session: Session, *clips: ClipProgress, beat: int = 1) -> None:
    """What a process of another computer says."""
    assert session.project is not None
    folder, keys = session.project.folder, [session.project.clip_name(clip.clip_index) for clip in clips]
    (folder / CLAIMS).mkdir(exist_ok=True)
    owner = replace(this_process(), host="render-7", machine="another", boot="another", pid=1)
    load = MachineLoad(16, 12.5, 3e4)
    record = HolderRecord("f" * 32, owner, beat=beat, load=load, clips=dict(zip(keys, clips, strict=True)))
    write_holder(holder_path(folder, record.token), record)
    for key in keys:
        make_claim(ClaimFile(folder, key, 1), record.token)


def test_computers_of_a_cluster_are_shown_with_their_own_load(session: Session) -> None:
    service = session.live_training.service
    assert service is not None
    service.runs[1].machine, service.runs[2].machine = "node-1", "node-2"
    service.runs[1]._take(LoadReported(MachineLoad(8, 3.0, 1e4)))
    tell_of(session, ClipProgress(4, "running", "node-3", load=MachineLoad(4, 0.5, 2e4)))
    service.claims.look()
    found = {
        one.name: (one.n_clips, one.n_cores, one.load, one.free_mb) for one in machines(service, running_clips(service))
    }
    del found[machine_name()]
    assert found == {"node-1": (1, 8, 3.0, 1e4), "node-2": (1, 0, None, None), "node-3": (1, 4, 0.5, 2e4)}
    assert service._described()[service.project.clip_name(1)].load == MachineLoad(8, 3.0, 1e4), "for other windows"


def test_a_clip_that_trains_elsewhere_is_shown_like_an_own_one(shared: Session) -> None:
    (one,) = shared.training.trainings
    assert (one.clip_index, one.machine, one.is_elsewhere, one.step, one.steps_per_s) == (1, "render-7", True, 30, 3.0)
    assert shared.clip_states[1].progress == 0.5
    here, there = shared.training.machines
    assert (here.is_here, there.name, there.n_clips, there.n_cores, there.load) == (True, "render-7", 1, 16, 12.5)
    assert shared.training.state == "idle", "nothing trains here"
    assert shared.training.next_clip_index == 2
    everything = shared.queue.everything
    assert everything is not None
    assert everything.n_clips == 5
    until_s = time.monotonic() + 0.5
    while time.monotonic() < until_s:  # nothing else is new by then
        until_s = time.monotonic() + 0.5 if shared.poll() else until_s
    tell_of(shared, ClipProgress(1, "paused", "render-7", step=31, n_steps=60), beat=2)
    poll_until(shared, lambda: shared.clip_states[1].state == "paused")


def test_its_process_is_asked_and_answers_are_not_waited_for(shared: Session) -> None:
    project = shared.project
    assert project is not None
    for command, ask in ((PauseTraining(1), "pause"), (ResumeTraining(1), "resume"), (StopTraining(1), "stop")):
        shared.dispatch(command)
        poll_until(shared, lambda: not shared.jobs)
        assert shared.notices[-1].title == f"Asked to {ask} clip 1"
        assert take_ask(project.folder, "0001") == ask
    shared.dispatch(StopTraining())
    poll_until(shared, lambda: not shared.jobs)
    assert not (project.folder / CLAIMS / "ask-0001.json").exists(), "all that trains here, not what others train"


def test_nothing_is_changed_under_what_trains_elsewhere(shared: Session) -> None:
    for command in (SetClipLength(2), ApplyDeletions(), RestoreVersion(0, 1)):
        shared.dispatch(command)
        assert "training" in shared.notices[-1].detail or "trains clip 1" in shared.notices[-1].detail, command
    shared.dispatch(TrainClips((1, 2)))
    poll_until(shared, lambda: shared.clip_states[2].state == "trained")
    assert shared.clip_states[1].state == "training", "not trained twice"


def test_it_appears_once_it_is_finished_there(shared: Session) -> None:
    opened, project = shared.opened, shared.project
    assert opened is not None
    assert project is not None
    write_trained(opened, 1)
    ClaimFile(project.folder, "0001", 1).path.unlink()
    poll_until(shared, lambda: shared.clip_states[1].state == "trained")
    assert shared.training.trainings == ()


class FakeCluster:
    """A cluster with room for three clips."""

    def __init__(self, opened: OpenedProject) -> None:
        self.n_slots, self.is_closed, self.begun = 3, False, list[int]()

    def launch(self, job: TrainJob, project: Project) -> Worker:
        self.begun.append(job.clip_index)
        return inline(job, project, slow_sources)

    def close(self) -> None:
        self.is_closed = True


def test_clips_train_on_a_cluster_from_when_it_is_joined(session: Session) -> None:
    joined: list[FakeCluster] = []

    def connect(address: str, opened: OpenedProject) -> FakeCluster:
        if address != "render:1":
            raise ProjectError(f"Nothing answers at {address}.")
        joined.append(FakeCluster(opened))
        return joined[-1]

    session.joining._connect = connect
    session.dispatch(JoinCluster("render:1"))
    assert "Clips are training" in session.notices[-1].detail
    session.dispatch(StopTraining())
    poll_until(session, lambda: not session.training.is_going)
    for address in ("nobody:1", "render:1"):
        session.dispatch(JoinCluster(address))
        poll_until(session, lambda: not session.jobs)
    assert [notice.title for notice in session.notices][-2:] == [
        "The cluster nobody:1 could not be joined",
        "Clips train on the cluster render:1",
    ]
    (cluster,) = joined
    session.dispatch(TrainClips((1, 2, 3, 4)))
    assert cluster.begun == [1, 2, 3]
    cluster.n_slots = 4
    poll_until(session, lambda: cluster.begun == [1, 2, 3, 4])
    session.dispatch(StopTraining())
    poll_until(session, lambda: not session.training.is_going)
    session.dispatch(LeaveCluster())
    poll_until(session, lambda: cluster.is_closed)
    assert (session.joining.address, session.training.n_workers) == ("", 2)


@pytest.fixture
def blocked(monkeypatch: pytest.MonkeyPatch) -> Iterator[threading.Event]:
    """The disk does not answer to claims that are taken and released before this is set."""
    may_go_on = threading.Event()

    def waiting(function: Callable[..., Any]) -> Callable[..., Any]:
        return lambda *arguments: may_go_on.wait(DEADLINE_S) and function(*arguments)

    monkeypatch.setattr(training_service, "PATIENCE_S", 0.0)
    monkeypatch.setattr(claims, "make_claim", waiting(claims.make_claim))
    monkeypatch.setattr(claims, "remove_claim", waiting(claims.remove_claim))
    yield may_go_on
    may_go_on.set()


def test_a_disk_that_does_not_answer_a_claim_holds_up_no_window(make_session: Make, blocked) -> None:
    made = make_session(make_training=make_fake)
    made.dispatch(SetClipLength(1))
    made.dispatch(TrainNextClip())
    for _ in range(5):
        made.poll()
    assert (made.training.n_running, made.training.queue, made.live_training.is_busy) == (0, (0,), True)
    blocked.set()
    poll_until(made, lambda: bool(made.training.n_running))
    blocked.clear()
    poll_until(made, lambda: made.clip_states[0].state == "trained" and not made.training.n_running)
    made.dispatch(TrainNextClip())
    made.poll()
    assert made.training.queue == (1,), "its claim waits for the release of the first"
    blocked.set()
    poll_until(made, lambda: made.clip_states[1].state == "trained")


@pytest.mark.parametrize("ending", ["stopped", "closed"])
def test_a_claim_that_comes_too_late_is_released(make_session: Make, blocked, ending: str) -> None:
    made = make_session(make_training=make_fake)
    project = made.live_training.opened_project.project
    made.dispatch(TrainNextClip())
    if ending == "stopped":
        made.dispatch(StopTraining())
        assert made.training.queue == ()
        blocked.set()
        poll_until(made, lambda: not made.live_training.is_busy)
    else:
        threading.Timer(0.2, blocked.set).start()
        made.close()
    until_s = time.monotonic() + DEADLINE_S
    while list((project.folder / CLAIMS).iterdir()):
        assert time.monotonic() < until_s
        time.sleep(0.01)
    assert not project.is_trained(0)
