"""How a setting is declared, and what is derived from the declaration: checks, parsing, help, forms, documentation.

A setting is a field of a msgspec struct, annotated with `setting(...)`. Its type, default, range, choices, unit and
words stand there and nowhere else. Settings of trainings are declared in engine.training.config, those of exports in
app.export.jobs, values of edits in engine.editing.actions.
"""

from __future__ import annotations

import types
import typing
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from decimal import Decimal
from functools import cache
from typing import Any, NamedTuple

import msgspec

from engine.errors import ProjectError

Value = bool | int | float | str
_BOOLEANS = {"true": True, "yes": True, "1": True, "false": False, "no": False, "0": False}
_KINDS = {bool: "true or false", int: "a whole number", float: "a number", str: "one word", tuple: "numbers"}


class Flag(NamedTuple):
    """How the command line writes a setting.

    Attributes:
        name: With its dashes.
        meaning: Where it is not that of the setting.
        constant: The value that it stands for; None where a value follows it.
        prefix: The value's beginning that the command line leaves out.
        like: The placeholder in help for the value, where it is written otherwise than the setting's.
        read: Makes the value of the numbers that are written so. Raises ValueError.
    """

    name: str
    meaning: str = ""
    constant: Any = None
    prefix: str = ""
    like: str = ""
    read: Callable[[tuple[float, ...]], Any] | None = None


class Writing(NamedTuple):
    """How a value of several numbers is written.

    Attributes:
        like: In help: "WxH".
        words: As part of a sentence.
        read: The value of a text. Raises ValueError.
        text: The opposite.
    """

    like: str
    words: str
    read: Callable[[str], Any]
    text: Callable[[Any], str]


def setting(
    group: str,
    meaning: str,
    *,
    low: float | None = None,
    high: float | None = None,
    choices: Mapping[str, str] | None = None,
    unit: str = "",
    label: str = "",
    none: str = "",
    titles: Mapping[str, str] | None = None,
    flags: tuple[Flag, ...] = (),
    writing: Writing | None = None,
    like: str = "",
    step: float = 0.0,
    offered: tuple[float, float] | None = None,
    one_of: str = "",
    names: str = "",
    shown_with: Mapping[str, tuple[str, ...]] | None = None,
) -> msgspec.Meta:
    """The annotation of a setting.

    Args:
        group: Heading it is listed under.
        meaning: Its effect, for a person, in a sentence or two.
        low, high: Smallest and largest value of a number, or of each of several.
        choices: Words it may be, each with what it means.
        unit: Of the number.
        label: Its name in the window; empty where the window does not show it.
        none: The meaning of None.
        titles: Names of the window's choices, by the text of the value (empty for None). Without them it offers
            the choices, or lets the user type.
        flags: How the command line writes it, of which one can be given; `--name` where there are none.
        writing: Of a value of several numbers.
        like: The placeholder for the value in the command line's help; a word for each of several numbers.
        step: By how much a drag of one pixel changes a number in the window.
        offered: Smallest and largest value that a field of the window takes, where not all that are allowed are of use.
        one_of: Of settings with the same word here, exactly one is given.
        names: Where its values are listed: "cameras", "paths" or "frames"; what they are called is `titles["*"]`.
        shown_with: Values of another setting, by its name, with which the window shows it.
    """
    bounds = None if low is None or high is None else (low, high)
    said = {"group": group, "choices": choices, "bounds": bounds, "unit": unit, "label": label, "none": none}
    said |= {"titles": titles, "flags": flags, "writing": writing, "like": like, "step": step}
    said |= {"offered": offered, "one_of": one_of, "names": names, "shown_with": shown_with}
    return msgspec.Meta(description=meaning, extra=said)


