"""The pointer's use over the track: scrub, zoom, pan, play around a seam, go to a marker, move or edit it, and move
keys of the camera path and of volumes.
"""

from __future__ import annotations

from imgui_bundle import imgui

from app.session.editing.edit_commands import MoveMarker
from app.session.session_view import SessionView
from app.session.showing.look_commands import SetFrame
from ui.panels.state import Dispatch
from ui.panels.timeline.key_lanes.diamonds import DRAG_FROM
from ui.panels.timeline.key_lanes.path_lane import handle_keys_of_path
from ui.panels.timeline.key_lanes.volume_lane import handle_keys_of_volume
from ui.panels.timeline.marker_box import edit_marker
from ui.panels.timeline.rows.object_lane import object_at, scroll_objects
from ui.panels.timeline.rows.seam_lane import seam_at
from ui.panels.timeline.rows.small_lanes import marker_at
from ui.panels.timeline.rows.stage import TimelineStage
from ui.panels.timeline.rows.take_lane import segment_at

LEFT, MIDDLE = 0, 2
EDGE_PAN_SHARE = 0.02
"""Share of the shown part by which the view moves on per drawn frame, while a scrub is held beyond its edge."""


def handle_track(stage: TimelineStage, session: SessionView, dispatch: Dispatch) -> None:
    """For the item drawn last, the invisible button of the track. Changes the shown part from the next frame on."""
    _handle_wheel(stage, session)
    _handle_middle_drag(stage, session)
    _handle_left(stage, session, dispatch)


def _handle_wheel(stage: TimelineStage, session: SessionView) -> None:
    """Ctrl and the wheel zoom at the pointer, as pinching does; the wheel alone moves through time, either way."""
    io, view, n_frames = imgui.get_io(), stage.ui.timeline, session.timeline.n_frames
    if stage.pointer is None or not (io.mouse_wheel or io.mouse_wheel_h):
        return
    if io.key_ctrl:
        view.zoom(io.mouse_wheel, stage.scale.position_at(stage.pointer[0]), n_frames)
    elif not scroll_objects(stage, session, io.mouse_wheel):
        view.pan(-io.mouse_wheel - io.mouse_wheel_h, n_frames)
    stage.ui.redraw_within(0.0)


def _handle_middle_drag(stage: TimelineStage, session: SessionView) -> None:
    view = stage.ui.timeline
    if stage.pointer is not None and imgui.is_mouse_clicked(MIDDLE):
        view.is_panning = True
    if view.is_panning:
        view.pan_by(-imgui.get_io().mouse_delta.x / stage.scale.per_frame, session.timeline.n_frames)
        view.is_panning = imgui.is_mouse_down(MIDDLE)


def _handle_left(stage: TimelineStage, session: SessionView, dispatch: Dispatch) -> None:
    view, timeline = stage.ui.timeline, session.timeline
    if handle_keys_of_path(stage, session, dispatch) or handle_keys_of_volume(stage, session, dispatch):
        return
    if _drag_marker(stage, session, dispatch):
        return
    if _press_segment(stage, session):
        return
    if imgui.is_item_activated():
        one = object_at(stage, session)
        if one is not None:
            stage.ui.objects.choose(one.object_id)
        seam = seam_at(stage, session)
        view.pressed_seam = None if seam is None else session.clips[seam[0]].start
        if view.pressed_seam is not None:
            timeline.play_around(view.pressed_seam)
            return
    # A quick drag's last stretch arrives in the same frame as the release, when the item is active no more.
    is_held = imgui.is_item_active() or imgui.is_item_deactivated()
    if not is_held:
        view.pressed_seam = None
    if is_held and view.pressed_seam is None:
        _scrub(stage, session, dispatch)
    if stage.pointer is not None and imgui.is_mouse_double_clicked(LEFT):
        marker = marker_at(stage, timeline)
        if marker is not None:
            edit_marker(timeline, dispatch, stage.ui, marker.frame_index)
        elif view.pressed_seam is None:
            view.show_all()


def _press_segment(stage: TimelineStage, session: SessionView) -> bool:
    """Whether a segment of the take was pressed, which chooses it and does nothing else."""
    view = stage.ui.timeline
    if imgui.is_item_activated():
        segment = segment_at(stage, session)
        view.is_segment_pressed = segment is not None
        if segment is not None:
            view.segment = segment
    is_held = imgui.is_item_active() or imgui.is_item_deactivated()
    view.is_segment_pressed = view.is_segment_pressed and is_held
    return view.is_segment_pressed


def _drag_marker(stage: TimelineStage, session: SessionView, dispatch: Dispatch) -> bool:
    """Whether the pointer moves a marker, and does nothing else. A press alone goes to its frame, as any other does."""
    view, timeline, x = stage.ui.timeline, session.timeline, imgui.get_io().mouse_pos.x
    if imgui.is_item_activated():
        marker = marker_at(stage, timeline)
        view.pressed_marker = None if marker is None else marker.frame_index
        view.marker_from = x
        view.begin_gesture()
        return False
    is_held = imgui.is_item_active() or imgui.is_item_deactivated()
    if view.pressed_marker is None or not is_held:
        view.pressed_marker = None
        return False
    if view.marker_from is not None and abs(x - view.marker_from) >= DRAG_FROM:
        view.marker_from = None
    frame_index = timeline.clamped(stage.scale.frame_at(x))
    if view.marker_from is None and frame_index != view.pressed_marker and timeline.markers.at(frame_index) is None:
        dispatch(MoveMarker(view.pressed_marker, frame_index, view.gesture))
        if timeline.markers.at(frame_index) is not None:  # it was not refused
            view.pressed_marker = frame_index
            dispatch(SetFrame(frame_index))
    return True


def _scrub(stage: TimelineStage, session: SessionView, dispatch: Dispatch) -> None:
    x, scale, timeline = imgui.get_io().mouse_pos.x, stage.scale, session.timeline
    marker = marker_at(stage, timeline) if imgui.is_item_activated() else None
    frame_index = scale.frame_at(x) if marker is None else marker.frame_index
    if frame_index != timeline.frame_index:
        dispatch(SetFrame(frame_index))
    beyond = x - min(max(x, scale.x0), scale.x1)
    if stage.ui.timeline.is_zoomed and beyond and imgui.is_item_active():
        step = EDGE_PAN_SHARE * scale.shown.length * (1 if beyond > 0 else -1)
        stage.ui.timeline.pan_by(step, timeline.n_frames)
        stage.ui.redraw_within(0.03)
