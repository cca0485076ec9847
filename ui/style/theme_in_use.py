"""ThemeInUse: keeps the colours of the window those that the user prefers, also while the desktop's change."""

from __future__ import annotations

from ui.style import theme
from ui.style.palette import DARK, LIGHT
from ui.style.system_theme import SystemTheme


class ThemeInUse:
    """Switches colours of the current ImGui context, and only where they are others than before."""

    def __init__(self) -> None:
        self._used: str | None = None
        self._system = SystemTheme()

    def follow(self, wanted: str) -> bool:
        """Use the theme of this name; "system" is that of the desktop. Whether colours have changed."""
        palette = theme.named(wanted)
        if wanted == "system":
            palette = LIGHT if self._system.is_light else DARK
        if palette.name == self._used:
            return False
        self._used = palette.name
        theme.use(palette)
        return True
