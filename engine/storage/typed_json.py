"""From parsed JSON to declared types, strictly: msgspec checks, and this module puts into words what it finds."""

from __future__ import annotations

import re
from typing import Any, TypeVar

import msgspec

from engine.text import shown

T = TypeVar("T")

_FOUND = re.compile(r"(?P<what>.*?)(?: - at `\$\.?(?P<place>.*)`)?$", re.DOTALL)
_STEP = re.compile(r"\[(?P<index>\d+|\.\.\.)\]|(?P<name>[^.\[]+)")
_MISSING = re.compile(r"Object missing required field `(?P<name>.*)`")
_UNKNOWN = re.compile(r"Object contains unknown field `(?P<name>.*)`")
_EXPECTED = re.compile(r"Expected `(?P<kinds>[^`]+)`(?P<limit>.*?)(?:, got .*)?$")
_KINDS = {
    "int": "a whole number",
    "float": "a number",
    "str": "a text",
    "bool": "true or false",
    "array": "a list",
    "object": "an object",
    "null": "null",
}


class EntryError(ValueError):
    """An entry of a document is missing or of the wrong kind. The text names it and fits into brackets."""


def to_type(document: Any, kind: type[T]) -> T:
    """A parsed document as the type that declares it. Texts stay texts: nothing is taken for a number that is none.

    Raises:
        EntryError: An entry is missing or of the wrong kind, or what the type itself refuses.
    """
    try:
        return msgspec.convert(document, kind)
    except msgspec.ValidationError as error:
        raise EntryError(_said(str(error), document)) from error


def _said(text: str, document: Any) -> str:
    """The fault that msgspec found, with the entry first."""
    found = _FOUND.match(text)
    assert found is not None  # every text matches
    what, place = found["what"], found["place"] or ""
    if missing := _MISSING.match(what):
        return f"{place or 'it'} has no {missing['name']}"
    if unknown := _UNKNOWN.match(what):
        return f"{place or 'it'} has an entry {shown(unknown['name'])}, which is not known"
    expected = _EXPECTED.match(what)
    if expected is None and not what.startswith("Invalid"):
        return f"{place}: {what}" if place else what  # said by the type itself
    wanted = "" if expected is None else f", not {_wanted(expected)}"
    return f"{place or 'it'} is {shown(_value_at(document, place))}{wanted}"


def _wanted(expected: re.Match[str]) -> str:
    words = [_KINDS.get(kind.strip(), kind.strip()) for kind in expected["kinds"].split("|")]
    return " or ".join(words) + expected["limit"]


def _value_at(document: Any, place: str) -> Any:
    """The value of an entry; where a key is not named, the value that holds it."""
    for step in _STEP.finditer(place):
        if step["index"] == "...":
            break
        document = document[int(step["index"])] if step["index"] else document[step["name"]]
    return document
