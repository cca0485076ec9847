"""Actions on training and its panel."""

from __future__ import annotations

from collections.abc import Callable

from app.session.captures.capture_commands import FollowRecording
from app.session.session_view import SessionView
from app.session.training.train_commands import (
    AskTrainSettings,
    MoveInQueue,
    PauseTraining,
    RemoveFromQueue,
    ResumeTraining,
    SetLiveView,
    StopAfterClip,
    StopTraining,
    TrainAll,
    TrainClip,
    TrainClips,
    TrainNextClip,
)
from ui.panels.actions.action import TRAIN, WINDOW, Action, Run
from ui.panels.state import LOG, TRAINING, Dispatch, UiState


def train_or_pause(session: SessionView, dispatch: Dispatch) -> None:
    """One key for the whole loop: start the next clip, pause what runs, resume what is paused."""
    status = session.training
    if status.state in ("starting", "preparing", "running"):
        dispatch(PauseTraining())
    elif status.state == "paused":
        dispatch(ResumeTraining())
    elif status.can_train_next:
        dispatch(TrainNextClip())


def _train(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    train_or_pause(session, dispatch)


def _stop_training(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    if session.training.state not in ("idle", "failed", "stopping"):
        dispatch(StopTraining())


def _cannot_train(session: SessionView) -> str:
    status = session.training
    if status.state in ("starting", "preparing", "running", "paused") or status.can_train_next:
        return ""
    is_all = all(clip.state == "trained" for clip in session.clip_states)
    return "Every clip is trained." if is_all else "No clip can be trained next."


def _nothing_waits(session: SessionView) -> str:
    return "" if session.queue.waiting else "No clip is waiting."


def _nothing_failed(session: SessionView) -> str:
    return "" if session.queue.failed else "No clip has failed."


def _nothing_trains(session: SessionView) -> str:
    return "Nothing is being trained." if session.training.state in ("idle", "failed", "stopping") else ""


def _toggle_quality(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    ui.is_quality_open = not ui.is_quality_open
    if ui.is_quality_open:
        ui.wanted_panel = TRAINING


def _train_all(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    dispatch(TrainAll())


def _train_from_here(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    clip = session.timeline.clip
    if clip is not None:
        dispatch(TrainClips(tuple(range(clip.clip_index, len(session.timeline.clips)))))


def _ask_settings(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    clip = session.timeline.clip
    if clip is not None:
        dispatch(AskTrainSettings(clip.clip_index))


def _hold_after(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    if session.training.state not in ("idle", "failed"):
        dispatch(StopAfterClip(not session.queue.is_ending_after))


def _next_waiting(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    waiting = [clip.clip_index for clip in session.queue.waiting]
    if waiting:
        place = waiting.index(ui.queue_chosen) + 1 if ui.queue_chosen in waiting else 0
        ui.queue_chosen, ui.wanted_panel = waiting[place % len(waiting)], TRAINING


def _move_waiting(by: int) -> Run:
    def move(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        waiting = [clip.clip_index for clip in session.queue.waiting]
        if ui.queue_chosen not in waiting:
            _next_waiting(session, dispatch, ui)
        else:
            dispatch(MoveInQueue(ui.queue_chosen, max(waiting.index(ui.queue_chosen) + by, 0)))

    return move


def _remove_waiting(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    if ui.queue_chosen in [clip.clip_index for clip in session.queue.waiting]:
        dispatch(RemoveFromQueue(ui.queue_chosen))
        ui.queue_chosen = None


def _retry_failed(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    for clip_index, _ in session.queue.failed:
        dispatch(TrainClip(clip_index))


def _live_view(mode: str) -> Run:
    def choose(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        dispatch(SetLiveView(mode))

    return choose


def _is_live_view(mode: str) -> Callable[[SessionView], bool]:
    return lambda session: session.queue.live_view == mode


def _show_log(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    ui.wanted_panel = LOG


def _follow_recording(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    dispatch(FollowRecording(not session.recording_status.is_followed))


def _toggle_log_loss(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    ui.curves.is_log = not ui.curves.is_log


ACTIONS = (
    Action("train.next", "Train the next clip, pause or resume", TRAIN, _train, keys=("T",), lacks=_cannot_train),
    Action("train.all", "Train every clip that is not finished", TRAIN, _train_all, keys=("Shift+T",)),
    Action("train.from_here", "Train this clip and all after it", TRAIN, _train_from_here),
    Action(
        "train.follow",
        "Follow the recording: train each clip once it is recorded",
        TRAIN,
        _follow_recording,
        is_on=lambda session: session.recording_status.is_followed,
    ),
    Action("train.settings", "Train this clip with other settings", TRAIN, _ask_settings),
    Action(
        "train.stop",
        "Stop training; progress is kept",
        TRAIN,
        _stop_training,
        keys=("Ctrl+T",),
        lacks=_nothing_trains,
    ),
    Action(
        "train.hold_after",
        "Hold the queue after this clip, on or off",
        TRAIN,
        _hold_after,
        keys=("Ctrl+Shift+T",),
        lacks=_nothing_trains,
    ),
    *(
        Action(f"queue.{name}", words, TRAIN, run, keys=(key,), lacks=_nothing_waits)
        for name, words, run, key in (
            ("next", "Choose the next waiting clip", _next_waiting, "Shift+N"),
            ("earlier", "Move the chosen waiting clip earlier", _move_waiting(-1), "Ctrl+Shift+Up"),
            ("later", "Move the chosen waiting clip later", _move_waiting(1), "Ctrl+Shift+Down"),
            ("remove", "Remove the chosen clip from the queue", _remove_waiting, "Ctrl+Delete"),
        )
    ),
    Action("queue.retry", "Retry failed clips", TRAIN, _retry_failed, lacks=_nothing_failed),
    Action("train.quality", "Show quality over clips in the training panel", TRAIN, _toggle_quality, keys=("6",)),
    Action("live.off", "Live view off", TRAIN, _live_view("off"), is_on=_is_live_view("off")),
    Action("live.low", "Live view low: about every 10 s", TRAIN, _live_view("low"), is_on=_is_live_view("low")),
    Action("live.live", "Live view", TRAIN, _live_view("live"), is_on=_is_live_view("live")),
    Action(
        "curves.log",
        "Loss on a logarithmic scale",
        TRAIN,
        _toggle_log_loss,
        needs_capture=False,
    ),
    Action("window.log", "Show the log", WINDOW, _show_log, keys=("Shift+L",), needs_capture=False, menu="Help"),
)
