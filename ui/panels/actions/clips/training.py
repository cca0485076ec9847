"""Actions on training and its panel."""

from __future__ import annotations

from collections.abc import Callable

from app.session.captures.capture_commands import FollowRecording
from app.session.session_view import SessionView
from app.session.showing.look_commands import SetFrame
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
from app.status import RunningClip
from engine.capture.formats.imported import NO_PICTURES
from ui.panels.actions.action import TRAIN, WINDOW, Action, Run
from ui.panels.state import LOG, TRAINING, Dispatch, UiState
from ui.panels.timeline.clip_words import is_imported


def train_or_pause(session: SessionView, dispatch: Dispatch) -> None:
    """One key for the whole loop: start the next clip, pause what runs, resume what is paused."""
    status = session.training
    if status.is_going and status.is_paused:
        dispatch(ResumeTraining())
    elif status.is_going:
        dispatch(PauseTraining())
    elif status.can_train_next:
        dispatch(TrainNextClip())


def _training_here(session: SessionView) -> RunningClip | None:
    """The training of the clip at the playhead."""
    clip = session.timeline.clip
    return None if clip is None else session.training.of_clip(clip.clip_index)


def _pause_clip(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    one = _training_here(session)
    if one is not None:
        dispatch((ResumeTraining if one.state == "paused" else PauseTraining)(one.clip_index))


def _stop_clip(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    one = _training_here(session)
    if one is not None:
        dispatch(StopTraining(one.clip_index))


def _clip_does_not_train(session: SessionView) -> str:
    return "" if _training_here(session) is not None else "The clip at the playhead does not train."


def _everywhere(command: type[PauseTraining | ResumeTraining | StopTraining]) -> Run:
    def tell(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        if session.training.is_going:
            dispatch(command())
        for one in session.training.trainings:
            if one.is_elsewhere:
                dispatch(command(one.clip_index))

    return tell


def _nothing_elsewhere(session: SessionView) -> str:
    return "" if any(one.is_elsewhere for one in session.training.trainings) else "No clip trains elsewhere."


def _next_training(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    clips, clip = [one.clip_index for one in session.training.trainings], session.timeline.clip
    here = -1 if clip is None else clip.clip_index
    if clips:
        dispatch(SetFrame(session.clips[next((index for index in clips if index > here), clips[0])].start))


def _no_training(session: SessionView) -> str:
    return "" if session.training.trainings else "Nothing is being trained."


def _change_workers(by: int) -> Run:
    def change(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        n = min(ui.preferences.n_workers, session.usage.n_cores) + by
        ui.preferences.n_workers = min(max(n, 1), session.usage.n_cores)

    return change


def _show_clip_log(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    clip = session.timeline.clip
    ui.log_clip, ui.wanted_panel = None if clip is None else clip.clip_index, LOG


def _train(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    train_or_pause(session, dispatch)


def _stop_training(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    if not _nothing_trains(session):
        dispatch(StopTraining())


def _cannot_train(session: SessionView) -> str:
    status = session.training
    if (status.is_going and not status.is_stopping) or status.can_train_next:
        return ""
    if is_imported(session):
        return NO_PICTURES
    is_all = all(clip.state == "trained" for clip in session.clip_states)
    return "Every clip is trained." if is_all else "No clip can be trained next."


def _nothing_waits(session: SessionView) -> str:
    return "" if session.queue.waiting else "No clip is waiting."


def _nothing_failed(session: SessionView) -> str:
    return "" if session.queue.failed else "No clip has failed."


def _nothing_trains(session: SessionView) -> str:
    status = session.training
    return "" if status.is_going and not status.is_stopping else "Nothing is being trained."


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
    if session.training.is_going:
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
    Action("train.pause_clip", "Pause or resume this clip", TRAIN, _pause_clip, lacks=_clip_does_not_train),
    Action("train.stop_clip", "Stop training this clip", TRAIN, _stop_clip, lacks=_clip_does_not_train),
    Action("train.go_next", "Go to the next clip in training", TRAIN, _next_training, lacks=_no_training),
    *(
        Action(f"train.{name}_everywhere", f"{words} training on all computers", TRAIN, run, lacks=_nothing_elsewhere)
        for name, words, run in (
            ("pause", "Pause", _everywhere(PauseTraining)),
            ("resume", "Resume", _everywhere(ResumeTraining)),
            ("stop", "Stop", _everywhere(StopTraining)),
        )
    ),
    Action("train.more", "Train one more clip at once", TRAIN, _change_workers(1), needs_capture=False),
    Action("train.fewer", "Train one clip fewer at once", TRAIN, _change_workers(-1), needs_capture=False),
    Action("train.log", "Show the log of this clip", TRAIN, _show_clip_log),
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
