"""What can be done about the training of one clip, as entries of its context menu, in timeline and training panel."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from imgui_bundle import imgui

from app.session.commands import AskTrainSettings, RemoveFromQueue, TrainClip, TrainClips
from app.status import ClipStatus, ProjectStatus, QueueStatus, TrainingStatus
from ui.panels.clip_versions import VersionNeeds, draw_versions_menu
from ui.panels.queue import clips_text
from ui.panels.state import Dispatch, UiState
from ui.style.theme import Icon

GOING = ("preparing", "training", "paused")
"""States of the clip that trains."""


class ClipMenuNeeds(VersionNeeds, Protocol):
    """What the entries read."""

    @property
    def clip_states(self) -> Sequence[ClipStatus]: ...

    @property
    def training(self) -> TrainingStatus: ...

    @property
    def queue(self) -> QueueStatus: ...

    @property
    def reference_index(self) -> int: ...

    @property
    def project_status(self) -> ProjectStatus | None: ...


def train_label(status: ClipStatus) -> str:
    """What training this clip would be."""
    if status.state in ("trained", "damaged"):
        return "Train this clip again"
    if status.state == "failed":
        return "Try this clip again"
    return "Train this clip" if status.resume_step is None else "Resume this clip"


def draw_clip_training(session: ClipMenuNeeds, dispatch: Dispatch, ui: UiState, clip_index: int) -> None:
    """Entries: train or retry, from here, with other settings, out of the queue, earlier versions."""
    status, reference = session.clip_states[clip_index], session.reference_index
    project = session.project_status
    is_writable = project is None or project.is_writable
    coming = {clip.clip_index for clip in session.queue.waiting}
    is_going = status.state in GOING
    reference_state = session.clip_states[reference].state
    has_reference = clip_index == reference or reference in coming or reference_state in ("trained", *GOING)
    can_train = is_writable and not is_going and session.training.state != "stopping"
    if clip_index in coming:
        if imgui.menu_item(f"{Icon.CLOSE}  Do not train it after all", "", False, True)[0]:
            dispatch(RemoveFromQueue(clip_index))
        ui.mark("clip menu.unqueue")
    elif imgui.menu_item(f"{Icon.TRAIN}  {train_label(status)}", "", False, can_train and has_reference)[0]:
        dispatch(TrainClip(clip_index))
    if clip_index not in coming:
        ui.mark("clip menu.train")
    if not has_reference:
        imgui.text_disabled(f"Clip {reference}, the reference, has to be trained first")
    later = range(clip_index, len(session.clip_states))
    left = [index for index in later if session.clip_states[index].state not in ("trained", "damaged", *GOING)]
    new = [index for index in left if index not in coming]
    label = f"{Icon.LAYERS}  Train from here" + (f" ({clips_text(len(new))})" if new else "")
    if imgui.menu_item(f"{label}###from here", "", False, is_writable and bool(new))[0]:
        dispatch(TrainClips(tuple(later)))
    ui.mark("clip menu.from_here")
    if imgui.menu_item(f"{Icon.GEAR}  Train with other settings ...", "", False, can_train and has_reference)[0]:
        dispatch(AskTrainSettings(clip_index))
    ui.mark("clip menu.settings")
    draw_versions_menu(session, dispatch, ui, clip_index)
