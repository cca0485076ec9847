"""Text that others wrote, such as names of cameras and files, as it may be printed and logged."""

from __future__ import annotations

import unicodedata

_KEPT = "\n\t\u200c\u200d"
"""What lays out our own text, and what joins letters or signs into one."""
_OBEYED = ("Cc", "Cf", "Cs", "Zl", "Zp")
"""Unicode's categories of characters that are commands, halves of characters, or ends of lines."""


def printable(text: str) -> str:
    """The text with everything written out that a terminal would obey or could not show.

    Control characters, among them the escape that starts a terminal's commands, marks that turn the direction of
    writing, and halves of characters, which no encoding holds, become ``\\x1b`` or ``\\u202e``. Line breaks and tabs
    stay.
    """
    if text.isascii() and text.isprintable():
        return text
    return "".join(_written_out(part) if _is_obeyed(part) else part for part in text)


def _is_obeyed(part: str) -> bool:
    return unicodedata.category(part) in _OBEYED and part not in _KEPT


def _written_out(part: str) -> str:
    return part.encode("unicode_escape").decode("ascii")
