"""Values as text for people: what came from a file or a path made fit for a message, and durations."""

from __future__ import annotations

import math

MAX_SHOWN = 60
"""Characters of a value from a file that one message repeats."""


def printable(text: str) -> str:
    """The text with everything but line breaks that a terminal would obey, or could not print, written as an escape.

    ESC sequences, other control characters, marks that turn the reading direction and halves of characters become
    backslash escapes; ordinary text, in any script, stays as it is.
    """
    if text.isprintable():
        return text
    return "".join(sign if sign.isprintable() or sign in "\n\u00a0" else _escaped(sign) for sign in text)


def one_line(text: str) -> str:
    """Any text in one line: as `printable` has it, and with line breaks written as escapes, too."""
    return printable(text).replace("\n", "\\n")


def shown(value: object) -> str:
    """A value as a message repeats it: as Python writes it, cut off after MAX_SHOWN characters."""
    text = repr(value if not isinstance(value, str) else value[: MAX_SHOWN + 1])
    return text if len(text) <= MAX_SHOWN else f"{text[: MAX_SHOWN - 3]}..."


def camera_text(name: str) -> str:
    """A camera by its name, in which it need not say that it is one."""
    return name if name.lower().startswith("cam") else f"camera {name}"


def duration_text(seconds: float | None) -> str:
    """Minutes and seconds below an hour, hours and minutes above; a dash when unknown."""
    if seconds is None or not 0 <= seconds < 1e9:
        return "–"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes}:{rest:02d}" if minutes < 60 else f"{minutes // 60} h {minutes % 60:02d} min"


def _escaped(sign: str) -> str:
    return sign.encode("unicode_escape").decode("ascii")


def figure_text(value: float) -> str:
    """A measured figure in three digits, never with an exponent: 0.0123, 23.1, 1,370."""
    if value == 0 or not math.isfinite(value):
        return f"{value:g}"
    n_decimals = max(0, 2 - math.floor(math.log10(abs(value))))
    return f"{value:,.{min(n_decimals, 6)}f}"


def rate_text(fps: float) -> str:
    """A frame rate as people write it: 25, 59.94, 23.976."""
    return f"{round(fps, 3):g}"


def size_text(megabytes: float) -> str:
    """An amount of memory or disk, in two or three digits."""
    if megabytes >= 999.5:
        return f"{megabytes / 1e3:.1f} GB"
    if megabytes < 0.05:
        return f"{1e3 * megabytes:.0f} kB"
    return f"{megabytes:.0f} MB" if megabytes >= 9.95 else f"{megabytes:.1f} MB"
