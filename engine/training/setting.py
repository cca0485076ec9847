"""How a setting is declared, and what is derived from the declaration: checks, parsing, help, documentation.

A setting is a field of a msgspec struct, annotated with `setting(...)`. Its type, default, range, choices, unit and
help stand there and nowhere else.
"""

from __future__ import annotations

import typing
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import msgspec

from engine.errors import ProjectError

Value = bool | int | float | str
_BOOLEANS = {"true": True, "yes": True, "1": True, "false": False, "no": False, "0": False}
_KINDS = {bool: "true or false", int: "a whole number", float: "a number", str: "one word"}


def setting(
    group: str,
    meaning: str,
    *,
    low: float | None = None,
    high: float | None = None,
    choices: Mapping[str, str] | None = None,
    unit: str = "",
    label: str = "",
) -> msgspec.Meta:
    """The annotation of a setting.

    Args:
        group: Heading it is listed under.
        meaning: What it does, for a person, in a sentence or two.
        low, high: Smallest and largest value of a number.
        choices: Words it may be, each with what it means.
        unit: Of the number.
        label: What the window calls it; empty where the window does not show it.
    """
    extra = {"group": group, "choices": choices or {}, "unit": unit, "label": label}
    return msgspec.Meta(ge=low, le=high, description=meaning, extra=extra)


@dataclass(frozen=True, slots=True)
class Setting:
    """One setting as it was declared. Attributes as the arguments of `setting`, and what the field itself says."""

    name: str
    kind: type[bool | int | float | str]
    default: Value
    group: str
    meaning: str
    bounds: tuple[float, float] | None
    choices: Mapping[str, str]
    unit: str
    label: str

    @property
    def allowed(self) -> str:
        """What it may be, as part of a sentence."""
        if self.choices:
            *others, last = map(repr, self.choices)
            return f"{', '.join(others)} or {last}" if others else last
        between = " between {} and {}".format(*map(value_text, self.bounds)) if self.bounds else ""
        return _KINDS[self.kind] + between

    @property
    def span(self) -> str:
        """What it may be, as briefly as possible: "1 to 256 values"."""
        if self.bounds is None:
            return ", ".join(self.choices or ("false", "true"))
        low, high = map(value_text, self.bounds)
        return f"{low} to {high} {self.unit}".rstrip()

    def check(self, value: object) -> None:
        """See that it may have this value. Raises ProjectError if it may not."""
        if not self._allows(value):
            raise ProjectError(f"{self.name} is {value!r:.60}; it has to be {self.allowed}.")

    def _allows(self, value: object) -> bool:
        if type(value) is not self.kind and not (self.kind is float and type(value) is int):
            return False
        if self.choices:
            return value in self.choices
        return self.bounds is None or (isinstance(value, int | float) and self.bounds[0] <= value <= self.bounds[1])

    def parse(self, text: str) -> Value:
        """A value as it is written on the command line. Raises ProjectError if it is not one."""
        try:
            return _BOOLEANS[text.lower()] if self.kind is bool else self.kind(text)
        except (KeyError, ValueError) as error:
            raise ProjectError(f"{self.name} is '{text:.60}'; it has to be {self.allowed}.") from error


def value_text(value: Value) -> str:
    """A value as it is written on the command line."""
    if isinstance(value, bool):
        return str(value).lower()
    return str(int(value) if isinstance(value, float) and value.is_integer() else value)


def settings_of(declared: type[msgspec.Struct]) -> dict[str, Setting]:
    """All settings that a struct declares, by name, in order."""
    hints = typing.get_type_hints(declared, include_extras=True)
    fields = msgspec.structs.fields(declared)
    return {field.name: _setting(field.name, hints[field.name], field.default) for field in fields}


def _setting(name: str, hint: Any, default: Value) -> Setting:
    meta: msgspec.Meta = hint.__metadata__[0]
    bounds = None if meta.ge is None or meta.le is None else (meta.ge, meta.le)
    return Setting(name, hint.__origin__, default, meaning=meta.description or "", bounds=bounds, **(meta.extra or {}))
