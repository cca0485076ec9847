"""New edits: buttons and keys for what can be done to what is selected or drawn, and where in time it is to hold."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from imgui_bundle import ImVec2, imgui

from app.document.changes.reach_words import reach_note
from app.session.editing.edit_commands import AddEdit
from app.session.editing.mark_commands import MarkBox, MarkRegion
from app.session.editing.scope_choice import SCOPE_CHOICES, SCOPE_WORDS, chosen_scope, extent_text
from app.session.editing.selection_commands import ClearSelection
from app.session.session_view import SessionView
from engine.editing.actions import Action, Delete, Expose, Hide, Hold, Recolor, Smooth, Transform
from engine.editing.edit import Edit, Everything, ObjectTarget, Scope, Sphere, Target, Volume
from engine.editing.reach import Reach, reach_of, reach_of_edit
from ui.panels.editing.edit_subject import Meant, bounds_of, meant, pivot_of
from ui.panels.editing.panel.sections import TALL
from ui.panels.pieces.widgets import ROW_GAP, elided, row_widths, segment, text_warning
from ui.panels.state import Dispatch, UiState

FIRST_STOPS, FIRST_OPACITY, FIRST_SIGMA_FRAMES = 0.5, 0.5, 2.0
"""First values of new edits."""


First = Callable[[SessionView, Meant], Action]


@dataclass(frozen=True, slots=True)
class Making:
    """One kind of edit that can be made.

    Attributes:
        name: In ids of actions and names of buttons.
        label: On the button.
        words: Its effect, for menus and tooltips.
        action: Made where it is wanted; None has no use of its own for the frame and the pivot.
        keys: See ui.panels.actions.action.Action.
        is_inverted: Whether it acts on everything else.
        is_for_everything: Whether it is of use where nothing is selected: it then acts on everything.
    """

    name: str
    label: str
    words: str
    action: First
    keys: tuple[str, ...] = ()
    is_inverted: bool = False
    is_for_everything: bool = False


def _making(kind: type[Action], first: First, *, name: str = "", **said: Any) -> Making:
    """As the action is declared."""
    return Making(name or kind.called(), kind.label, kind.tip or f"{kind.label} the selection", first, **said)


DELETE = _making(Delete, lambda *where: Delete())
"""Its key stands in ui.panels.actions.editing.deleting, as Delete also removes regions, camera keys and edits."""
MAKINGS = (
    _making(Hide, lambda *where: Hide(), keys=("H",)),
    Making(
        "isolate",
        "Isolate",
        "Isolate: hide everything but the selection",
        lambda *where: Hide(),
        ("Shift+H",),
        is_inverted=True,
    ),
    DELETE,
    _making(Transform, lambda *where: Transform(pivot=pivot_of(*where)), name="move", keys=("Alt+G",)),
    _making(Recolor, lambda *where: Recolor(), is_for_everything=True),
    _making(Expose, lambda *where: Expose(FIRST_STOPS), is_for_everything=True),
    Making(
        "opacity",
        "Opacity",
        "Change the opacity of the selection",
        lambda *where: Recolor(opacity=FIRST_OPACITY),
    ),
    _making(Hold, lambda session, volume: Hold(session.timeline.frame_index)),
    _making(Smooth, lambda *where: Smooth(FIRST_SIGMA_FRAMES), is_for_everything=True),
)
PER_ROW, WARNING_WIDTH = 3, 30.0


def make_edit(session: SessionView, dispatch: Dispatch, ui: UiState, making: Making) -> None:
    """Put an edit on the stack and show it; the session says why where nothing is selected."""
    volume, words = meant(session, ui)
    target: Target | None = volume
    if not words and making.is_for_everything:
        target = Everything()
    is_drawn = isinstance(volume, Volume)
    is_outside = is_drawn and ui.editing.is_outside
    before = {edit.edit_id for edit in session.edits.edits}
    scope = chosen_scope(ui.editing.scope, session.timeline)
    dispatch(AddEdit(making.action(session, volume), target, scope, making.is_inverted != is_outside))
    ui.show_edit()
    added = [edit.edit_id for edit in session.edits.edits if edit.edit_id not in before]
    if added:
        ui.editing.choose(added[-1])
        ui.editing.is_new = True
        if is_drawn:  # its handles are those of the edit now
            ui.selecting.leave()
            ui.editing.is_outside = False
            dispatch(ClearSelection())


def mark_moving(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    """Let everything move in what was drawn, or in the box around what is selected: a region of the gate, in clips that
    are trained from now on."""
    volume, _ = meant(session, ui)
    bounds = bounds_of(session, volume)
    if isinstance(volume, Sphere):
        dispatch(MarkRegion("dynamic", volume.center, volume.radius))
    elif bounds is not None:
        dispatch(MarkBox("dynamic", *bounds))


def _reach(session: SessionView, volume: Meant, scope: Scope, *, is_inverted: bool = False) -> Reach:
    """Where a new edit would act."""
    if isinstance(volume, ObjectTarget):
        edit = Edit(0, "", volume, Hide(), scope, is_inverted)
        return reach_of_edit(edit, session.edits.clips, session.edits.objects)
    picked = () if volume is not None else session.selection.counts
    return reach_of(picked, scope, session.edits.clips, is_inverted=is_inverted)


def _draw_note(note: str) -> None:
    """As a whole; in a low panel in one line, as the buttons below have to be in sight."""
    if imgui.get_window_height() >= TALL:
        text_warning(note)
        return
    text_warning(elided(note, imgui.get_content_region_avail().x - WARNING_WIDTH))
    imgui.set_item_tooltip(note.replace("%", "%%"))


def draw_making(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    """Where new edits are to hold, and a button for each kind."""
    volume, words = meant(session, ui)
    scope = chosen_scope(ui.editing.scope, session.timeline)
    imgui.separator_text(f"Scope: {extent_text(scope, session.timeline)}")
    for start in range(0, len(SCOPE_CHOICES), PER_ROW):
        row = SCOPE_CHOICES[start : start + PER_ROW]
        widths = row_widths([SCOPE_WORDS[choice] for choice in row])
        for place, choice in enumerate(row):
            if place:
                imgui.same_line(0, ROW_GAP)
            if segment(SCOPE_WORDS[choice], ui.editing.scope == choice, widths[place]):
                ui.editing.scope = choice
            ui.mark(f"edits.scope {choice}")
    reach = _reach(session, volume, scope)
    if note := reach_note(reach, scope):
        _draw_note(note)
        ui.mark("edits.note")
    imgui.begin_disabled(not session.edits.can_edit)
    width = (imgui.get_content_region_avail().x - (PER_ROW - 1) * ROW_GAP) / PER_ROW
    for place, making in enumerate(MAKINGS):
        if place % PER_ROW:
            imgui.same_line(0, ROW_GAP)
        imgui.begin_disabled(reach.is_nowhere or not (words or making.is_for_everything))
        label = "Crop" if making.name == "isolate" and isinstance(volume, Volume) else making.label
        if imgui.button(f"{label}##{making.name}", ImVec2(width, 0)):
            make_edit(session, dispatch, ui, making)
        ui.mark(f"edits.make {making.name}")
        imgui.end_disabled()
        key = f" ({making.keys[0]})" if making.keys else ""
        note = reach_note(_reach(session, volume, scope, is_inverted=True), scope) if making.is_inverted else ""
        imgui.set_item_tooltip("\n".join(filter(None, (f"{making.words}{key}", note))))
    imgui.begin_disabled(volume is None and not session.selection.n_shown)
    if imgui.button("Set moving", ImVec2(width, 0)):
        mark_moving(session, dispatch, ui)
    ui.mark("edits.make moving")
    imgui.end_disabled()
    imgui.set_item_tooltip(
        "Marks the drawn volume, or the box around the selection, as moving from the next training on"
    )
    imgui.end_disabled()
