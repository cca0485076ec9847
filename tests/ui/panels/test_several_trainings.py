"""Several clips in training, here and elsewhere, through a real window: rows, buttons, keys, menus and log."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest
from imgui_bundle import imgui
from pyglet.window import key, mouse

from app.session.showing.look_commands import SetFrame
from app.session.training.train_commands import (
    JoinCluster,
    LeaveCluster,
    PauseTraining,
    ResumeTraining,
    SetWorkers,
    StopTraining,
)
from app.status import (
    ClipStatus,
    MachineStatus,
    QueueStatus,
    RunningClip,
    SequenceForecast,
    TrainingStatus,
    UsageStatus,
)
from tests.ui.fake_session import FakeSession
from tests.ui.pilot import CTRL, Pilot
from ui.panels.actions.table import ACTIONS
from ui.style.progress_words import running_words, whole_words

pytestmark = [pytest.mark.gl, pytest.mark.slow]
Open = Callable[..., Pilot]
HERE = RunningClip(0, "running", "desk", step=480, n_steps=1200, steps_per_s=31.0, eta_s=23.0, since_s=16.0, worker=1)
THERE = RunningClip(1, "paused", "lab-2 %s ##x", True, "Process 7 on lab-2", step=600, n_steps=1200)
THIRD = RunningClip(2, "preparing", "desk", stage="Finding what moves", worker=2)


def several() -> FakeSession:
    session = FakeSession()
    session.clip_states = [ClipStatus("training", 0.4), ClipStatus("paused", 0.5), ClipStatus("preparing")]
    session.training = TrainingStatus(
        state="running",
        clip_index=0,
        n_running=2,
        n_workers=2,
        step=480,
        n_steps=1200,
        trainings=(HERE, THERE, THIRD),
        machines=(
            MachineStatus("desk", True, 2, 2, 1.8, 3100.0),
            MachineStatus("lab-2 %s ##x", False, 1, 16),
        ),
    )
    session.queue = QueueStatus(queued=SequenceForecast(3, 2000, 4800.0), everything=SequenceForecast(3, 2000, 4800.0))
    session.usage = UsageStatus(410.0, 0.1, 1210.0, 1.8, 4)
    return session


@pytest.fixture
def pilot(open_pilot: Open) -> Pilot:
    made = open_pilot(several(), size=(1280, 1100))
    made.rest()
    return made


@pytest.mark.parametrize(("size", "width"), [((1280, 800), 344), ((900, 600), 270)])
def test_rows_and_computers_fit_the_panel(open_pilot: Open, size: tuple[int, int], width: int) -> None:
    pilot = open_pilot(several(), size=size)
    pilot.rest()
    rects = {name: rect for name, rect in pilot.rects.items() if name.startswith(("training.", "running."))}
    assert {
        "running.clip0",
        "running.resume1",
        "running.stop2",
        "running.computer1",
        "training.workers",
    } <= rects.keys()
    for name, rect in rects.items():
        assert size[0] - width <= rect.x0 <= rect.x1 <= size[0] - 4, name


def test_a_row_goes_to_its_clip_and_its_buttons_are_for_it_alone(pilot: Pilot) -> None:
    pilot.click("running.clip1")
    assert pilot.sent(SetFrame) == [SetFrame(pilot.session.clips[1].start)]
    pilot.click("running.pause0")
    pilot.click("running.resume1")
    pilot.click("running.stop2")
    assert pilot.sent(PauseTraining) == [PauseTraining(0)]
    assert pilot.sent(ResumeTraining) == [ResumeTraining(1)]
    assert pilot.sent(StopTraining) == [StopTraining(2)]


def test_the_usual_buttons_and_keys_are_for_all_that_trains_here(pilot: Pilot) -> None:
    pilot.click("training.pause")
    pilot.key(key.T)
    assert pilot.sent(PauseTraining) == [PauseTraining()] * 2
    paused = (replace(HERE, state="paused"), THERE, replace(THIRD, state="paused"))
    pilot.session.training = replace(pilot.session.training, trainings=paused)
    pilot.draw(2)
    pilot.key(key.T)
    pilot.click("training.resume")
    assert pilot.sent(ResumeTraining) == [ResumeTraining()] * 2
    pilot.key(key.T, modifiers=(CTRL,))
    assert pilot.sent(StopTraining) == [StopTraining()]


def test_actions_act_on_the_clip_at_the_playhead_and_on_all_computers(pilot: Pilot) -> None:
    session, ui, dispatch = pilot.session, pilot.studio.frame.ui, pilot.studio.frame.dispatch
    actions = {action.id: action for action in ACTIONS}

    def run(name: str) -> None:
        assert actions[name].why_not(session, ui) == ""
        actions[name].run(session, dispatch, ui)

    run("train.go_next")
    assert session.timeline.clip is session.clips[1], "from clip 0"
    run("train.pause_clip")
    run("train.stop_clip")
    run("train.pause_everywhere")
    assert pilot.sent(ResumeTraining) == [ResumeTraining(1)]
    assert pilot.sent(StopTraining) == [StopTraining(1)]
    assert pilot.sent(PauseTraining) == [PauseTraining(), PauseTraining(1)], "those here, and each elsewhere"
    session.training = replace(session.training, trainings=(HERE, THIRD))
    for name in ("train.pause_clip", "train.stop_everywhere"):
        assert actions[name].why_not(session, ui), name


def test_the_menu_of_a_clip_holds_it_and_shows_its_log(pilot: Pilot) -> None:
    pilot.tap(*pilot.rects["timeline.clip1"].center, mouse.RIGHT)
    pilot.click("clip menu.resume")
    pilot.tap(*pilot.rects["running.clip0"].center, mouse.RIGHT)
    pilot.click("clip menu.stop")
    assert (pilot.sent(ResumeTraining), pilot.sent(StopTraining)) == ([ResumeTraining(1)], [StopTraining(0)])
    pilot.tap(*pilot.rects["timeline.clip1"].center, mouse.RIGHT)
    pilot.click("clip menu.log")
    pilot.draw(4)
    assert pilot.session.log_clip == 1
    pilot.click("log.clip")
    pilot.draw(2)
    assert pilot.session.log_clip is None


def test_the_number_of_clips_at_once_is_chosen(pilot: Pilot) -> None:
    rect = pilot.rects["training.workers"]
    pilot.tap(rect.x1 - 8, rect.center[1])
    assert pilot.studio.frame.ui.preferences.n_workers == 2
    assert pilot.sent(SetWorkers) == [SetWorkers(2)]


def test_a_cluster_is_joined_by_its_address_and_left(open_pilot: Open) -> None:
    session = several()
    session.joining.can_join = True
    pilot = open_pilot(session, size=(1280, 1100))
    pilot.rest()
    pilot.click("training.cluster")
    pilot.draw(4)
    pilot.key(key.ENTER)
    assert pilot.sent(JoinCluster) == [], "nothing was typed"
    pilot.click("cluster.address")
    pilot.type("render:6379 ")
    pilot.click("cluster.join")
    assert pilot.sent(JoinCluster) == [JoinCluster("render:6379")]
    session.joining.address = "render:6379"
    pilot.draw(4)
    pilot.click("training.leave")
    assert pilot.sent(LeaveCluster) == [LeaveCluster()]


def test_a_band_tells_where_it_trains_and_how_fast(pilot: Pilot, monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[str] = []
    text = imgui.text_unformatted
    monkeypatch.setattr(imgui, "text_unformatted", lambda said: (told.append(said), text(said))[1])
    pilot.move(*pilot.rects["timeline.clip0"].center)
    pilot.draw(2)
    assert any("desk, worker 1: step 480 of 1,200, 31.0 steps/s, 0:23 left" in said for said in told)


def test_words_hold_what_is_known() -> None:
    assert running_words(RunningClip(0, "starting")) == "starting"
    assert running_words(THIRD, is_short=True) == "desk, worker 2: Finding what moves"
    status = replace(several().training, trainings=(HERE, THERE, THIRD))
    words = whole_words(40, status, QueueStatus(queued=SequenceForecast(9, 0, 4800.0)))
    assert words == "40 of 40 clips trained, 3 in training on 2 computers, about 1 h 20 min left"
    assert whole_words(40, TrainingStatus(), QueueStatus(everything=SequenceForecast(28))) == "12 of 40 clips trained"
