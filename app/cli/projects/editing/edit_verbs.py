"""Verbs of `clipgstream edit`: `edit PROJECT move --by 0 0 1 --object "left player"`, from the declared actions.

A verb stands for the options of its action: `move --by X Y Z` is `--move X Y Z`.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass

from app.cli.projects.editing.copy_verbs import COPY_VERBS
from app.cli.projects.editing.follow_verb import FOLLOW
from app.document.changes.timing_changes import TIME_EDITS
from engine.editing.actions import ACTIONS, Action
from engine.errors import ProjectError


@dataclass(frozen=True, slots=True)
class EditVerb:
    """One verb.

    Attributes:
        meaning: Its effect, for help.
        kind: Its action.
        flag: The option it stands for, whose values follow `word`; of an action without values just that.
        word: The option of the verb; empty of an action without values.
    """

    meaning: str
    kind: type[Action]
    flag: str
    word: str = ""

    @property
    def flags(self) -> tuple[str, ...]:
        """All options of its action."""
        return tuple(self.kind.flags())


_WORDS = {"move": "by", "recolour": "tint", "exposure": "by", "hold": "as-in", "smooth": "over"}
"""The word before the values of an option, when a verb stands for that option."""
_NAMES = {"exposure": "expose"}
"""Verbs that are not called like the option."""


def _verbs() -> dict[str, EditVerb]:
    found: dict[str, EditVerb] = {}
    for kind in ACTIONS.values():
        flag = next(iter(kind.flags()))
        name, meaning = flag[2:], f"{kind.meaning[0].lower()}{kind.meaning[1:]}"
        found[_NAMES.get(name, name)] = EditVerb(meaning, kind, flag, _WORDS.get(name, ""))
        if kind.opposite:
            found[kind.opposite] = EditVerb(f"{kind.label.lower()}s everything else", kind, f"--{kind.opposite}")
    return found


VERBS = _verbs()
"""By name."""


def add_verb_arguments(command: argparse.ArgumentParser) -> None:
    """The words that follow verbs."""
    group = command.add_argument_group("after a verb")
    for word in dict.fromkeys(verb.word for verb in VERBS.values() if verb.word):
        meant = ", ".join(f"{verb.flag} for {name}" for name, verb in VERBS.items() if verb.word == word)
        meant += ", or the speed" if word == "by" else ""
        group.add_argument(f"--{word}", nargs="+", type=float, metavar="VALUE", help=f"the values of {meant}")


def take_verb(options: argparse.Namespace) -> None:
    """Replace a verb and its values by the options it stands for.

    Raises:
        ProjectError: Values are missing, too many, or of another verb.
    """
    name, *rest = options.words or [""]
    verb = VERBS.get(name)
    if name and verb is None:
        raise ProjectError(
            f"'{name}' is not a verb.", hint=f"Verbs are {', '.join((*VERBS, FOLLOW, *COPY_VERBS, *TIME_EDITS))}."
        )
    if rest:
        raise ProjectError(f"{name} is followed by '{rest[0]}', which is not an option of it.")
    check_words(options, name or "an edit without a verb", "" if verb is None else verb.word)
    if verb is None:
        return
    if not verb.word:
        setattr(options, _field(verb.flag[2:]), True)
        return
    values = getattr(options, _field(verb.word))
    if values is None:
        if not any(getattr(options, _field(flag[2:])) for flag in verb.flags):
            others = [flag for flag in verb.flags if flag != verb.flag]
            also = f", or {', '.join(others)}" if others else ""
            raise ProjectError(f"The values of {name} are missing.", hint=f"Give --{verb.word}{also}.")
        return
    settings = verb.kind.flags()[verb.flag][1]
    n = sum(len(one.like.split()) for one in settings)
    like = " ".join(one.like for one in settings)
    if len(values) != n:
        raise ProjectError(f"--{verb.word} has {len(values)} values; {name} takes {n}: {like}.")
    if settings[0].kind is int:
        if not all(value.is_integer() for value in values):
            raise ProjectError(f"--{verb.word} {values[0]:g} is not a whole number.")
        values = [int(value) for value in values]
    if getattr(options, _field(verb.flag[2:])):
        raise ProjectError(f"--{verb.word} and {verb.flag} are given together.", hint="Give one of them.")
    setattr(options, _field(verb.flag[2:]), values)
    options.said_as = {verb.flag: f"{name} --{verb.word}"}


def check_words(options: argparse.Namespace, verb: str, allowed: str) -> None:
    """Check that no word of another verb is given. allowed: The only one that may be. Raises ProjectError."""
    for word in sorted({one.word for one in VERBS.values() if one.word} - {allowed}):
        if getattr(options, _field(word)) is not None:
            raise ProjectError(f"--{word} does not go with {verb}.", hint=_hint(word))


def _field(option: str) -> str:
    return option.replace("-", "_")


def _hint(word: str) -> str:
    return f"It goes with {' and '.join(name for name, verb in VERBS.items() if verb.word == word)}."
