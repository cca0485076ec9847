"""HTML by small helpers: every text is escaped unless it was made by these helpers."""

from __future__ import annotations

import base64
import html

_VOID = frozenset({"img", "meta", "br", "hr", "link"})


class Markup(str):
    """Text that is HTML already."""

    __slots__ = ()


def escaped(text: object) -> Markup:
    """Text as HTML that shows it; Markup as it is. Characters that UTF-8 cannot hold become question marks."""
    if isinstance(text, Markup):
        return text
    return Markup(html.escape(str(text).encode("utf-8", "replace").decode("utf-8"), quote=True))


def tag(name: str, /, *children: object, **attributes: object) -> Markup:
    """One element.

    Args:
        name: Such as "p".
        children: Markup, or anything else to be shown as text.
        attributes: Underscores become dashes and one at the end is dropped ("class_"); None leaves one out, True
            writes the bare name.
    """
    opened = name
    for key, value in attributes.items():
        if value is None:
            continue
        key = key.rstrip("_").replace("_", "-")
        opened += f" {key}" if value is True else f' {key}="{escaped(value)}"'
    if name in _VOID:
        return Markup(f"<{opened}>")
    return Markup(f"<{opened}>{joined(*children)}</{name}>")


def joined(*parts: object) -> Markup:
    """Parts one after another."""
    return Markup("".join(escaped(part) for part in parts))


def png_source(png: bytes) -> str:
    """A PNG file as a data URI."""
    return f"data:image/png;base64,{base64.b64encode(png).decode('ascii')}"
