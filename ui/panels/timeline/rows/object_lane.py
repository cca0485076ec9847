"""The lane of objects: a strip for each, in its colour where it is seen, hatched where that is doubtful, with a tick at
each frame in which somebody has selected it. A press chooses an object, and goes to its frame as everywhere.
"""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from app.document.changes.object_words import doubt_text, is_doubtful, runs_within
from app.session.session_view import SessionView
from engine.editing.reach import unsearched
from engine.editing.scene_object import ObjectInClip, SceneObject
from engine.text import one_line
from ui.panels.pieces.widgets import elided
from ui.panels.state import Rect
from ui.panels.timeline.rows.rows import MAX_OBJECT_ROWS, OBJECT_HEIGHT, OBJECTS
from ui.panels.timeline.rows.stage import SMALL_TEXT, TimelineStage, hatch, small_text, small_width
from ui.style import theme

STRIP_HEIGHT, HATCH_SPACING = 9.0, 6.0
TICK_HALF = 1.0
LEAST_NAME_ROOM, MAX_NAME_WIDTH = 40.0, 160.0


def first_row(stage: TimelineStage, session: SessionView) -> int:
    """The first object that is shown."""
    return max(min(stage.ui.objects.first_row, len(session.edits.objects) - MAX_OBJECT_ROWS), 0)


def objects_in_sight(stage: TimelineStage, session: SessionView) -> list[tuple[SceneObject, Rect]]:
    """Objects with their strips, from top to bottom."""
    row, first = stage.rows[OBJECTS], first_row(stage, session)
    shown = session.edits.objects[first : first + MAX_OBJECT_ROWS]
    top = (OBJECT_HEIGHT - STRIP_HEIGHT) / 2
    return [
        (one, Rect(row.x0, y := row.y0 + place * OBJECT_HEIGHT + top, row.x1, y + STRIP_HEIGHT))
        for place, one in enumerate(shown)
        if row.y0 + (place + 1) * OBJECT_HEIGHT <= row.y1 + 1
    ]


def draw_object_lane(stage: TimelineStage, session: SessionView) -> None:
    """All strips in sight, and a note on the clip under the pointer."""
    for one, strip in objects_in_sight(stage, session):
        stage.ui.mark_rect(f"timeline.object{one.object_id}", strip)
        _draw_strip(stage, session, one, strip)
    pointed = object_at(stage, session)
    if pointed is not None and stage.pointer is not None:
        imgui.set_tooltip(_note(session, pointed, stage.scale.frame_at(stage.pointer[0])))


def object_at(stage: TimelineStage, session: SessionView) -> SceneObject | None:
    """The object whose strip is under the pointer."""
    if stage.pointer is None or not stage.is_pointed_at(OBJECTS):
        return None
    near = (OBJECT_HEIGHT - STRIP_HEIGHT) / 2
    y = stage.pointer[1]
    return next((one for one, at in objects_in_sight(stage, session) if at.y0 - near <= y < at.y1 + near), None)


def scroll_objects(stage: TimelineStage, session: SessionView, ticks: float) -> bool:
    """Show other objects, where there are more than fit. Whether the wheel has served."""
    if not stage.is_pointed_at(OBJECTS) or len(session.edits.objects) <= MAX_OBJECT_ROWS or not ticks:
        return False
    stage.ui.objects.first_row = first_row(stage, session) + (-1 if ticks > 0 else 1)
    stage.ui.objects.first_row = first_row(stage, session)
    return True


def _draw_strip(stage: TimelineStage, session: SessionView, one: SceneObject, strip: Rect) -> None:
    draw, is_chosen = stage.draw, stage.ui.objects.chosen == one.object_id
    color = (*one.color, 1.0)
    draw.add_rect_filled(strip.low, strip.high, theme.u32(theme.faded(theme.TEXT, 0.06)), 2)
    for clip in one.clips:
        for first, stop in runs_within(one, clip.seen):
            part = _between(stage, strip, first, stop)
            if part is None:
                continue
            doubtful = is_doubtful(clip)
            draw.add_rect_filled(part.low, part.high, theme.u32(theme.faded(color, 0.35 if doubtful else 1.0)), 2)
            if doubtful:
                hatch(draw, part, color, HATCH_SPACING)
    for clip in unsearched(one, session.edits.clips):
        part = _between(stage, strip, clip.start, clip.stop)
        if part is not None:
            draw.add_rect(part.low, part.high, theme.u32(theme.faded(theme.TEXT_DIM, 0.7)), 2)
    _draw_name(stage, one, strip)
    for seed in one.seeds:
        x = stage.scale.middle_of(seed.frame_index)
        if strip.x0 <= x <= strip.x1:
            low, high = ImVec2(x - TICK_HALF, strip.y0 - 3), ImVec2(x + TICK_HALF, strip.y1 + 3)
            draw.add_rect_filled(low, high, theme.u32(theme.TEXT))
    if is_chosen:
        draw.add_rect(ImVec2(strip.x0, strip.y0 - 2), ImVec2(strip.x1, strip.y1 + 2), theme.u32(theme.TEXT), 2)


def _draw_name(stage: TimelineStage, one: SceneObject, strip: Rect) -> None:
    """At the left, on a ground of its own, so that it is read on any colour."""
    name = one_line(one.name)
    if strip.width < LEAST_NAME_ROOM:
        return
    width = min(small_width(name), MAX_NAME_WIDTH, strip.width / 4)
    if small_width(name) > width:
        name = elided(name, width * imgui.get_font_size() / SMALL_TEXT)
    ground = Rect(strip.x0 + 2, strip.y0 - 3, strip.x0 + 8 + small_width(name), strip.y1 + 3)
    stage.draw.add_rect_filled(ground.low, ground.high, theme.u32(theme.faded(theme.BACKDROP, 0.8)), 2)
    small_text(stage.draw, ground.x0 + 3, (ground.y0 + ground.y1 - SMALL_TEXT) / 2 - 1, name, theme.TEXT)


def _between(stage: TimelineStage, strip: Rect, first: int, stop: int) -> Rect | None:
    """The part of a strip that frames take up, as far as it is in sight."""
    x0, x1 = max(stage.scale.left_of(first), strip.x0), min(stage.scale.left_of(stop), strip.x1)
    return Rect(x0, strip.y0, max(x1, x0 + 1), strip.y1) if x1 > strip.x0 and x0 < strip.x1 else None


def _note(session: SessionView, one: SceneObject, frame_index: int) -> str:
    """What is known of an object in the clip at a frame."""
    name = one_line(one.name)
    if any(clip.start <= frame_index < clip.stop for clip in unsearched(one, session.edits.clips)):
        return f"{name}: this clip was not looked at since it was trained, or since the object was corrected"
    clip = one.in_clip(frame_index)
    if clip is None:
        return f"{name}: not in this frame"
    return f"{name}: {_clip_words(clip, is_seen=one.is_seen(frame_index))}"


def _clip_words(clip: ObjectInClip, *, is_seen: bool) -> str:
    words = [f"{'here' if is_seen else 'not here'} in frames {clip.start}-{clip.stop - 1}"]
    words += [f"{100 * clip.confidence:.0f} % sure"]
    words += [doubt_text(clip)] if clip.doubt else []
    return ", ".join(words) + ("\nSelect it in one frame here to correct it" if is_doubtful(clip) else "")
