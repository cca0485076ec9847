"""Actions on training and its panel."""

from __future__ import annotations

from app.session.commands import PauseTraining, ResumeTraining, StopTraining, TrainNextClip
from ui.panels.actions.action import TRAIN, Action, ActionNeeds
from ui.panels.state import TRAINING, Dispatch, UiState


def train_or_pause(session: ActionNeeds, dispatch: Dispatch) -> None:
    """One key for the whole loop: start the next clip, pause what runs, resume what is paused."""
    status = session.training
    if status.state in ("starting", "preparing", "running"):
        dispatch(PauseTraining())
    elif status.state == "paused":
        dispatch(ResumeTraining())
    elif status.can_train_next:
        dispatch(TrainNextClip())


def _train(session: ActionNeeds, dispatch: Dispatch, ui: UiState) -> None:
    train_or_pause(session, dispatch)


def _stop_training(session: ActionNeeds, dispatch: Dispatch, ui: UiState) -> None:
    if session.training.state not in ("idle", "failed", "stopping"):
        dispatch(StopTraining())


def _toggle_quality(session: ActionNeeds, dispatch: Dispatch, ui: UiState) -> None:
    ui.is_quality_open = not ui.is_quality_open
    if ui.is_quality_open:
        ui.wanted_panel = TRAINING


ACTIONS = (
    Action("train.quality", "Quality over clips, in the training panel", TRAIN, _toggle_quality, keys=("6",)),
    Action("train.next", "Train the next clip, pause or resume", TRAIN, _train, keys=("T",)),
    Action("train.stop", "Stop training and keep what was learned", TRAIN, _stop_training, keys=("Ctrl+T",)),
)