@dataclass(frozen=True, slots=True)
class Setting:
    """One setting as it was declared. Attributes as the arguments of `setting`, and what the field itself says."""

    name: str
    kinds: tuple[type, ...]
    default: Any
    meaning: str
    flags: tuple[Flag, ...]
    group: str = ""
    choices: Mapping[str, str] = field(default_factory=dict)
    bounds: tuple[float, float] | None = None
    unit: str = ""
    label: str = ""
    none: str = ""
    titles: Mapping[str, str] = field(default_factory=dict)
    writing: Writing | None = None
    like: str = ""
    step: float = 0.005
    offered: tuple[float, float] | None = None
    one_of: str = ""
    names: str = ""
    shown_with: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    @property
    def kind(self) -> type:
        """Of the value, unless it is None."""
        return self.kinds[0]

    @property
    def inner(self) -> dict[str, Setting]:
        """The settings of which it consists; none where it is a plain value."""
        return settings_of(self.kind) if issubclass(self.kind, msgspec.Struct) else {}

    @property
    def allowed(self) -> str:
        """The allowed values, as part of a sentence."""
        if self.choices:
            *others, last = map(repr, self.choices)
            return f"{', '.join(others)} or {last}" if others else last
        between = "between {} and {}".format(*map(value_text, self.bounds)) if self.bounds else ""
        if self.writing is not None:
            return self.writing.words + (between and f", with numbers {between}")
        return f"{_KINDS.get(self.kind) or f'a {self.kind.__name__}'} {between}".rstrip()

    @property
    def span(self) -> str:
        """The allowed values, as briefly as possible: "1 to 256 values"."""
        if self.bounds is None:
            return ", ".join(self.choices or ("false", "true"))
        low, high = map(value_text, self.bounds)
        return f"{low} to {high} {self.unit}".rstrip()

    @property
    def usual(self) -> str:
        """The default, in words."""
        return self.none if self.default is None else self.text(self.default)

    def check(self, value: object) -> None:
        """Check that it may have this value. Raises ProjectError if it may not."""
        if not (self._allows(value) or (value is None and self.default is None)):
            name = self.name if self.group else self.label or self.name
            raise ProjectError(f"{name} is {value!r:.60}; it has to be {self.allowed}.")

    def _allows(self, value: Any) -> bool:
        if type(value) not in self.kinds and not (self.kind is float and type(value) is int):
            return False
        return self.is_within(value)

    def is_within(self, value: Any) -> bool:
        """Whether a value of its type is one of the choices, and within the bounds."""
        if self.choices:
            return value in self.choices
        parts: tuple[Any, ...] = value if isinstance(value, tuple) else (value,)
        return self.bounds is None or all(self.bounds[0] <= part <= self.bounds[1] for part in parts)

    def parse(self, text: str) -> Any:
        """A value as it is written on the command line. Raises ProjectError if it is not one."""
        try:
            if self.writing is not None:
                return self.writing.read(text)
            return _BOOLEANS[text.lower()] if self.kind is bool else self.kind(text)
        except (KeyError, ValueError) as error:
            name = self.name if self.group else self.flags[0].name
            raise ProjectError(f"{name} is '{text:.60}'; it has to be {self.allowed}.") from error

    def text(self, value: Any) -> str:
        """The opposite of `parse`; empty for None."""
        return "" if value is None else self.writing.text(value) if self.writing else value_text(value)

    def flag_of(self, value: Any) -> Flag:
        """The command line's text for a value that is not None."""
        return next(
            flag
            for flag in self.flags
            if (isinstance(value, msgspec.Struct) or flag.constant == value)
            or (flag.constant is None and self.text(value).startswith(flag.prefix))
        )


class Declared(msgspec.Struct, frozen=True):
    """Base of structs that check their settings when they are made, and raise ProjectError."""

    def __post_init__(self) -> None:
        for name, declared in settings_of(type(self)).items():
            declared.check(getattr(self, name))


def value_text(value: Value) -> str:
    """A value as it is written on the command line, without an exponent: argparse takes -1e-05 for an option."""
    if isinstance(value, bool):
        return str(value).lower()
    if not isinstance(value, float):
        return str(value)
    return str(int(value)) if value.is_integer() else format(Decimal(repr(value)), "f")


@cache
def settings_of(declared: type[msgspec.Struct]) -> dict[str, Setting]:
    """All settings that a struct declares, by name, in order."""
    hints = typing.get_type_hints(declared, include_extras=True)
    fields = [one for one in msgspec.structs.fields(declared) if hasattr(hints[one.name], "__metadata__")]
    return {one.name: _setting(one.name, hints[one.name], one.default) for one in fields}


def _setting(name: str, hint: Any, default: Any) -> Setting:
    meta: msgspec.Meta = hint.__metadata__[0]
    declared = typing.get_args(hint.__origin__) if isinstance(hint.__origin__, types.UnionType) else [hint.__origin__]
    kinds = tuple(_plain(kind) for kind in declared if kind is not types.NoneType)
    said = {key: part for key, part in (meta.extra or {}).items() if part}
    said.setdefault("flags", (Flag(f"--{name.replace('_', '-')}"),))
    return Setting(name, kinds, default, meta.description or "", **said)


def _plain(kind: Any) -> type:
    origin = typing.get_origin(kind)
    return str if origin is typing.Literal else origin or kind
