"""Palette: every colour of the window, dark or light, as one value; and how far text stands out from its background.

Plain numbers; imports no library. Pictures stay on the same dark grey in both, so what lies over a picture is written
in the colours of `DARK`, whatever the panels are drawn in.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from ui.style import colors
from ui.style.colors import Color, rgb

VOID = rgb(18, 20, 24)
"""Behind pictures, in both themes; app.playback.modes.arrays.BACKGROUND is the same."""


@dataclass(frozen=True, slots=True)
class ThemeColors:
    """All colours of one theme. `ui.style.theme` offers those in use under the same names in capitals.

    Attributes:
        name: "dark" or "light".
        is_light: Whether text is darker than what is behind it.
        backdrop, panel, popup, raised, raised_hover, raised_active: Surfaces; the first ones lie deepest.
        outline: Borders and small ticks.
        text, text_dim: Words, and less important ones next to them.
        text_on_accent: Words on a surface of the colour `sky`.
        sky, orange, green, yellow, vermillion, purple: Hues that carry meaning, as light or dark as words in them have
            to be on all surfaces. sky_light and sky_dark are for a button under the pointer and when it is pressed.
        playhead, text_on_playhead: The line of the shown frame on the timeline, and its number.
        grid: Lines of plots.
        stripe: Every other row of a table.
        shade: Over everything behind a question.
        role_colors, region_colors: Hues of ui.style.colors, for panels.
    """

    name: str
    is_light: bool
    backdrop: Color
    panel: Color
    popup: Color
    raised: Color
    raised_hover: Color
    raised_active: Color
    outline: Color
    text: Color
    text_dim: Color
    text_on_accent: Color
    sky: Color
    sky_light: Color
    sky_dark: Color
    orange: Color
    green: Color
    yellow: Color
    vermillion: Color
    purple: Color
    playhead: Color
    text_on_playhead: Color
    grid: Color
    stripe: Color
    shade: Color
    untrained: Color
    queued: Color
    void: Color = VOID
    inherited: Color = colors.INHERITED
    residual: Color = colors.RESIDUAL
    held_out: Color = colors.HELD_OUT
    role_colors: Mapping[str, Color] = field(default_factory=lambda: colors.ROLE_COLORS)
    region_colors: Mapping[str, Color] = field(default_factory=lambda: colors.REGION_COLORS)

    @property
    def clip_colors(self) -> dict[str, Color]:
        """Of the states of a clip."""
        return {
            "untrained": self.untrained,
            "queued": self.queued,
            "preparing": self.sky,
            "training": self.sky,
            "paused": self.yellow,
            "stopped": self.yellow,
            "trained": self.green,
            "failed": self.vermillion,
            "stale": self.orange,
            "damaged": self.vermillion,
        }


DARK = ThemeColors(
    name="dark",
    is_light=False,
    backdrop=rgb(24, 27, 32),
    panel=rgb(32, 36, 43),
    popup=rgb(38, 43, 51),
    raised=rgb(44, 49, 58),
    raised_hover=rgb(56, 63, 75),
    raised_active=rgb(68, 77, 92),
    outline=rgb(58, 65, 77),
    text=rgb(226, 230, 236),
    text_dim=rgb(150, 159, 173),
    text_on_accent=rgb(10, 20, 30),
    sky=colors.SKY,
    sky_light=rgb(120, 198, 242),
    sky_dark=rgb(60, 158, 214),
    orange=colors.ORANGE,
    green=rgb(40, 174, 116),
    yellow=colors.YELLOW,
    vermillion=rgb(240, 122, 50),
    purple=rgb(214, 137, 180),
    playhead=rgb(255, 255, 255),
    text_on_playhead=VOID,
    grid=rgb(255, 255, 255, 0.10),
    stripe=rgb(255, 255, 255, 0.02),
    shade=rgb(0, 0, 0, 0.45),
    untrained=rgb(139, 147, 161),
    queued=rgb(150, 159, 173),
    held_out=rgb(214, 137, 180),
)

_SKY, _ORANGE, _GREEN = rgb(0, 92, 148), rgb(133, 81, 0), rgb(0, 98, 71)
_VERMILLION, _PURPLE = rgb(160, 56, 0), rgb(139, 60, 106)
LIGHT = ThemeColors(
    name="light",
    is_light=True,
    backdrop=rgb(231, 234, 239),
    panel=rgb(246, 247, 249),
    popup=rgb(252, 253, 254),
    raised=rgb(222, 226, 232),
    raised_hover=rgb(208, 214, 223),
    raised_active=rgb(192, 200, 212),
    outline=rgb(176, 184, 196),
    text=rgb(22, 26, 32),
    text_dim=rgb(80, 88, 100),
    text_on_accent=rgb(255, 255, 255),
    sky=_SKY,
    sky_light=rgb(0, 108, 172),
    sky_dark=rgb(0, 74, 122),
    orange=_ORANGE,
    green=_GREEN,
    yellow=rgb(99, 89, 0),
    vermillion=_VERMILLION,
    purple=_PURPLE,
    playhead=rgb(22, 26, 32),
    text_on_playhead=rgb(255, 255, 255),
    grid=rgb(0, 0, 0, 0.10),
    stripe=rgb(0, 0, 0, 0.03),
    shade=rgb(0, 0, 0, 0.30),
    untrained=rgb(94, 102, 114),
    queued=rgb(80, 88, 100),
    inherited=_SKY,
    residual=_ORANGE,
    held_out=_PURPLE,
    role_colors={
        "static": _SKY,
        "moving": _GREEN,
        "promoted": _VERMILLION,
        "residual": _ORANGE,
        "adapted": _GREEN,
        "replacing": _VERMILLION,
    },
    region_colors={"static": _SKY, "dynamic": _VERMILLION},
)
THEMES: dict[Literal["dark", "light", "system"], str] = {
    "dark": "dark",
    "light": "light",
    "system": "as the desktop",
}
"""Choices and their words."""
PALETTES = {palette.name: palette for palette in (DARK, LIGHT)}


def contrast(first: Color, second: Color) -> float:
    """Ratio of the luminances of two opaque colours as WCAG 2 defines it: 1 for the same, 21 for black and white."""
    lighter, darker = sorted((_luminance(first), _luminance(second)), reverse=True)
    return (lighter + 0.05) / (darker + 0.05)


def _luminance(color: Color) -> float:
    red, green, blue = (value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4 for value in color[:3])
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue
