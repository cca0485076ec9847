"""Evidence of a finding, as pictures side by side: frames, or two cameras with matches and epipolar lines."""

from __future__ import annotations

from collections.abc import Callable

from imgui_bundle import ImVec2, imgui

from app.session.session_view import SessionView
from app.session.showing.look_commands import LookThrough, SetFrame
from engine.camera.rig import CameraRig
from engine.doctor.finding import Finding, PairEvidence, Point
from ui.gl import ImageTexture
from ui.panels.pieces.widgets import elided, text_wrapped_dim
from ui.panels.state import Dispatch, Rect, UiState
from ui.panels.welcome.thumbnails import Thumbnails
from ui.style import theme
from ui.style.theme import ON_PICTURE

WIDTH_PX = 480
MOST = 24
GAP = 8.0
SMALLEST, WIDEST = 110.0, 460.0
CAPTION = 20.0


class Evidence:
    """Owns textures. GL thread only.

    Args:
        make_texture: Makes an empty texture.
    """

    def __init__(self, make_texture: Callable[[], ImageTexture]) -> None:
        self._pictures = Thumbnails(make_texture, width_px=WIDTH_PX, most=MOST)

    def release(self) -> None:
        """Free all pictures, as when another capture was opened."""
        self._pictures.release()

    def draw(self, session: SessionView, finding: Finding, rig: CameraRig, dispatch: Dispatch, ui: UiState) -> None:
        """Fill the rest of the window with the pictures of one finding; a click goes there."""
        self._pictures.begin()
        boxes: list[tuple[str, int, str]] = []
        pairs: dict[int, PairEvidence] = {}
        for evidence in finding.evidence:
            if isinstance(evidence, PairEvidence):
                pairs[len(boxes)] = evidence
                boxes.append((evidence.camera, evidence.frame, f"{evidence.camera}: {evidence.caption}"))
                boxes.append((evidence.other, evidence.frame, f"{evidence.other}: lines where the points should lie"))
            else:
                boxes.append((evidence.camera, evidence.frame, evidence.caption))
        boxes = [box for box in boxes if box[0] in rig.names]
        if not boxes:
            text_wrapped_dim("No pictures for this finding.")
            return
        width, height = (int(value) for value in rig.image_sizes[rig.names.index(boxes[0][0])])
        aspect, room = width / max(height, 1), imgui.get_content_region_avail()
        shown = picture_width(room.x, room.y, aspect, len(boxes))
        per_row = max(int((room.x + GAP) / (shown + GAP)), 1)
        if pairs:
            per_row = max(per_row // 2 * 2, 2)
        rects: list[Rect] = []
        for index, (name, frame, caption) in enumerate(boxes):
            if index % per_row:
                imgui.same_line(0.0, GAP)
            rects.append(self._draw_box(session, index, (name, frame, caption), (shown, aspect), rig, dispatch, ui))
        for first, pair in pairs.items():
            if first + 1 < len(rects):
                draw_matches(imgui.get_window_draw_list(), pair, rects[first], rects[first + 1])

    def _draw_box(
        self,
        session: SessionView,
        index: int,
        box: tuple[str, int, str],
        shape: tuple[float, float],
        rig: CameraRig,
        dispatch: Dispatch,
        ui: UiState,
    ) -> Rect:
        name, frame, caption = box
        shown, aspect = shape
        camera = rig.names.index(name)
        imgui.push_id(index)
        imgui.begin_group()
        corner = imgui.get_cursor_screen_pos()
        is_clicked = imgui.invisible_button("##picture", ImVec2(shown, shown / aspect))
        ui.mark(f"doctor.picture{index}")
        rect = Rect(corner.x, corner.y, corner.x + shown, corner.y + shown / aspect)
        self._pictures.draw(session, camera, frame, rect, ui)
        draw = imgui.get_window_draw_list()
        if imgui.is_item_hovered() or imgui.is_item_focused():
            draw.add_rect(rect.low, rect.high, theme.u32(theme.SKY), 3, thickness=2)
        imgui.text_disabled("")
        draw.add_text(ImVec2(rect.x0, rect.y1 + 3), theme.u32(theme.TEXT_DIM), elided(caption, shown))
        imgui.end_group()
        imgui.pop_id()
        if is_clicked:
            dispatch(SetFrame(frame))
            dispatch(LookThrough(camera))
        return rect


def picture_width(room_x: float, room_y: float, aspect: float, n: int) -> float:
    """How wide pictures are drawn so that two stand side by side and, if there is room, a row is seen whole."""
    half = (room_x - GAP) / 2 if n > 1 else room_x
    whole = max(room_y - CAPTION - GAP, SMALLEST / aspect) * aspect
    return max(min(half, whole, WIDEST), min(SMALLEST, room_x))


def draw_matches(draw: imgui.ImDrawList, pair: PairEvidence, first: Rect, second: Rect) -> None:
    """The same places in both pictures by number, and in the second the lines on which they ought to lie."""
    line, ring = theme.u32(theme.faded(ON_PICTURE.sky, 0.7)), theme.u32(ON_PICTURE.orange)
    dark = theme.u32(theme.faded(theme.VOID, 0.8))
    for start, end in pair.lines:
        if start != end:
            draw.add_line(_at(start, second), _at(end, second), line, 1.0)
    for points, rect in ((pair.points, first), (pair.other_points, second)):
        for point in points:
            middle = _at(point, rect)
            draw.add_circle(middle, 4.5, dark, 0, 3.2)
            draw.add_circle(middle, 4.5, ring, 0, 1.6)


def _at(point: Point, rect: Rect) -> ImVec2:
    return ImVec2(rect.x0 + point[0] * rect.width, rect.y0 + point[1] * rect.height)
