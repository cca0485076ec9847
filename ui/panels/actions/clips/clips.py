"""Actions on the clip under the playhead: versions, cuts, the reference, and clips that are out of date."""

from __future__ import annotations

from app.session.clips.clip_commands import (
    ApplyDeletions,
    AskFreeSpace,
    CompareVersion,
    MergeClips,
    SetReferenceClip,
    SplitClip,
)
from app.session.session_view import SessionView
from app.session.training.train_commands import TrainStale
from ui.panels.actions.action import TRAIN, Action
from ui.panels.clips.comparing import compared_version, next_version
from ui.panels.state import Dispatch, UiState


def _compare_version(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    """The newest version first, an older one with every press, and none after the oldest."""
    clip = session.timeline.clip
    if clip is None:
        return
    shown = compared_version(session.overlays)
    number = next_version(session.clip_versions(clip.clip_index), shown)
    if number is not None or shown is not None:
        dispatch(CompareVersion(clip.clip_index, number))


def _no_version(session: SessionView) -> str:
    clip = session.timeline.clip
    has_one = clip is not None and bool(session.clip_versions(clip.clip_index))
    is_shown = compared_version(session.overlays) is not None
    return "" if has_one or is_shown else "The clip under the playhead has no earlier version."


def _train_stale(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    dispatch(TrainStale())


def _nothing_stale(session: SessionView) -> str:
    return "No clip is out of date." if session.queue.stale is None else ""


def _split(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    dispatch(SplitClip(session.timeline.frame_index))


def _cannot_split(session: SessionView) -> str:
    clip = session.timeline.clip
    if clip is None or session.timeline.frame_index == clip.start:
        return "Move the playhead past the first frame of a clip."
    return _something_trains(session)


def _merge(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    clip = session.timeline.clip
    if clip is not None:
        dispatch(MergeClips(clip.clip_index))


def _cannot_merge(session: SessionView) -> str:
    clip = session.timeline.clip
    if clip is None or clip.stop >= session.timeline.n_frames:
        return "No clip follows the one under the playhead."
    return _something_trains(session)


def _make_reference(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    clip = session.timeline.clip
    if clip is not None:
        dispatch(SetReferenceClip(clip.clip_index))


def _something_trains(session: SessionView) -> str:
    return "Stop training first; progress is kept." if session.training.is_anywhere else ""


def _free_versions(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    dispatch(AskFreeSpace("versions"))


def _apply_deletions(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    dispatch(ApplyDeletions())


ACTIONS = (
    Action(
        "clips.compare_version",
        "Compare this clip with its previous version, side by side",
        TRAIN,
        _compare_version,
        keys=("Shift+G",),
        lacks=_no_version,
    ),
    Action(
        "clips.train_stale",
        "Retrain every clip that is out of date",
        TRAIN,
        _train_stale,
        keys=("Alt+T",),
        lacks=_nothing_stale,
    ),
    Action("clips.split", "Split this clip at the playhead", TRAIN, _split, keys=("Alt+C",), lacks=_cannot_split),
    Action("clips.merge", "Merge this clip with the next one", TRAIN, _merge, keys=("Alt+M",), lacks=_cannot_merge),
    Action(
        "clips.reference",
        "Make this clip the reference clip",
        TRAIN,
        _make_reference,
        lacks=_something_trains,
    ),
    Action(
        "clips.apply_deletions",
        "Apply deletions permanently: rewrite clips without deleted anchors",
        TRAIN,
        _apply_deletions,
        lacks=_something_trains,
    ),
    Action("clips.free", "Free disk space: delete earlier versions of clips", TRAIN, _free_versions),
)
