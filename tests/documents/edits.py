"""What edits do, as a table, from the declarations of their actions."""

from __future__ import annotations

from engine.editing.actions import ACTIONS, FAR, Action
from engine.setting import Setting, settings_of
from tests.documents.table import table


def edits_table() -> str:
    """A row per action: what it is called, what it does, and how the command line and scripts name it."""
    rows = [(kind.label, kind.meaning, _options(kind), _script(name, kind)) for name, kind in ACTIONS.items()]
    return table(("edit", "does", "command line", "Python"), rows)


def _options(kind: type[Action]) -> str:
    names = [
        f"`{' '.join([name, flag.like or ' '.join(one.like for one in values)]).strip()}`"
        for name, (flag, values) in kind.flags().items()
    ]
    return ", ".join(names + ([f"`--{kind.opposite}` everything else"] if kind.opposite else []))


def _script(name: str, kind: type[Action]) -> str:
    values = ", ".join(f"`{one.name}`{_range(one)}" for one in settings_of(kind).values())
    names = [name] + ([kind.opposite] if kind.opposite else [])
    return ", ".join(f'`"{one}"`' for one in names) + (f": {values}" if values else "")


def _range(one: Setting) -> str:
    is_limited = one.bounds is not None and one.bounds[1] < min(FAR, 2**31 - 1)
    return f" {one.span}" if is_limited or one.choices else ""
