"""Commands for the training of one clip, as entries of its context menu, in timeline and training panel."""

from __future__ import annotations

from imgui_bundle import imgui

from app.session.session_view import SessionView
from app.session.training.train_commands import (
    AskTrainSettings,
    PauseTraining,
    RemoveFromQueue,
    ResumeTraining,
    StopTraining,
    TrainAll,
    TrainClip,
    TrainClips,
    TrainStale,
)
from app.status import ClipStatus
from engine.text import duration_text
from ui.panels.pieces.copying import draw_copy_menu
from ui.panels.state import LOG, Dispatch, UiState
from ui.panels.training.clip_versions import draw_versions_menu
from ui.style.numbers import format_count
from ui.style.theme import Icon

GOING = ("preparing", "training", "paused")
"""States of the clip that trains."""


def train_label(status: ClipStatus) -> str:
    """Label for training this clip."""
    if status.state in ("trained", "damaged"):
        return "Retrain this clip"
    if status.state == "failed":
        return "Retry this clip"
    return "Train this clip" if status.resume_step is None else "Resume this clip"


def draw_clip_training(
    session: SessionView, dispatch: Dispatch, ui: UiState, clip_index: int, *, is_by_key: bool = False
) -> None:
    """Entries: train or retry, or pause and stop, from here, all, with other settings, out of the queue, its log,
    earlier versions.

    Args:
        is_by_key: The menu was opened by a key, which then continues at the first entry.
    """
    status, reference = session.clip_states[clip_index], session.reference_index
    project = session.project_status
    is_writable = project is None or project.is_writable
    coming = {clip.clip_index for clip in session.queue.waiting}
    is_going = status.state in GOING
    reference_state = session.clip_states[reference].state
    has_reference = clip_index == reference or reference in coming or reference_state in ("trained", *GOING)
    can_train = is_writable and not is_going and session.training.state != "stopping"
    if is_going:
        _draw_holding(status, dispatch, ui, clip_index, is_by_key=is_by_key)
    elif clip_index in coming:
        if _item(ui, "unqueue", f"{Icon.CLOSE}  Remove from the queue", is_by_key=is_by_key):
            dispatch(RemoveFromQueue(clip_index))
    else:
        label, is_enabled = f"{Icon.TRAIN}  {train_label(status)}", can_train and has_reference
        if _item(ui, "train", label, is_enabled=is_enabled, is_by_key=is_by_key):
            dispatch(TrainClip(clip_index))
    if not has_reference:
        imgui.text_disabled(f"Clip {reference}, the reference, has to be trained first")
    later, everything = (_unfinished(session, coming, first) for first in (clip_index, 0))
    words = f"{Icon.LAYERS}  Train from here ({format_count(len(later))})"
    if _item(ui, "train from here", words, is_enabled=is_writable and bool(later)):
        dispatch(TrainClips(later))
    words = f"{Icon.LAYERS}  Train all untrained ({format_count(len(everything))})"
    if _item(ui, "train all", words, is_enabled=is_writable and bool(everything)):
        dispatch(TrainAll())
    stale = session.queue.stale
    if stale is not None:
        cost = "" if stale.seconds is None else f", about {duration_text(stale.seconds)}"
        words = f"{Icon.CLOCK_BACK}  Retrain all out of date ({format_count(stale.n_clips)}{cost})"
        if _item(ui, "train stale", words, is_enabled=is_writable):
            dispatch(TrainStale())
    label = f"{Icon.GEAR}  Train with other settings ..."
    if _item(ui, "settings", label, is_enabled=can_train and has_reference):
        dispatch(AskTrainSettings(clip_index))
    if _item(ui, "log", f"{Icon.LOG}  Show its log"):
        ui.log_clip, ui.wanted_panel = clip_index, LOG
    draw_copy_menu(ui, "clip menu.training", lambda: session.command_texts.training(clip_index))
    draw_versions_menu(session, dispatch, ui, clip_index)


def _draw_holding(status: ClipStatus, dispatch: Dispatch, ui: UiState, clip_index: int, *, is_by_key: bool) -> None:
    """Entries for a clip that trains, wherever it does."""
    if status.state == "paused":
        if _item(ui, "resume", f"{Icon.PLAY}  Resume this clip", is_by_key=is_by_key):
            dispatch(ResumeTraining(clip_index))
    elif _item(ui, "pause", f"{Icon.PAUSE}  Pause this clip", is_by_key=is_by_key):
        dispatch(PauseTraining(clip_index))
    if _item(ui, "stop", f"{Icon.STOP}  Stop this clip"):
        dispatch(StopTraining(clip_index))


def _unfinished(session: SessionView, coming: set[int], first: int) -> tuple[int, ...]:
    """Clips from one on that are not finished and not on their way."""
    states = enumerate(session.clip_states[first:], first)
    done = ("trained", "damaged", *GOING)
    return tuple(index for index, status in states if status.state not in done and index not in coming)


def _item(ui: UiState, name: str, label: str, *, is_enabled: bool = True, is_by_key: bool = False) -> bool:
    is_chosen = imgui.menu_item(label, "", False, is_enabled)[0]
    if is_by_key:
        imgui.set_item_default_focus()
    ui.mark(f"clip menu.{name}")
    return is_chosen
