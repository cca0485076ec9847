"""The take in time: its segments in the order in which they play, and the chosen one in numbers."""

from __future__ import annotations

import math

from imgui_bundle import ImVec2, imgui
from msgspec import structs

from app.document.changes.timing_changes import ChangeSegment, Order, ResetTime, TimeEdit, segment_words
from app.session.session_view import SessionView
from engine.timing.cutting import turned_segment
from engine.timing.segment import MAX_FROZEN, MAX_REPEATS, MAX_SPEED, MIN_SPEED, Segment
from engine.timing.timing import TakeTiming
from ui.panels.editing.fields import label_before, numbers, whole_numbers
from ui.panels.editing.panel.sections import section_header
from ui.panels.pieces.widgets import elided, text_wrapped_dim
from ui.panels.state import Dispatch, UiState
from ui.style.theme import Icon

PAYLOAD = "segment"
MOST_ROWS = 8
EASES = {"linear": "evenly", "smooth": "eased"}


def draw_timing(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    """Folded away until it is wanted, or a segment is chosen."""
    if not section_header(ui, "timing", is_used=ui.timeline.segment is not None):
        return
    timeline, segments = session.timeline, session.edits.timing
    if not segments:
        text_wrapped_dim(
            "The take plays as captured. Split it at the playhead (Shift+K), or trim it to the in and out points "
            "(Shift+O), to begin."
        )
        return
    view = ui.timeline
    if view.segment is not None and view.segment >= len(segments):
        view.segment = None
    timing = TakeTiming(segments, timeline.n_frames)
    imgui.text(f"{timing.n_output} frames, {timing.duration_s(timeline.fps):.2f} s")
    imgui.same_line()
    imgui.text_disabled(f"of {timeline.n_frames} captured")
    _, timeline.is_take = imgui.checkbox("Play the edited take", timeline.is_take)
    ui.mark("timing.play")
    imgui.begin_disabled(not session.edits.can_edit)
    _draw_rows(segments, dispatch, ui)
    if view.segment is not None:
        imgui.separator()
        imgui.push_id(view.segment)
        _draw_fields(segments[view.segment], view.segment, timeline.n_frames, dispatch, ui)
        imgui.pop_id()
    if imgui.button("Reset"):
        dispatch(ResetTime())
    ui.mark("timing.reset")
    imgui.set_item_tooltip("Plays the take as captured again")
    imgui.end_disabled()


def _draw_rows(segments: tuple[Segment, ...], dispatch: Dispatch, ui: UiState) -> None:
    """One row per segment; dragged onto another one it takes its place."""
    view, n, places = ui.timeline, len(segments), tuple(range(len(segments)))
    height = imgui.get_text_line_height_with_spacing()
    if imgui.begin_child("segments", ImVec2(0, min(n, MOST_ROWS) * height + 6)):
        for place, one in enumerate(segments):
            text = elided(f"{place}  {segment_words(one)}", imgui.get_content_region_avail().x - 8)
            if imgui.selectable(f"{text}##{place}", view.segment == place)[0]:
                view.segment = None if view.segment == place else place
            ui.mark(f"timing.segment{place}")
            if imgui.begin_drag_drop_source(imgui.DragDropFlags_.source_no_preview_tooltip):
                imgui.set_drag_drop_payload_py_id(PAYLOAD, place)
                imgui.end_drag_drop_source()
            if imgui.begin_drag_drop_target():
                payload = imgui.accept_drag_drop_payload_py_id(PAYLOAD)
                if payload is not None and payload.data_id != place:
                    others = [other for other in places if other != payload.data_id]
                    dispatch(Order((*others[:place], payload.data_id, *others[place:])))
                    view.segment = place
                imgui.end_drag_drop_target()
            if imgui.begin_popup_context_item(f"menu{place}"):
                for label, edit in _choices(place, one, places):
                    if imgui.menu_item(label, "", False, edit is not None)[0] and edit is not None:
                        dispatch(edit)
                    ui.mark(f"timing.menu {label.lower()}")
                imgui.end_popup()
    imgui.end_child()


def _choices(place: int, one: Segment, places: tuple[int, ...]) -> tuple[tuple[str, TimeEdit | None], ...]:
    others = tuple(other for other in places if other != place)
    swapped = list(places)
    if place:
        swapped[place - 1 : place + 1] = [place, place - 1]
    later = list(places)
    later[place : place + 2] = reversed(later[place : place + 2])
    return (
        ("Earlier", Order(tuple(swapped)) if place else None),
        ("Later", Order(tuple(later)) if place + 1 < len(places) else None),
        ("Reverse", None if one.n_frozen else ChangeSegment(place, turned_segment(one))),
        ("Duplicate", Order((*places[: place + 1], *places[place:]))),
        ("Remove", Order(others) if others else None),
    )


def _draw_fields(one: Segment, place: int, n_frames: int, dispatch: Dispatch, ui: UiState) -> None:
    def change(**values: object) -> None:
        found = changed_segment(one, **values)
        if found is not None and found != one:
            dispatch(ChangeSegment(place, found, ui.editing.gesture))

    if one.n_frozen:
        if (at := whole_numbers(ui, "segment frame", "Frame", (one.first,), low=0, high=n_frames - 1)) is not None:
            change(first=at[0], stop=at[0] + 1)
        held = whole_numbers(ui, "segment frozen", "Held for", (one.n_frozen,), low=1, high=MAX_FROZEN)
        if held is not None:
            change(n_frozen=held[0])
        return
    ends = whole_numbers(ui, "segment ends", "Frames", (one.first, one.stop - 1), low=0, high=n_frames - 1)
    if ends is not None:
        change(first=min(ends), stop=max(ends) + 1)
    for name, label, speed in (
        ("start_speed", "Speed", one.speed_at(0.0)),
        ("end_speed", "to", one.speed_at(1.0)),
    ):
        found = numbers(ui, f"segment {name}", label, (speed,), speed=0.01, low=MIN_SPEED, high=MAX_SPEED)
        if found is not None:
            both = {"start_speed": one.speed_at(0.0), "end_speed": one.speed_at(1.0), name: found[0]}
            if one.start_speed == one.end_speed and name == "start_speed":
                both["end_speed"] = found[0]
            change(**both, ramp_from=0.0, ramp_to=1.0)
    label_before("Ramp")
    if imgui.begin_combo("##ease", EASES[one.ease]):
        for ease, words in EASES.items():
            if imgui.selectable(words, one.ease == ease)[0]:
                ui.editing.begin_gesture()
                change(ease=ease)
            ui.mark(f"timing.ease {ease}")
        imgui.end_combo()
    else:
        ui.mark("timing.ease")
    is_changed, _ = imgui.checkbox("Reversed", one.is_reversed)
    ui.mark("timing.reversed")
    if is_changed:
        ui.editing.begin_gesture()
        dispatch(ChangeSegment(place, turned_segment(one)))
    repeats = whole_numbers(ui, "segment repeats", "Times", (one.repeats,), low=1, high=MAX_REPEATS)
    if repeats is not None:
        change(repeats=repeats[0])
    if one.repeats > 1:
        most = math.floor(one.pass_frames / 2)
        fade = whole_numbers(ui, "segment fade", f"{Icon.LOOP} Fade", (one.crossfade_frames,), low=0, high=most)
        imgui.set_item_tooltip("Frames in which the end of a repeat fades into the beginning of the next")
        if fade is not None:
            change(crossfade_frames=fade[0])


def changed_segment(one: Segment, **values: object) -> Segment | None:
    """A segment with other entries, its cross-fade no longer than it can be; None where they are not valid."""
    fade = int(str(values.pop("crossfade_frames", one.crossfade_frames)))
    try:
        plain = structs.replace(one, **{"crossfade_frames": 0, **values})
        most = math.floor(plain.pass_frames / 2) if plain.repeats > 1 else 0
        return structs.replace(plain, crossfade_frames=min(fade, most))
    except ValueError:
        return None
