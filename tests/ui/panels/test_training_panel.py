"""The training panel through a real window: queue by pointer, drag and keys, curves, versions, settings, the log."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from imgui_bundle import imgui
from pyglet.window import key, mouse

from app.background.log_reader import LogLine
from app.session.commands import CloseQuestion
from app.session.questions import OwnSetting, RetrainQuestion, SettingsQuestion
from app.session.training.train_commands import (
    AskTrainSettings,
    MoveInQueue,
    RemoveFromQueue,
    RemoveVersion,
    RestoreVersion,
    SetLiveView,
    StopAfterClip,
    TrainAll,
    TrainClip,
    TrainClips,
)
from app.status import (
    ClipStatus,
    QueuedClip,
    QueueStatus,
    SequenceForecast,
    TrainingStatus,
    UsageStatus,
    VersionStatus,
)
from tests.ui.fake_session import FakeSession
from tests.ui.pilot import CTRL, SHIFT, Pilot
from ui.panels.actions.clips.training import ACTIONS
from ui.panels.state import LOG
from ui.panels.timeline.clip_words import state_words
from ui.panels.training import training

pytestmark = [pytest.mark.gl, pytest.mark.slow]
Open = Callable[..., Pilot]


def history(n_steps: int, level: float) -> list[tuple[int, float]]:
    return [(step, level + 10.0 / (step + 10)) for step in range(0, n_steps + 1, 5)]


def busy_session() -> FakeSession:
    """Clip 0 is trained, clip 1 trains, clip 2 waits; of three waiting ones two are made up."""
    session = FakeSession()
    session.clip_states = [ClipStatus("trained", 1.0, 28.4), ClipStatus("training", 0.4), ClipStatus("queued")]
    session.training = TrainingStatus(
        state="running",
        clip_index=1,
        step=480,
        n_steps=1200,
        steps_per_s=31.0,
        eta_s=23.0,
        curve_clip_index=1,
        loss_history=history(480, 0.02),
        psnr_history=history(480, 25.0),
        queue=(2, 0, 5),
    )
    session.queue = QueueStatus(
        waiting=(QueuedClip(2, 1200, 41.0), QueuedClip(0, 1200, 40.0, True), QueuedClip(5, 1200, 39.0)),
        queued=SequenceForecast(4, 4320, 143.0, 2.4),
        everything=SequenceForecast(5, 5520, 180.0, 3.0),
        progress=0.3,
        n_done=1,
        free_mb=1e5,
    )
    session.usage = UsageStatus(410.0, 0.1, 1210.0, 1.8, 2)
    session.curves = {0: (history(3000, 0.01), history(3000, 27.0))}
    return session


@pytest.fixture
def busy(open_pilot: Open) -> Pilot:
    pilot = open_pilot(busy_session(), size=(1280, 1100))
    pilot.rest()
    return pilot


@pytest.mark.parametrize(("size", "width"), [((1280, 800), 344), ((900, 600), 270)])
def test_nothing_in_the_panel_is_wider_than_the_panel(open_pilot: Open, size: tuple[int, int], width: int) -> None:
    pilot = open_pilot(busy_session(), size=size)
    pilot.rest()
    rects = {name: rect for name, rect in pilot.rects.items() if name.startswith(("training.", "queue.", "curves."))}
    assert {"training.progress", "training.usage", "training.live.live", "queue.header"} <= rects.keys()
    for name, rect in rects.items():
        assert rect.x0 >= size[0] - width, name
        assert rect.x1 <= size[0] - 4, name


def test_waiting_clips_are_moved_and_taken_out_by_their_buttons(busy: Pilot) -> None:
    busy.click("queue.down2")
    busy.click("queue.up5")
    busy.click("queue.remove0")
    assert busy.sent(MoveInQueue) == [MoveInQueue(2, 1), MoveInQueue(5, 1)]
    assert busy.sent(RemoveFromQueue) == [RemoveFromQueue(0)]
    busy.click("queue.up2")
    busy.click("queue.down5")
    assert len(busy.sent(MoveInQueue)) == 2, "the first cannot come earlier, nor the last one later"


def test_a_waiting_clip_is_dragged_to_another_place(busy: Pilot) -> None:
    busy.drag(busy.rects["queue.clip5"].center, busy.rects["queue.clip2"].center, steps=8)
    assert busy.sent(MoveInQueue) == [MoveInQueue(5, 0)]


def test_keys_choose_move_and_remove_waiting_clips(busy: Pilot) -> None:
    busy.key(key.DOWN, modifiers=(CTRL, SHIFT))
    assert busy.sent(MoveInQueue) == [], "nothing was chosen: now the first one is"
    busy.key(key.N, modifiers=(SHIFT,))
    busy.key(key.DOWN, modifiers=(CTRL, SHIFT))
    busy.key(key.UP, modifiers=(CTRL, SHIFT))
    busy.key(key.DELETE, modifiers=(CTRL,))
    busy.key(key.DELETE, modifiers=(CTRL,))
    assert busy.sent(MoveInQueue) == [MoveInQueue(0, 2), MoveInQueue(0, 0)]
    assert busy.sent(RemoveFromQueue) == [RemoveFromQueue(0)]


def test_all_and_hold_and_live_view_by_button_and_key(busy: Pilot) -> None:
    busy.click("training.all")
    busy.key(key.T, modifiers=(SHIFT,))
    assert busy.sent(TrainAll) == [TrainAll(), TrainAll()]
    busy.click("queue.stop_after")
    busy.session.queue = replace(busy.session.queue, is_ending_after=True)
    busy.key(key.T, modifiers=(CTRL, SHIFT))
    assert busy.sent(StopAfterClip) == [StopAfterClip(True), StopAfterClip(False)]
    for mode in ("off", "low", "live"):
        busy.click(f"training.live.{mode}")
    assert [command.mode for command in busy.sent(SetLiveView)] == ["off", "low", "live"]


def test_a_failed_clip_is_tried_again(busy: Pilot) -> None:
    busy.session.queue = replace(busy.session.queue, failed=((4, "Broken at 50 % ##step\nof all"),))
    busy.draw(2)
    busy.click("queue.retry4")
    assert busy.sent(TrainClip) == [TrainClip(4)]


def test_curves_are_zoomed_moved_and_shown_whole_again(busy: Pilot) -> None:
    view = busy.studio.frame.ui.curves
    plot = busy.rects["training.psnr"]
    busy.move(plot.x0 + 0.6 * plot.width, plot.center[1])
    busy.wheel(3)
    assert view.span is not None
    low, high = view.span
    assert 0 < low < high < 1200
    assert high - low == pytest.approx(1200 * 0.8**3)
    x, y = busy.rects["training.loss"].center
    busy.drag((x, y), (x + 60, y))
    assert view.span is not None
    assert view.span[0] < low, "both plots share the steps; dragged to the right, earlier ones come"
    assert view.span[1] - view.span[0] == pytest.approx(high - low)
    busy.click("curves.all")
    assert view.span is None


def test_the_value_under_the_pointer_is_told(busy: Pilot, monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[str] = []
    text = imgui.text_colored
    monkeypatch.setattr(imgui, "text_colored", lambda color, said: (told.append(said), text(color, said))[1])
    plot = busy.rects["training.loss"]
    busy.move(plot.x0 + 0.3 * plot.width, plot.center[1])
    busy.draw(2)
    step = busy.studio.frame.ui.curves.pointer_step
    assert step is not None
    steps, values = map(np.asarray, zip(*busy.session.training.loss_history, strict=True))
    nearest = int(np.argmin(abs(steps - step)))
    assert f"{values[nearest]:.4f}" in told


def test_curves_of_several_clips_are_chosen(busy: Pilot) -> None:
    busy.click("curves.clips")
    busy.click("curves.clip0")
    busy.click("curves.clip1")
    busy.key(key.ESCAPE)
    busy.rest()
    view = busy.studio.frame.ui.curves
    assert view.chosen == [0, 1]
    before = busy.picture()
    busy.click("curves.log")
    assert view.is_log
    plot = busy.rects["training.loss"]
    inside = np.s_[round(plot.y0) : round(plot.y1), round(plot.x0) : round(plot.x1)]
    assert (busy.picture()[inside] != before[inside]).any(axis=2).mean() > 0.02


def test_the_menu_of_a_clip_trains_from_here_and_brings_versions_back(busy: Pilot) -> None:
    busy.session.clip_states = [ClipStatus("trained", 1.0, 28.4), ClipStatus("stale"), ClipStatus("untrained")]
    busy.session.training = TrainingStatus(can_train_next=True, next_clip_index=1)
    busy.session.queue = QueueStatus(everything=SequenceForecast(2))
    busy.session.versions = {
        0: (
            VersionStatus(2, "2026-11-22 17:01", 3900, 28.1, 1_200_000, (("joint_steps", "3000", "4000"),)),
            VersionStatus(1, "2026-11-21 10:11", why_not="It is damaged."),
        )
    }
    busy.draw(2)
    busy.tap(*busy.rects["timeline.clip1"].center, mouse.RIGHT)
    busy.click("clip menu.train from here")
    assert busy.sent(TrainClips) == [TrainClips((1, 2))]
    for number, entry, expected in ((2, "restore", RestoreVersion), (1, "remove", RemoveVersion)):
        busy.tap(*busy.rects["timeline.clip0"].center, mouse.RIGHT)
        busy.click("clip menu.versions")
        busy.draw(20)
        busy.click(f"clip menu.version{number}")
        busy.draw(20)
        if number == 1:
            busy.click("clip menu.restore1")
            busy.draw(5)
        busy.click(f"clip menu.{entry}{number}")
        assert busy.sent(expected) == [expected(0, number)]
        busy.key(key.ESCAPE)
        busy.key(key.ESCAPE)
        busy.key(key.ESCAPE)
    assert len(busy.sent(RestoreVersion)) == 1, "a damaged one is not brought back"


def test_the_clip_list_has_the_same_menu(busy: Pilot) -> None:
    busy.session.training = TrainingStatus(can_train_next=True, next_clip_index=2)
    busy.session.queue = QueueStatus()
    busy.draw(2)
    busy.tap(*busy.rects["training.clip0"].center, mouse.RIGHT)
    busy.click("clip menu.settings")
    assert busy.sent(AskTrainSettings) == [AskTrainSettings(0)]


def ask_settings(pilot: Pilot) -> None:
    retrain = RetrainQuestion(0, False, "", 28.4, (1, 2), 240.0, False, 400.0, None)
    settings = (
        OwnSetting("joint_steps", "Joint steps", 3600),
        OwnSetting("ssim_weight", "Weight of SSIM", 0.2),
        OwnSetting("residual", "Residual anchors", "dedup", ("dedup", "none", "full")),
    )
    pilot.session.question = SettingsQuestion(0, settings, retrain, True)
    pilot.draw(4)


def test_a_clip_is_trained_with_settings_that_were_typed(busy: Pilot) -> None:
    ask_settings(busy)
    busy.click("question.joint_steps")
    busy.key(key.A, modifiers=(CTRL,))
    busy.type("4500")
    busy.key(key.ENTER)
    assert busy.sent(TrainClip) == [], "that ended the typing"
    busy.click("question.yes")
    assert busy.sent(TrainClip) == [TrainClip(0, is_confirmed=True, settings=(("joint_steps", 4500),))]


def test_enter_and_escape_answer_the_dialog(busy: Pilot) -> None:
    ask_settings(busy)
    busy.key(key.ESCAPE)
    assert busy.sent(CloseQuestion) == [CloseQuestion()]
    ask_settings(busy)
    busy.key(key.ENTER)
    assert busy.sent(TrainClip) == [TrainClip(0, is_confirmed=True)], "nothing was changed"


def test_the_log_is_filtered_copied_and_followed(open_pilot: Open, monkeypatch: pytest.MonkeyPatch) -> None:
    session = busy_session()
    session.lines = tuple(
        LogLine(
            f"2026-11-22 17:{n // 60:02d}:{n % 60:02d},000",
            "ERROR" if n % 50 == 0 else "INFO",
            "clip 1" if n % 3 == 0 else "program",
            f"app.training: line {n} of 100 %s ##x",
        )
        for n in range(400)
    )
    pilot = open_pilot(session)
    pilot.key(key.L, modifiers=(SHIFT,))
    pilot.rest()
    assert pilot.studio.frame.ui.wanted_panel is None
    copied: list[str] = []
    monkeypatch.setattr(imgui, "set_clipboard_text", copied.append)
    pilot.click("log.copy")
    assert len(copied[-1].splitlines()) == 400
    assert copied[-1].splitlines()[7] == "17:00:07  program  app.training: line 7 of 100 %s ##x"
    pilot.click("log.filter")
    pilot.type("LINE 39")
    pilot.click("log.copy")
    assert [line.split("line ")[1][:3].strip() for line in copied[-1].splitlines()] == [
        "39",
        *(str(n) for n in range(390, 400)),
    ]
    log = pilot.studio.frame.log
    log.filter.text, log.filter.level = "", "WARNING"
    pilot.draw(2)
    pilot.click("log.copy")
    assert len(copied[-1].splitlines()) == 8
    log.filter.level, log.filter.source = "", "training"
    pilot.draw(2)
    pilot.click("log.copy")
    assert all("clip 1" in line for line in copied[-1].splitlines())
    assert log.is_following
    pilot.move(*pilot.rects["log.lines"].center)
    pilot.wheel(3)
    assert not log.is_following, "who scrolls up wants to read"


def test_the_timeline_stands_before_the_log_until_it_is_asked_for(open_pilot: Open) -> None:
    pilot = open_pilot()
    pilot.rest()
    assert "timeline.track" in pilot.rects
    assert "log.lines" not in pilot.rects
    pilot.studio.frame.ui.wanted_panel = LOG
    pilot.draw(3)
    assert "log.lines" in pilot.rects


def test_an_imported_scene_says_that_nothing_was_trained(open_pilot: Open, monkeypatch: pytest.MonkeyPatch) -> None:
    session, said = FakeSession(), list[str]()
    monkeypatch.setattr(training, "text_wrapped_dim", said.append)
    pilot = open_pilot(session)
    assert "This scene was imported; it has no training curves." not in said
    assert session.capture is not None
    session.capture = replace(session.capture, has_pictures=False)
    session.training = replace(session.training, next_clip_index=None)
    pilot.draw(3)
    assert "This scene was imported; it has no training curves." in said
    assert training.next_label(session).endswith("Imported from another program")  # type: ignore[arg-type]
    assert [state_words(state, session) for state in ("trained", "damaged")] == ["imported", "damaged"]  # type: ignore[arg-type]
    (action,) = [action for action in ACTIONS if action.id == "train.next"]
    assert action.lacks is not None
    session.training = replace(session.training, can_train_next=False, state="idle")
    assert "no pictures" in action.lacks(session)  # type: ignore[arg-type]
