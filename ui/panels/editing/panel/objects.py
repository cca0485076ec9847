"""The section of objects: people and things with a name, where they are, and what can be done with them."""

from __future__ import annotations

from imgui_bundle import ImVec2, ImVec4, imgui

from app.document.changes.object_words import confidence_text, runs_within, seen_text
from app.document.changes.reach_words import frames_text
from app.session.commands import CancelJob
from app.session.objects.object_commands import (
    CorrectObject,
    FindObject,
    MakeObject,
    RecolourObject,
    RemoveObject,
    RenameObject,
    SelectObject,
    SetObjectSpan,
    SetObjectTrained,
)
from app.session.session_view import SessionView
from app.status import JobStatus
from engine.editing.edit import MAX_NAME_CHARACTERS
from engine.editing.reach import unsearched
from engine.editing.scene_object import SceneObject
from engine.text import one_line
from ui.panels.editing.panel.sections import section_header
from ui.panels.pieces.widgets import draw_job_bar, elided, text_wrapped_dim
from ui.panels.state import Dispatch, UiState
from ui.style import theme
from ui.style.theme import Icon

ROW_HEIGHT, SWATCH = 42.0, 22.0
LEAST_ROWS, MOST_ROWS = 1.2, 4.2


def draw_objects(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    """The list, the chosen one below it, and how far a search is."""
    objects = session.edits.objects
    ui.objects.follow(objects)
    if not section_header(ui, "objects", is_used=bool(objects)):
        return
    imgui.begin_disabled(not (session.edits.can_edit and session.selection.n_gaussians))
    if imgui.button("New object from selection", ImVec2(-1, 0)):
        make_object(session, dispatch, ui)
    ui.mark("objects.new")
    imgui.end_disabled()
    imgui.set_item_tooltip("Names what is selected in this frame, and finds it in all clips (Ctrl+Shift+G)")
    if not objects:
        text_wrapped_dim("Select a person or a thing in one frame; it is then found in all clips.")
        return
    spacing = imgui.get_style().item_spacing.y
    n_rows = min(max(len(objects) + 0.2, LEAST_ROWS), MOST_ROWS)
    if imgui.begin_child("objects", ImVec2(0, n_rows * (ROW_HEIGHT + spacing))):
        for one in objects:
            imgui.push_id(one.object_id)
            _draw_row(session, dispatch, ui, one)
            imgui.pop_id()
    imgui.end_child()
    one = session.edits.object(ui.objects.chosen)
    if one is not None:
        imgui.push_id(one.object_id)
        _draw_chosen(session, dispatch, ui, one)
        imgui.pop_id()
    if imgui.checkbox("Outline all objects", ui.objects.has_all_outlines)[0]:
        ui.objects.has_all_outlines = not ui.objects.has_all_outlines
    ui.mark("objects.outlines")
    imgui.set_item_tooltip("Otherwise only the chosen one is outlined in the picture (Ctrl+Shift+O)")


def make_object(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    """Make an object of the selection and choose it, so that edits act on it."""
    before = {one.object_id for one in session.edits.objects}
    dispatch(MakeObject())
    made = [one.object_id for one in session.edits.objects if one.object_id not in before]
    if made:
        ui.objects.choose(made[-1])


def job_of(session: SessionView, one: SceneObject) -> JobStatus | None:
    """How far the search for an object is; None while none runs."""
    return next((job for job in session.jobs if job.name == f"Finding {one.name}"), None)


def state_text(session: SessionView, one: SceneObject) -> str:
    """Where an object is, and how sure that is."""
    missing = runs_within(one, ((clip.start, clip.stop) for clip in unsearched(one, session.edits.clips)))
    words = [seen_text(one), confidence_text(one)]
    words += [f"not looked at: {frames_text(missing)}"] if missing else []
    words += [] if one.is_trained else ["left out of training"]
    return ", ".join(filter(None, words))


def _draw_row(session: SessionView, dispatch: Dispatch, ui: UiState, one: SceneObject) -> None:
    tool, low = ui.objects, imgui.get_cursor_screen_pos()
    is_chosen = tool.chosen == one.object_id
    flags = imgui.SelectableFlags_.allow_overlap | imgui.SelectableFlags_.allow_double_click
    if imgui.selectable("##object", is_chosen, flags, ImVec2(0, ROW_HEIGHT))[0]:
        if imgui.is_mouse_double_clicked(imgui.MouseButton_.left):
            tool.choose(one.object_id)
            tool.rename(one)
        else:
            tool.choose(None if is_chosen else one.object_id)
    ui.mark(f"objects.row{one.object_id}")
    if is_chosen and imgui.is_window_focused() and imgui.is_key_pressed(imgui.Key.f2, False):
        tool.rename(one)
    if not imgui.is_item_visible() and tool.renamed != one.object_id:  # scrolled away
        return
    high, draw = imgui.get_item_rect_max(), imgui.get_window_draw_list()
    color = (*one.color, 1.0)
    draw.add_rect_filled(ImVec2(low.x + 4, low.y + 10), ImVec2(low.x + SWATCH, low.y + 28), theme.u32(color), 3)
    x, room = low.x + SWATCH + 8, high.x - low.x - SWATCH - 12
    words = state_text(session, one)
    job = job_of(session, one)
    if job is not None:
        words = f"looking for it, {100 * job.done:.0f} %"
        ui.redraw_within(0.2)
    is_calm = "doubtful" not in words and "not looked at" not in words
    if tool.renamed == one.object_id:
        _draw_name_field(session, dispatch, ui, one, ImVec2(x, low.y + 1))
    else:
        draw.add_text(ImVec2(x, low.y + 3), theme.u32(theme.TEXT), elided(one_line(one.name), room))
    sign = "" if is_calm else f"{Icon.WARNING}  "
    dim = theme.u32(theme.TEXT_DIM if is_calm else theme.ORANGE)
    draw.add_text(ImVec2(x, low.y + 22), dim, elided(f"{sign}{words}", room))
    if imgui.is_mouse_hovering_rect(low, high) and imgui.is_window_hovered():
        imgui.set_tooltip(f"{words}\nDouble-click or F2 to rename")


def _draw_name_field(session: SessionView, dispatch: Dispatch, ui: UiState, one: SceneObject, at: ImVec2) -> None:
    tool, after = ui.objects, imgui.get_cursor_screen_pos()
    imgui.set_cursor_screen_pos(at)
    imgui.set_next_item_width(-4)
    if tool.is_renaming_new:
        imgui.set_keyboard_focus_here()
    flags = imgui.InputTextFlags_.enter_returns_true | imgui.InputTextFlags_.auto_select_all
    is_entered, tool.text = imgui.input_text("##name", tool.text, flags)
    ui.mark("objects.name")
    is_over = is_entered or (imgui.is_item_deactivated() and not tool.is_renaming_new)
    tool.is_renaming_new = False
    if is_over:
        tool.renamed = None
        name = tool.text.strip()[:MAX_NAME_CHARACTERS]
        if name and name != one.name and session.edits.can_edit and not imgui.is_key_pressed(imgui.Key.escape):
            dispatch(RenameObject(one.object_id, name))
    imgui.set_cursor_screen_pos(after)
    imgui.dummy(ImVec2(0, 0))


def _draw_chosen(session: SessionView, dispatch: Dispatch, ui: UiState, one: SceneObject) -> None:
    """Buttons for the chosen object, its colour and its frames."""
    can_edit, has_selection = session.edits.can_edit, bool(session.selection.n_gaussians)
    width = (imgui.get_content_region_avail().x - imgui.get_style().item_spacing.x) / 2
    job = job_of(session, one)
    rows = (
        ("Add selection", "add", CorrectObject(one.object_id, adds=True), can_edit and has_selection,
         "What is selected in this frame belongs to it as well (Alt+I)"),
        ("Remove selection", "subtract", CorrectObject(one.object_id, adds=False), can_edit and has_selection,
         "What is selected in this frame does not belong to it (Alt+Shift+I)"),
        ("Find again", "find", FindObject(one.object_id), can_edit and job is None,
         "Looks for it in all clips again"),
        ("Select", "select", SelectObject(one.object_id), True,
         "Selects what it consists of in this frame (Alt+O)"),
    )  # fmt: skip
    for place, (label, name, command, is_possible, tip) in enumerate(rows):
        if place % 2:
            imgui.same_line()
        imgui.begin_disabled(not is_possible)
        if imgui.button(label, ImVec2(width, 0)):
            dispatch(command)
        ui.mark(f"objects.{name}")
        imgui.end_disabled()
        imgui.set_item_tooltip(tip)
    if job is not None:
        draw_job_bar(job, ui, width, imgui.get_frame_height())
        imgui.same_line()
        if imgui.button("Stop looking", ImVec2(width, 0)):
            dispatch(CancelJob(job.name))
        ui.mark("objects.stop")
    imgui.begin_disabled(not can_edit)
    is_changed, color = imgui.color_edit3("##color", list(one.color), imgui.ColorEditFlags_.no_inputs)
    ui.mark("objects.color")
    if imgui.is_item_activated():
        ui.editing.begin_gesture()
    if is_changed:
        red, green, blue = (min(max(float(part), 0.0), 1.0) for part in color)
        dispatch(RecolourObject(one.object_id, (red, green, blue), ui.editing.gesture))
    imgui.same_line()
    is_clicked, is_trained = imgui.checkbox("Trained", one.is_trained)
    ui.mark("objects.trained")
    imgui.set_item_tooltip(
        "Whether clips that are trained again see it; without, it is masked in the pictures where it was found"
    )
    if is_clicked:
        dispatch(SetObjectTrained(one.object_id, is_trained))
    imgui.same_line()
    _draw_span(session, dispatch, ui, one)
    imgui.push_style_color(imgui.Col_.text, ImVec4(*theme.ORANGE))
    if imgui.button("Remove object", ImVec2(-1, 0)):
        dispatch(RemoveObject(one.object_id))
    ui.mark("objects.remove")
    imgui.pop_style_color()
    imgui.set_item_tooltip("Removes it, and the edits that act on it")
    imgui.end_disabled()


def _draw_span(session: SessionView, dispatch: Dispatch, ui: UiState, one: SceneObject) -> None:
    timeline = session.timeline
    first, last = timeline.in_frame, timeline.out_frame
    span = (0 if first is None else first, None if last is None else last + 1)
    is_whole = (one.first, one.stop) == (0, None)
    label = "In to out" if is_whole or span != (one.first, one.stop) else "All frames"
    wanted = span if label == "In to out" else (0, None)
    imgui.begin_disabled(wanted == (one.first, one.stop))
    if imgui.button(f"{label}##span", ImVec2(-1, 0)):
        dispatch(SetObjectSpan(one.object_id, *wanted))
    ui.mark("objects.span")
    imgui.end_disabled()
    there = "all frames" if is_whole else f"frames {one.first} to {'the last' if one.stop is None else one.stop - 1}"
    imgui.set_item_tooltip(f"Lets it exist from in to out of the timeline only, or in all frames; now in {there}")
