"""The axes in the corner of a picture: how the view is turned, and a way to look along one of them."""

from __future__ import annotations

from dataclasses import dataclass

from imgui_bundle import ImVec2, imgui

from app.playback.views.orbit_view import OrbitView
from app.playback.views.scene_axes import scene_axes, view_from
from ui.panels.state import Rect
from ui.style import theme
from ui.style.theme import ON_PICTURE

RADIUS, TIP_RADIUS, MARGIN = 32.0, 9.0, 10.0
SIZE = 2 * (RADIUS + TIP_RADIUS)
SMALLEST_AREA = 190.0
"""In a picture with a shorter side than this it would only be in the way; units."""
COLORS = (ON_PICTURE.vermillion, ON_PICTURE.green, ON_PICTURE.sky)
LETTERS = ("X", "Y", "Z")


@dataclass(frozen=True, slots=True)
class Tip:
    """The end of an axis.

    Attributes:
        axis, sign: Which one.
        x, y: Where it is drawn, window coordinates.
        depth: How far behind the middle it is; negative in front of it.
        name: The view from there, see app.playback.views.scene_axes.AXIS_VIEWS.
    """

    axis: int
    sign: int
    x: float
    y: float
    depth: float
    name: str


def gizmo_rect(area: Rect) -> Rect | None:
    """Where the axes are drawn in a picture; None where there is no room for them."""
    if min(area.width, area.height) < SMALLEST_AREA:
        return None
    return Rect(area.x1 - MARGIN - SIZE, area.y0 + MARGIN, area.x1 - MARGIN, area.y0 + MARGIN + SIZE)


def gizmo_tips(view: OrbitView, rect: Rect) -> list[Tip]:
    """The six ends, farthest first."""
    rotation = view.shown_pose.rotation
    middle_x, middle_y = rect.center
    tips = []
    for axis, direction in enumerate(scene_axes(view.up)):
        for sign in (1, -1):
            x, y, depth = sign * (rotation @ direction)
            name = view_from(view.up, axis, sign)
            tips.append(Tip(axis, sign, middle_x + RADIUS * x, middle_y + RADIUS * y, float(depth), name))
    return sorted(tips, key=lambda tip: -tip.depth)


def tip_under(view: OrbitView, rect: Rect, x: float, y: float) -> Tip | None:
    """The end under the pointer, the nearest of those that are; None off them all."""
    near = [tip for tip in gizmo_tips(view, rect) if (tip.x - x) ** 2 + (tip.y - y) ** 2 <= (TIP_RADIUS + 1.5) ** 2]
    return near[-1] if near else None


def draw_gizmo(draw: imgui.ImDrawList, view: OrbitView, rect: Rect, pointer: tuple[float, float]) -> None:
    """Draw the axes; the positive ends carry letters, the others are rings."""
    middle = ImVec2(*rect.center)
    is_over = rect.contains(*pointer)
    pointed = tip_under(view, rect, *pointer) if is_over else None
    draw.add_circle_filled(middle, SIZE / 2, theme.u32(theme.faded(theme.VOID, 0.72 if is_over else 0.45)))
    for tip in gizmo_tips(view, rect):
        color = COLORS[tip.axis]
        is_behind = tip.depth > 0.15
        shown = theme.faded(color, 0.55 if is_behind else 1.0)
        at = ImVec2(tip.x, tip.y)
        is_pointed = pointed is not None and (pointed.axis, pointed.sign) == (tip.axis, tip.sign)
        if tip.sign > 0:
            draw.add_line(middle, at, theme.u32(shown), 2.0)
            draw.add_circle_filled(at, TIP_RADIUS, theme.u32(shown))
        else:
            draw.add_circle_filled(at, TIP_RADIUS - 2, theme.u32(theme.faded(theme.VOID, 0.9)))
            draw.add_circle(at, TIP_RADIUS - 2, theme.u32(shown), 0, 1.5)
        if is_pointed:
            draw.add_circle(at, TIP_RADIUS + 1, theme.u32(ON_PICTURE.playhead), 0, 2.0)
        if tip.sign > 0 or is_pointed:
            text = LETTERS[tip.axis] if tip.sign > 0 else f"-{LETTERS[tip.axis]}"
            size = imgui.calc_text_size(text)
            ink = ON_PICTURE.text_on_accent if tip.sign > 0 else ON_PICTURE.text
            draw.add_text(ImVec2(tip.x - size.x / 2, tip.y - size.y / 2), theme.u32(ink), text)
