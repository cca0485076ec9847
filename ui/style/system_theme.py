"""Whether the desktop is light or dark, asked on a thread: some desktops answer by a program that takes its time.

Linux desktops keep it in the settings of GNOME, which others follow; macOS and Windows in their preferences. Where none
of them answers it counts as dark.
"""

from __future__ import annotations

import subprocess
import sys
import threading

TIMEOUT_S = 5.0
_COMMANDS = {
    "linux": ["gsettings", "get", "org.gnome.desktop.interface", "color-scheme"],
    "darwin": ["defaults", "read", "-g", "AppleInterfaceStyle"],
    "win32": [
        "reg",
        "query",
        r"HKCU\Software\Microsoft\Windows\CurrentVersion\Themes\Personalize",
        "/v",
        "AppsUseLightTheme",
    ],
}


class SystemTheme:
    """Asks once, when it is first needed."""

    def __init__(self) -> None:
        self._is_light = False
        self._thread: threading.Thread | None = None

    @property
    def is_light(self) -> bool:
        """Is the desktop light? False until that is known."""
        if self._thread is None:
            self._thread = threading.Thread(target=self._ask, name="theme of the desktop", daemon=True)
            self._thread.start()
        return self._is_light

    def _ask(self) -> None:
        platform = "linux" if sys.platform.startswith("linux") else sys.platform
        if platform not in _COMMANDS:
            return
        try:
            done = subprocess.run(
                _COMMANDS[platform],
                stdin=subprocess.DEVNULL,
                capture_output=True,
                text=True,
                timeout=TIMEOUT_S,
                check=False,
            )
        except (OSError, subprocess.SubprocessError, ValueError):
            return
        self._is_light = says_light(platform, done.stdout, is_answered=done.returncode == 0)


def says_light(platform: str, answer: str, *, is_answered: bool) -> bool:
    """Whether the answer of a desktop means a light theme. platform: "linux", "darwin" or "win32"."""
    if platform == "darwin":  # where the desktop is light there is no such entry
        return "dark" not in answer.lower()
    if not is_answered:
        return False
    if platform == "win32":
        return answer.strip().lower().endswith("0x1")
    return "light" in answer or "default" in answer
