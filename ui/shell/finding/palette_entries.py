"""Entries of the palette: every action of the table, and those for things that are open: projects, cameras, clips, kept
layouts.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from app.session.session_view import SessionView
from app.session.showing.look_commands import LookThrough, SetFrame
from engine.text import one_line
from ui.panels.actions.table import ACTIONS
from ui.panels.state import Dispatch, UiState
from ui.panels.welcome.recent_rows import open_recent
from ui.shell.finding.fuzzy import match

MOST_SHOWN = 200
"""Entries that are listed; who wants another one types more."""
FOUND_BY_GROUP, CANNOT_BE_RUN = 12.0, 1.0
"""By how much such entries give way to others that match as well."""


Run = Callable[[SessionView, Dispatch, UiState], None]


@dataclass(frozen=True, slots=True)
class PaletteEntry:
    """One thing to choose.

    Attributes:
        id: Its name among those that were used lately.
        text: Its effect in words.
        group: The group it belongs to.
        keys: Its keys as text; empty where it has none.
        why_not: Why it cannot be run now; empty when it can.
        is_numbered: One of many that differ by a number; where there are too many of them, one has to be typed.
    """

    id: str
    text: str
    group: str
    run: Run
    keys: str = ""
    why_not: str = ""
    is_numbered: bool = False


@dataclass(frozen=True, slots=True)
class Found:
    """An entry that what was typed stands for, and which letters of its text were meant."""

    entry: PaletteEntry
    positions: tuple[int, ...] = ()


def entries(session: SessionView, ui: UiState) -> list[PaletteEntry]:
    """Everything there is to choose now: actions in the order of their table, then the rest."""
    actions = [
        PaletteEntry(
            action.id,
            action.text,
            action.group,
            action.run,
            ", ".join(ui.keys.labels(action)),
            action.why_not(session, ui),
        )
        for action in ACTIONS
        if action.id != "window.palette"
    ]
    return [*actions, *_layouts(ui), *_projects(session), *_cameras(session), *_clips(session)]


def found(typed: str, offered: Sequence[PaletteEntry], used: Sequence[str]) -> list[Found]:
    """Entries that match the typed text, best first; without anything typed, those used lately come first.

    Args:
        used: Ids of entries used lately, newest first.
    """
    if sum(entry.is_numbered for entry in offered) > MOST_SHOWN and not any(sign.isdigit() for sign in typed):
        offered = [entry for entry in offered if not entry.is_numbered]
    rank = {entry_id: index for index, entry_id in enumerate(used)}
    if not typed.strip():
        order = sorted(offered, key=lambda entry: rank.get(entry.id, len(rank)))
        return [Found(entry) for entry in order[:MOST_SHOWN]]
    hits = []
    for place, entry in enumerate(offered):
        hit = match(typed, entry.text)
        score = 0.0 if hit is None else hit.score
        if hit is None:
            hit = match(typed, f"{entry.text} {entry.group}")
            if hit is None:
                continue
            score = hit.score - FOUND_BY_GROUP
        score -= CANNOT_BE_RUN if entry.why_not else 0.0
        positions = tuple(position for position in hit.positions if position < len(entry.text))
        hits.append((-score, rank.get(entry.id, len(rank)), place, Found(entry, positions)))
    return [hit[3] for hit in sorted(hits, key=lambda hit: hit[:3])[:MOST_SHOWN]]


def _projects(session: SessionView) -> list[PaletteEntry]:
    def opening(index: int) -> Run:
        recent = session.recent.entries[index]
        return lambda session, dispatch, ui: dispatch(open_recent(recent))

    return [
        PaletteEntry(
            f"open:{recent.folder}",
            f"Open {one_line(recent.name)}",
            "Recent projects",
            opening(index),
            why_not="The folder no longer exists." if recent.folder in session.recent.missing else "",
        )
        for index, recent in enumerate(session.recent.entries)
    ]


def _cameras(session: SessionView) -> list[PaletteEntry]:
    def looking(camera_index: int | None) -> Run:
        return lambda session, dispatch, ui: dispatch(LookThrough(camera_index))

    if session.capture is None:
        return []
    free = PaletteEntry("camera:", "Free view", "Cameras", looking(None))
    names = session.rig.names
    return [
        free,
        *(
            PaletteEntry(f"camera:{n}", f"Go to camera {one_line(n)}", "Cameras", looking(i))
            for i, n in enumerate(names)
        ),
    ]


def _clips(session: SessionView) -> list[PaletteEntry]:
    def going(frame_index: int) -> Run:
        return lambda session, dispatch, ui: dispatch(SetFrame(frame_index))

    return [
        PaletteEntry(
            f"clip:{clip.clip_index}", f"Go to clip {clip.clip_index}", "Clips", going(clip.start), is_numbered=True
        )
        for clip in session.clips
    ]


def _layouts(ui: UiState) -> list[PaletteEntry]:
    def showing(name: str) -> Run:
        def show(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
            ui.wishes.layout = name

        return show

    def removing(name: str) -> Run:
        def remove(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
            ui.wishes.layout_removed = name

        return remove

    names = list(ui.preferences.layouts)
    shown = [PaletteEntry(f"layout:{name}", f"Layout: {one_line(name)}", "Window", showing(name)) for name in names]
    removed = [
        PaletteEntry(f"layout removed:{name}", f"Remove the layout {one_line(name)}", "Window", removing(name))
        for name in names
    ]
    return [*shown, *removed]
