"""Actions on seams and stretches with flicker: mend them, compare, keep or take back."""

from __future__ import annotations

from app.session.mending.mend_commands import AskMend, CloseMend, CompareMended, RevertMend, StartMend, StopMend
from app.session.session_view import SessionView
from ui.panels.actions.action import TRAIN, Action
from ui.panels.state import Dispatch, UiState


def _mend_seam(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    """Ask about the seam that is played around, else about the nearest one; a question already asked is started."""
    timeline = session.timeline
    clips, around = timeline.clips, timeline.around
    frame = timeline.frame_index if around is None else (around[0] + around[1]) / 2
    page = session.mending.page
    if page is not None and page.state == "asking":
        dispatch(StartMend())
        return
    after = min(range(1, len(clips)), key=lambda index: abs(clips[index].start - frame), default=None)
    if after is not None:
        dispatch(AskMend(after=after))


def _one_clip(session: SessionView) -> str:
    return "A project with one clip has no seams." if len(session.timeline.clips) < 2 else _is_running(session)


def _mend_frames(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    timeline = session.timeline
    if timeline.in_frame is not None and timeline.out_frame is not None:
        dispatch(AskMend(frames=(timeline.in_frame, timeline.out_frame + 1)))


def _no_frames(session: SessionView) -> str:
    timeline = session.timeline
    if timeline.in_frame is None or timeline.out_frame is None:
        return "Set the in and out points around the flicker first (I and O)."
    return _is_running(session)


def _is_running(session: SessionView) -> str:
    page = session.mending.page
    return "Mending is already running." if page is not None and page.state == "running" else ""


def _compare(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    dispatch(CompareMended())


def _revert(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    dispatch(RevertMend())


def _nothing_mended(session: SessionView) -> str:
    page = session.mending.page
    is_there = page is not None and page.state == "done" and page.record is not None and page.record.has_helped
    return "" if is_there else "No mend to revert; earlier versions are in the clip menu."


def _close(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    page = session.mending.page
    dispatch(StopMend() if page is not None and page.state == "running" else CloseMend())


def _nothing_shown(session: SessionView) -> str:
    return "Mending is not running." if session.mending.page is None else ""


ACTIONS = (
    Action(
        "mend.seam",
        "Mend the nearest seam between clips; again: start",
        TRAIN,
        _mend_seam,
        keys=("Shift+M",),
        lacks=_one_clip,
    ),
    Action(
        "mend.frames", "Mend the frames from in to out", TRAIN, _mend_frames, keys=("Alt+Shift+M",), lacks=_no_frames
    ),
    Action(
        "mend.compare",
        "Compare the mended clip with the one before, on or off",
        TRAIN,
        _compare,
        keys=("Alt+B",),
        lacks=_nothing_mended,
    ),
    Action("mend.revert", "Revert the mend", TRAIN, _revert, keys=("Alt+Shift+Z",), lacks=_nothing_mended),
    Action(
        "mend.close", "Stop mending, or keep the mended clips", TRAIN, _close, keys=("Alt+K",), lacks=_nothing_shown
    ),
)
